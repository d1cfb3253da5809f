// What an archive of a session holds besides its frames: the files' names, and the session's record.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>

#include "glasswing/v1/session.pb.h"

namespace glasswing {

inline constexpr char kArchivedMatte[] = "matte.exr", kArchivedMattes[] = "mattes";

struct SessionRecord {
  v1::Session session;
  std::string computes;  // versions of what made its matte: "gaussian/1 matte/1"
};

// In session.json below the directory.
absl::Status write_session_record(const SessionRecord& record, const std::filesystem::path& directory);
// DATA_LOSS names the file.
absl::StatusOr<SessionRecord> read_session_record(const std::filesystem::path& directory);

}  // namespace glasswing
