// Composites of finished mattes over uploaded pictures, made by the program glasswing-compositing one after
// another, at the lowest priority, and kept beside the mattes.
#pragma once

#include <absl/status/status.h>

#include <future>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "server/storage/image_files.h"
#include "server/storage/matte_files.h"

namespace glasswing {

// For one thread.
class Composites {
 public:
  Composites(const MatteFiles& mattes, const ImageFiles& images) : mattes_(mattes), images_(images) {}
  ~Composites();

  // UNIMPLEMENTED: this installation lacks the program. Thread-safe.
  static absl::Status check_installed();

  // What became of the composites of these sessions over the pictures, by monitor. Begins them if it has not;
  // absent: they are not done. An outcome is told once.
  std::optional<absl::Status> outcome(const std::vector<std::string>& sessions,
                                      const std::map<std::string, std::string>& background);

 private:
  absl::Status make(const std::string& session, const std::map<std::string, std::string>& background) const;

  const MatteFiles& mattes_;
  const ImageFiles& images_;
  std::stop_source stop_;
  std::vector<std::string> made_;      // the sessions of running_
  std::future<absl::Status> running_;  // invalid: none
};

}  // namespace glasswing
