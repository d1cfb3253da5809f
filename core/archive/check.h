// Collects the findings of `fsck`, and repairs them if requested. The checks themselves are in check_archive
// and server/fsck/check_server.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/file/set_aside.h"

namespace glasswing {

struct Finding {
  std::string file;       // or directory
  std::string what;       // is wrong with it
  std::string meaning;    // the consequence, for the owner of the data
  std::string repair;     // what a repair does, or did; empty: it cannot be repaired here
  bool is_damage = true;  // false: left over from an interrupted write; nothing is missing
  bool repaired = false;
  std::string error = {};  // why the repair failed
};

struct CheckReport {
  std::string kind;  // "server", "archives", "archive", "matte" or "rig"
  std::vector<Finding> findings;
  std::int64_t file_count = 0, byte_count = 0;  // read so far
  bool in_use = false;                          // by a daemon, whose unfinished writes may pass for damage
};

class Check {
 public:
  // `tell` is called after every file that was read.
  Check(CheckReport& report, bool repair, std::function<void()> tell)
      : report_(report), repair_(repair), tell_(std::move(tell)) {}

  // Adds a finding. `mend` repairs it, and is called at once if a repair was requested.
  void found(Finding finding, const std::function<absl::Status()>& mend = nullptr);
  // Like read_file(); adds to the report's counts.
  absl::StatusOr<std::string> read(const std::filesystem::path& file);
  CheckReport& report() { return report_; }

 private:
  CheckReport& report_;
  const bool repair_;
  const std::function<void()> tell_;
};

// Finds temporary files anywhere below `directory`; a repair removes them.
void check_leftovers(const std::filesystem::path& directory, Check& check);

}  // namespace glasswing
