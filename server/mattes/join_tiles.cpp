#include "server/mattes/join_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/file/mapped_file.h"
#include "core/matte/matte_file.h"
#include "core/matte/packed_matte.h"
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

// Appends `count` blank rows to a matte shaped as `like`.
absl::Status add_blank_rows(int first, int count, const MatteOutline& like, PackedMatteWriter& writer) {
  for (int rows = 0; count > 0; first += rows, count -= rows) {
    rows = std::min(count, kMaxBlankRows);
    Matte blank(0, first, like.width_px, rows, like.modes_per_channel, like.colourless);
    blank.metadata = like.metadata;
    for (int row = 0; row < rows; ++row) {
      for (int x = 0; x < blank.width_px(); ++x) blank.flags(x, row) = kFlagNoData;
    }
    GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(blank));
    GW_RETURN_IF_ERROR(writer.add(bytes));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status join_tiles(std::span<const TileState> tiles, const fs::path& directory, PositionedFile& file) {
  std::vector<const TileState*> done;
  for (const TileState& tile : tiles) {
    if (tile.is_done()) done.push_back(&tile);
  }
  if (done.empty()) return absl::FailedPreconditionError("none of its tiles is solved yet");
  std::ranges::sort(done, {}, [](const TileState* tile) { return tile->range.first; });
  std::optional<PackedMatteWriter> writer;
  MatteOutline whole;
  int next_row = 0;
  for (const TileState* tile : done) {
    GW_ASSIGN_OR_RETURN(const auto bytes, open_tile(directory / tile->done.result));
    if (!writer) {
      GW_ASSIGN_OR_RETURN(whole, outline_of(bytes->bytes()));
      whole.y0_px = 0;
      whole.height_px = whole.metadata.height_px();
      GW_ASSIGN_OR_RETURN(writer, PackedMatteWriter::begin(whole, [&file](auto offset, auto part) {
                            return file.write_at(offset, part);
                          }));
    }
    GW_RETURN_IF_ERROR(add_blank_rows(next_row, tile->range.first - next_row, whole, *writer));
    GW_RETURN_IF_ERROR(writer->add(bytes->bytes()));
    if (!bytes->intact()) return absl::DataLossError("a tile's file cannot be read to its end");
    next_row = tile->range.first + tile->range.count;
  }
  GW_RETURN_IF_ERROR(add_blank_rows(next_row, whole.height_px - next_row, whole, *writer));
  return writer->finish();
}

}  // namespace glasswing
