#include "server/solve/join_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string_view>
#include <vector>

#include "core/base/mapped_file.h"
#include "core/base/status.h"
#include "core/matte/join_mattes.h"
#include "core/matte/matte_file.h"
#include "server/storage/matte_files.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxBlankRows = 64;  // unpacked in memory at a time

absl::StatusOr<std::shared_ptr<const MappedFile>> open_tile(const fs::path& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) return absl::DataLossError(fmt::format("{}: {}", path.string(), error.message()));
  GW_ASSIGN_OR_RETURN(std::shared_ptr<const MappedFile> file, MappedFile::open(path, size));
  if (!is_named_after(path, file->bytes()) || !file->intact())
    return absl::DataLossError(fmt::format("{} is damaged: solve the session again", path.string()));
  return file;
}

// Files of blank rows wherever `there` is false, shaped as `like`.
absl::StatusOr<std::vector<std::string>> blank_rows(const std::vector<bool>& there,
                                                    const MatteOutline& like) {
  const auto height_px = static_cast<int>(there.size());
  std::vector<std::string> blanks;
  for (int y = 0, rows = 1; y < height_px; y += rows) {
    const auto next = std::find(there.begin() + y, there.end(), !there[static_cast<size_t>(y)]);
    rows = static_cast<int>(next - there.begin()) - y;
    if (there[static_cast<size_t>(y)]) continue;
    rows = std::min(rows, kMaxBlankRows);
    Matte blank(0, y, like.width_px, rows, like.modes_per_channel, like.colourless);
    blank.metadata = like.metadata;
    for (int row = 0; row < rows; ++row) {
      for (int x = 0; x < blank.width_px(); ++x) blank.flags(x, row) = kFlagNoData;
    }
    GW_ASSIGN_OR_RETURN(blanks.emplace_back(), encode_matte(blank));
  }
  return blanks;
}

}  // namespace

absl::StatusOr<std::string> join_tiles(std::span<const TileState> tiles, const fs::path& directory) {
  int height_px = 0;
  for (const TileState& tile : tiles) height_px = std::max(height_px, tile.range.first + tile.range.count);
  std::vector<std::shared_ptr<const MappedFile>> files;
  std::vector<bool> there(static_cast<size_t>(height_px), false);
  for (const TileState& tile : tiles) {
    if (!tile.is_done()) continue;
    GW_ASSIGN_OR_RETURN(files.emplace_back(), open_tile(directory / tile.done.result));
    std::fill_n(there.begin() + tile.range.first, tile.range.count, true);
  }
  if (files.empty()) return absl::FailedPreconditionError("none of its tiles is solved yet");
  GW_ASSIGN_OR_RETURN(const MatteOutline like, outline_of(files.front()->bytes()));
  GW_ASSIGN_OR_RETURN(const std::vector<std::string> blanks, blank_rows(there, like));
  std::vector<std::string_view> parts(blanks.begin(), blanks.end());
  for (const std::shared_ptr<const MappedFile>& file : files) parts.push_back(file->bytes());
  absl::StatusOr<std::string> whole = join_mattes(parts);
  for (const std::shared_ptr<const MappedFile>& file : files) {
    if (!file->intact()) return absl::DataLossError("a tile's file cannot be read to its end");
  }
  return whole;
}

}  // namespace glasswing
