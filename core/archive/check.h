// What `glasswing fsck` finds in a data directory, and what it does about it. The checks themselves are in
// check_archive, check_mattes, check_server.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace glasswing {

struct Finding {
  std::string file;       // or directory
  std::string what;       // is wrong with it
  std::string meaning;    // to whoever the data belong
  std::string repair;     // what a repair does, or did; empty: it cannot be repaired here
  bool is_damage = true;  // false: what a write that broke off left; nothing is missing
  bool repaired = false;
  std::string error = {};  // why the repair failed
};

struct CheckReport {
  std::string kind;  // "server", "archives", "archive" or "matte"
  std::vector<Finding> findings;
  std::int64_t file_count = 0, byte_count = 0;  // that were read
  bool in_use = false;                          // by a daemon: what it was just writing may pass for damage
};

class Check {
 public:
  // `root`: below whose damaged/ things are set aside. `tell` hears of every file that was read.
  Check(CheckReport& report, bool repair, std::function<void()> tell)
      : report_(report), repair_(repair), tell_(std::move(tell)) {}

  // With a repair: `mend` is tried at once, where it is asked for.
  void found(Finding finding, const std::function<absl::Status()>& mend = nullptr);
  // Errors as read_file(); counted.
  absl::StatusOr<std::string> read(const std::filesystem::path& file);
  CheckReport& report() { return report_; }

 private:
  CheckReport& report_;
  const bool repair_;
  const std::function<void()> tell_;
};

// Nothing that may hold data is ever removed: it goes to `root`/damaged, under its name below `root`.
absl::Status set_aside(const std::filesystem::path& root, const std::filesystem::path& path);
// The file stays too, to be replaced.
absl::Status copy_aside(const std::filesystem::path& root, const std::filesystem::path& file);

// Temporary files anywhere below.
void check_leftovers(const std::filesystem::path& directory, Check& check);

inline constexpr char kDamagedDirectory[] = "damaged";

}  // namespace glasswing
