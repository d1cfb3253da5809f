// Where finished mattes and what they are made of lie below the server's data:
//
//   mattes/SESSION.exr        of the last solve that finished; of a video
//   mattes/SESSION/0000.exr   a file a frame
//   mattes/SESSION+next.exr, mattes/SESSION+next/0000.exr
//                             of the solve that goes on, until it has finished: it then takes the other's
//                             place
//   tiles/SESSION/            parts of that solve, each named after the checksum of its bytes
//
// No session's name has a '+'.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace glasswing {

// Of a tile's file, whose bytes have that checksum (checksum_of()).
std::string tile_name(std::int64_t job, int tile, int attempt, std::string_view checksum);
// Whether they are what was written under that name.
bool is_named_after(const std::filesystem::path& tile, std::string_view bytes);

// Its owner serialises changes.
class MatteFiles {
 public:
  explicit MatteFiles(std::filesystem::path data) : data_(std::move(data)) {}

  std::filesystem::path finished(const std::string& session) const;
  std::filesystem::path finished(const std::string& session, int frame) const;
  std::filesystem::path next(const std::string& session) const;
  std::filesystem::path next(const std::string& session, int frame) const;
  // Is there when this returns OK.
  absl::StatusOr<std::filesystem::path> tiles(const std::string& session) const;
  absl::Status make_next(const std::string& session) const;  // the frames' directory

  // Nothing of the solve that goes on is left, also after a power cut: what there is of one when a session is
  // done counts as finished.
  absl::Status drop_next(const std::string& session) const;
  // What that solve made takes the place of what was finished before, if anything was made. Repeated after a
  // crash it does what is left to do.
  absl::Status finish(const std::string& session) const;
  // Removes all there is; returns how many bytes.
  absl::StatusOr<std::int64_t> remove(const std::string& session) const;

 private:
  std::filesystem::path data_;
};

}  // namespace glasswing
