// The files of mattes below the server's data:
//
//   mattes/SESSION.exr        the matte of the last finished solve, or, for a video,
//   mattes/SESSION/0000.exr   one file per frame
//   mattes/SESSION+next.exr, mattes/SESSION+next/0000.exr
//                             those of the current solve, which replace the above when it finishes
//   mattes/SESSION+draft.exr  the newest draft, made while the session was captured; until a solve finishes
//   mattes/SESSION+composite.exr
//                             its object over pictures that an item of the queue named
//   tiles/SESSION/            parts of the current solve, each named after the checksum of its bytes
//   tiles/SESSION+put/        a matte solved elsewhere, while it arrives
//
// Session names contain no '+'.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/file/positioned_file.h"

namespace glasswing {

// The name of a tile's file; `checksum`: checksum_of() its bytes.
std::string tile_name(std::int64_t job, int tile, int attempt, std::string_view checksum);
// True if the bytes are those that were written under that name.
bool is_named_after(const std::filesystem::path& tile, std::string_view bytes);

// Its owner serialises changes.
class MatteFiles {
 public:
  explicit MatteFiles(std::filesystem::path data) : data_(std::move(data)) {}

  std::filesystem::path finished(const std::string& session) const;
  std::filesystem::path finished(const std::string& session, int frame) const;
  std::filesystem::path next(const std::string& session) const;
  std::filesystem::path next(const std::string& session, int frame) const;
  std::filesystem::path draft(const std::string& session) const;
  std::filesystem::path composite(const std::string& session) const;
  // All existing drafts, by session.
  std::map<std::string, std::filesystem::path> drafts() const;
  // The directory exists when this returns OK.
  absl::StatusOr<std::filesystem::path> tiles(const std::string& session) const;
  // The same, for a matte that arrives whole.
  absl::StatusOr<std::filesystem::path> arriving(const std::string& session) const {
    return tiles(session + "+put");
  }
  // A file for a matte that is only sent, on the same disk.
  absl::StatusOr<PositionedFile> unnamed() const { return PositionedFile::create_unnamed(data_); }
  // Makes the directory for the current solve's frames.
  absl::Status make_next(const std::string& session) const;

  // Removes the files of the current solve durably: after a power cut they would count as finished once the
  // session is done.
  absl::Status drop_next(const std::string& session) const;
  // Replaces the finished mattes with those of the current solve, if it made any. Repeating it after a crash
  // completes it.
  absl::Status finish(const std::string& session) const;
  // What all files of the session take on disk.
  std::int64_t bytes(const std::string& session) const;
  // When its last solve finished; never: InfiniteFuture.
  absl::Time finished_at(const std::string& session) const;
  // Removes all files of the session. Returns how many bytes they had.
  absl::StatusOr<std::int64_t> remove(const std::string& session) const;

 private:
  // That a session may have, and the files that it has.
  std::vector<std::filesystem::path> directories(const std::string& session) const;
  std::vector<std::filesystem::path> files(const std::string& session) const;

  std::filesystem::path data_;
};

}  // namespace glasswing
