#include "core/matte/join_mattes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "core/base/status.h"
#include "core/matte/exr_header.h"
#include "core/matte/exr_writer.h"
#include "core/matte/matte_head.h"
#include "core/matte/matte_layers.h"

namespace glasswing {
namespace {

constexpr size_t kOffsetBytes = sizeof(std::uint64_t);  // of an entry of a chunk table

struct Tile {
  std::string_view bytes;
  MatteHead head;
  size_t tables_at = 0;  // offset of the chunk tables, which hold the offsets of each part's rows

  size_t row_count() const { return static_cast<size_t>(head.outline.height_px); }
};

absl::StatusOr<Tile> open_tile(std::string_view bytes) {
  Tile tile{.bytes = bytes, .head = {}, .tables_at = 0};
  GW_ASSIGN_OR_RETURN(tile.tables_at, check_exr_header(bytes));
  GW_ASSIGN_OR_RETURN(tile.head, read_matte_head(bytes));
  return tile;
}

// Checks that the tiles cover all rows from the top, once each.
absl::Status check_rows(const std::vector<Tile>& tiles) {
  const MatteOutline& first = tiles.front().head.outline;
  int next = 0;
  for (const Tile& tile : tiles) {
    const MatteOutline& outline = tile.head.outline;
    if (outline.x0_px != 0 || outline.width_px != first.metadata.width_px())
      return absl::DataLossError(fmt::format("the tile from row {} on contains partial rows", outline.y0_px));
    if (outline.modes_per_channel != first.modes_per_channel || outline.colourless != first.colourless)
      return absl::DataLossError(
          fmt::format("the tile from row {} on has other layers than the first", outline.y0_px));
    if (outline.y0_px < next)
      return absl::DataLossError(fmt::format("two tiles cover row {}", outline.y0_px));
    if (outline.y0_px > next) return absl::DataLossError(fmt::format("no tile covers row {}", next));
    next += outline.height_px;
  }
  if (next < first.metadata.height_px())
    return absl::DataLossError(fmt::format("no tile covers row {}", next));
  if (next > first.metadata.height_px())
    return absl::DataLossError(fmt::format("a tile covers row {}, which the picture has not", next - 1));
  return absl::OkStatus();
}

absl::Status no_table(const Tile& tile) {
  return absl::DataLossError(
      fmt::format("the tile from row {} on does not say where its rows are", tile.head.outline.y0_px));
}

std::uint64_t number_at(std::string_view bytes, size_t at) {
  std::uint64_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

}  // namespace

absl::StatusOr<std::string> join_mattes(std::span<const std::string_view> files) {
  if (files.empty()) return absl::DataLossError("no tile has been solved");
  std::vector<Tile> tiles;
  for (const std::string_view file : files) {
    GW_ASSIGN_OR_RETURN(Tile tile, open_tile(file));
    tiles.push_back(std::move(tile));
  }
  std::ranges::sort(tiles, {}, [](const Tile& tile) { return tile.head.outline.y0_px; });
  GW_RETURN_IF_ERROR(check_rows(tiles));
  const MatteOutline& first = tiles.front().head.outline;
  std::string row_checksums;
  size_t size = 0;
  for (const Tile& tile : tiles) {
    row_checksums += tile.head.row_checksums;
    size += tile.bytes.size();
  }
  std::vector<ExrPart> parts = matte_parts(first.modes_per_channel, first.colourless);
  describe(parts, json_of(first.metadata), row_checksums);
  GW_ASSIGN_OR_RETURN(std::string whole, written_exr([&] {
                        return ExrWriter(parts, {.width_px = first.metadata.width_px(),
                                                 .height_px = first.metadata.height_px(),
                                                 .picture_width_px = first.metadata.width_px(),
                                                 .picture_height_px = first.metadata.height_px()})
                            .finish();
                      }));
  const auto row_count = static_cast<size_t>(first.metadata.height_px());
  const size_t tables_at = whole.size() - parts.size() * row_count * kOffsetBytes;
  whole.reserve(whole.size() + size);
  for (const Tile& tile : tiles) {
    // Everything after the tables is rows, which are copied as one block.
    const size_t rows_at = tile.tables_at + parts.size() * tile.row_count() * kOffsetBytes;
    const size_t put_at = whole.size();
    if (rows_at > tile.bytes.size()) return no_table(tile);
    whole += tile.bytes.substr(rows_at);
    for (size_t part = 0; part < parts.size(); ++part) {
      for (size_t row = 0; row < tile.row_count(); ++row) {
        const std::uint64_t was_at =
            number_at(tile.bytes, tile.tables_at + (part * tile.row_count() + row) * kOffsetBytes);
        if (was_at < rows_at || was_at >= tile.bytes.size()) return no_table(tile);
        const std::uint64_t is_at = was_at - rows_at + put_at;
        const size_t row_of_whole = static_cast<size_t>(tile.head.outline.y0_px) + row;
        std::memcpy(&whole[tables_at + (part * row_count + row_of_whole) * kOffsetBytes], &is_at,
                    kOffsetBytes);
      }
    }
  }
  return whole;
}

}  // namespace glasswing
