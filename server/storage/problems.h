// Problems with the server's data and its job store, as readable text: what was found damaged and set
// aside, and what does not answer. The server works without it; `glasswing doctor` and `nodes`, the console
// and the metrics show it.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace glasswing {

// The subject of the job store.
inline constexpr char kJobStore[] = "job store";

// Thread-safe.
class Problems {
 public:
  // `text`: what happened, and what to do. Replaces the text about the subject; a new text is logged.
  void set(const std::string& subject, const std::string& text);
  void clear(const std::string& subject);
  std::vector<std::string> all() const;  // texts, by subject
  // RFC 3339, UTC: when something was first reported about the subject. Empty: nothing is.
  std::string since(const std::string& subject) const;

  // Moves a damaged file below `data` to damaged/, and reports it. `advice`: what to do.
  absl::Status set_aside(const std::filesystem::path& data, const std::filesystem::path& file,
                         const absl::Status& damage, const std::string& advice);
  // The same together with the logs of an SQLite database, which would otherwise be used for a new file.
  absl::Status set_aside_database(const std::filesystem::path& data, const std::filesystem::path& file,
                                  const absl::Status& damage, const std::string& advice);
  // Reports what damaged/ contains from earlier.
  void note_set_aside(const std::filesystem::path& data);

 private:
  struct Problem {
    std::string text, since;
  };
  mutable std::mutex mutex_;
  std::map<std::string, Problem> problems_;  // by subject; guarded by mutex_
};

}  // namespace glasswing
