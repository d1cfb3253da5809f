#include "core/matte/packed_matte.h"

#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStdIO.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>

#include "core/base/status.h"
#include "core/matte/exr_header.h"
#include "core/matte/exr_writer.h"
#include "core/matte/matte_head.h"
#include "core/matte/matte_layers.h"

namespace glasswing {
namespace {

constexpr size_t kOffsetBytes = sizeof(std::uint64_t);  // of an entry of a table of rows
constexpr int kMaxPixelsAtATime = 1 << 17;              // decoded in memory
constexpr size_t kFirstRead_bytes = 64 << 10;
constexpr size_t kMaxHead_bytes = 64 << 20;

// Before each row's packed pixels.
struct ChunkHead {
  std::int32_t part = 0, y = 0, size = 0;
};
static_assert(sizeof(ChunkHead) == 12);

// Headers and a blank table of a file.
absl::StatusOr<std::string> blank_head(const MatteOutline& outline, std::string_view row_checksums) {
  std::vector<ExrPart> parts = matte_parts(outline.modes_per_channel, outline.colourless, outline.pyramids);
  describe(parts, json_of(outline.metadata), std::string(row_checksums));
  return written_exr([&] {
    return ExrWriter(parts, {.x0_px = outline.x0_px,
                             .y0_px = outline.y0_px,
                             .width_px = outline.width_px,
                             .height_px = outline.height_px,
                             .picture_width_px = outline.metadata.width_px(),
                             .picture_height_px = outline.metadata.height_px()})
        .finish();
  });
}

size_t part_count(const MatteOutline& outline) {
  return kFirstModePart + static_cast<size_t>(outline.modes_per_channel) + (outline.pyramids ? 1 : 0);
}

void put_table(std::span<const std::uint64_t> table, std::string& head) {
  std::memcpy(head.data() + head.size() - table.size_bytes(), table.data(), table.size_bytes());
}

// The headers and tables of a file, and where the tables begin.
struct Head {
  std::string bytes;
  size_t tables_at = 0;
};
absl::StatusOr<Head> read_head(const PositionedFile& file, std::uint64_t size_bytes) {
  Head head;
  // Its length is not stored.
  for (size_t size = kFirstRead_bytes;; size *= 2) {
    head.bytes.resize(std::min<std::uint64_t>(size, size_bytes));
    GW_RETURN_IF_ERROR(file.read_at(0, head.bytes));
    const absl::StatusOr<size_t> tables_at = check_exr_header(head.bytes);
    if (!tables_at.ok() && size < size_bytes && size < kMaxHead_bytes) continue;
    GW_RETURN_IF_ERROR(tables_at.status());
    head.tables_at = *tables_at;
    return head;
  }
}

absl::StatusOr<MatteHead> parse_head(const std::string& head, std::uint64_t size_bytes) {
  try {
    Imf::StdISStream stream;
    stream.str(head);
    const Imf::MultiPartInputFile parts(stream, 1, false);
    return read_matte_head(parts, size_bytes);
  } catch (const std::exception& error) {
    return absl::DataLossError(fmt::format("it is damaged or not a matte: {}", error.what()));
  }
}

// The pixels of every `step`-th column from `left` on, counted from the rows' first.
Matte columns_of(const Matte& rows, int left, int step, int x0_px, int y0_px, int width_px) {
  Matte part(x0_px, y0_px, width_px, rows.height_px(), rows.modes_per_channel(), rows.is_colourless());
  for (int y = 0; y < part.height_px(); ++y) {
    for (int x = 0; x < part.width_px(); ++x) part.copy_pixel(rows, left + x * step, y, x, y);
  }
  return part;
}

absl::Status check_packing(const MatteOutline& outline) {
  if (!outline.delivery) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "it was written for delivery (glasswing matte deliver); its rows cannot be copied");
}

}  // namespace

absl::StatusOr<PackedMatteReader> PackedMatteReader::open(const PositionedFile& file) {
  PackedMatteReader reader(file);
  GW_ASSIGN_OR_RETURN(const std::uint64_t size_bytes, file.size_bytes());
  GW_ASSIGN_OR_RETURN(const Head head, read_head(file, size_bytes));
  GW_ASSIGN_OR_RETURN(MatteHead parsed, parse_head(head.bytes, size_bytes));
  GW_RETURN_IF_ERROR(check_packing(parsed.outline));
  reader.outline_ = std::move(parsed.outline);
  reader.row_checksums_ = std::move(parsed.row_checksums);
  reader.table_.resize(part_count(reader.outline_) * static_cast<size_t>(reader.outline_.height_px));
  const size_t table_bytes = reader.table_.size() * kOffsetBytes;
  if (head.bytes.size() - head.tables_at < table_bytes)
    return absl::DataLossError("it is damaged or not a matte: it lacks the positions of its rows");
  std::memcpy(reader.table_.data(), head.bytes.data() + head.tables_at, table_bytes);
  for (const ExrPart& part :
       matte_parts(reader.outline_.modes_per_channel, reader.outline_.colourless, reader.outline_.pyramids)) {
    // A row that deflating would enlarge is stored plain.
    reader.max_row_bytes_.push_back(static_cast<std::uint32_t>(
        part.channels.size() * sizeof(float) * static_cast<size_t>(reader.outline_.width_px)));
  }
  return reader;
}

absl::Status PackedMatteReader::read_chunk(size_t part, int row, std::string& bytes) const {
  const std::uint64_t offset =
      table_[part * static_cast<size_t>(outline_.height_px) + static_cast<size_t>(row)];
  ChunkHead head;
  GW_RETURN_IF_ERROR(file_->read_at(offset, {reinterpret_cast<char*>(&head), sizeof head}));
  if (head.part != static_cast<int>(part) || head.y != outline_.y0_px + row || head.size < 0 ||
      static_cast<std::uint32_t>(head.size) > max_row_bytes_[part]) {
    return absl::DataLossError(
        fmt::format("it is damaged: its row {} is not where its table says", outline_.y0_px + row));
  }
  const size_t at = bytes.size();
  bytes.resize(at + sizeof head + static_cast<size_t>(head.size));
  return file_->read_at(offset, std::span(bytes).subspan(at));
}

absl::StatusOr<std::string> PackedMatteReader::rows(int first, int count, int step) const {
  MatteOutline tile = outline_;
  tile.y0_px += first;
  tile.height_px = count;
  std::string checksums;
  for (int row = 0; row < count; ++row)
    checksums += row_checksums_.substr(static_cast<size_t>(first + row * step) * kRowChecksumDigits,
                                       kRowChecksumDigits);
  GW_ASSIGN_OR_RETURN(std::string file, blank_head(tile, checksums));
  const size_t parts = part_count(outline_), head_size = file.size();
  std::vector<std::uint64_t> table(parts * static_cast<size_t>(count));
  for (int row = 0; row < count; ++row) {
    for (size_t part = 0; part < parts; ++part) {
      const size_t at = table[part * static_cast<size_t>(count) + static_cast<size_t>(row)] = file.size();
      GW_RETURN_IF_ERROR(read_chunk(part, first + row * step, file));
      const std::int32_t y = tile.y0_px + row;
      std::memcpy(file.data() + at + offsetof(ChunkHead, y), &y, sizeof y);
    }
  }
  std::memcpy(file.data() + head_size - table.size() * kOffsetBytes, table.data(),
              table.size() * kOffsetBytes);
  return file;
}

absl::Status PackedMatteReader::for_rows(int first, int count,
                                         absl::FunctionRef<absl::Status(const Matte& rows)> use,
                                         int step) const {
  const int at_a_time = std::max(kMaxPixelsAtATime / outline_.width_px, 1);
  for (int row = 0; row < count; row += at_a_time) {
    GW_ASSIGN_OR_RETURN(const std::string packed,
                        rows(first + row * step, std::min(at_a_time, count - row), step));
    GW_ASSIGN_OR_RETURN(const Matte matte, decode_matte(packed, Pyramids::kKept));
    GW_RETURN_IF_ERROR(use(matte));
  }
  return absl::OkStatus();
}

absl::StatusOr<PackedMatteWriter> PackedMatteWriter::begin(const MatteOutline& whole, Put put) {
  PackedMatteWriter writer(whole, std::move(put));
  const size_t rows = whole.height_px;
  GW_ASSIGN_OR_RETURN(const std::string head, blank_head(whole, std::string(rows * kRowChecksumDigits, '-')));
  writer.head_size_ = writer.at_ = head.size();
  writer.table_.resize(part_count(whole) * rows);
  return writer;
}

absl::Status PackedMatteWriter::check_next(const MatteOutline& tile) const {
  const int next = whole_.y0_px + next_row_, end = whole_.y0_px + whole_.height_px;
  if (tile.x0_px != whole_.x0_px || tile.width_px != whole_.width_px)
    return absl::DataLossError(fmt::format("the tile from row {} on contains partial rows", tile.y0_px));
  if (tile.modes_per_channel != whole_.modes_per_channel || tile.colourless != whole_.colourless ||
      tile.pyramids != whole_.pyramids)
    return absl::DataLossError(
        fmt::format("the tile from row {} on has different layers from the first", tile.y0_px));
  if (tile.y0_px < next) return absl::DataLossError(fmt::format("two tiles cover row {}", tile.y0_px));
  if (tile.y0_px > next) return absl::DataLossError(fmt::format("no tile covers row {}", next));
  if (tile.y0_px + tile.height_px > end)
    return absl::DataLossError(
        fmt::format("a tile covers row {}, which is not in the picture", tile.y0_px + tile.height_px - 1));
  return absl::OkStatus();
}

absl::Status PackedMatteWriter::add(std::string_view tile) {
  GW_ASSIGN_OR_RETURN(const size_t tables_at, check_exr_header(tile));
  GW_ASSIGN_OR_RETURN(const MatteHead head, read_matte_head(tile));
  const MatteOutline& outline = head.outline;
  GW_RETURN_IF_ERROR(check_packing(outline));
  GW_RETURN_IF_ERROR(check_next(outline));
  const auto rows = static_cast<size_t>(outline.height_px), all_rows = static_cast<size_t>(whole_.height_px);
  // Everything after the tables is rows, which are copied as one block.
  const size_t rows_at = tables_at + part_count(whole_) * rows * kOffsetBytes;
  const auto no_table = [&] {
    return absl::DataLossError(
        fmt::format("the tile from row {} on lacks the positions of its rows", outline.y0_px));
  };
  if (rows_at > tile.size()) return no_table();
  for (size_t part = 0; part < part_count(whole_); ++part) {
    for (size_t row = 0; row < rows; ++row) {
      std::uint64_t was_at = 0;
      std::memcpy(&was_at, tile.data() + tables_at + (part * rows + row) * kOffsetBytes, kOffsetBytes);
      if (was_at < rows_at || was_at >= tile.size()) return no_table();
      table_[part * all_rows + static_cast<size_t>(next_row_) + row] = was_at - rows_at + at_;
    }
  }
  GW_RETURN_IF_ERROR(put_(at_, tile.substr(rows_at)));
  at_ += tile.size() - rows_at;
  row_checksums_ += head.row_checksums;
  next_row_ += outline.height_px;
  return absl::OkStatus();
}

absl::Status PackedMatteWriter::finish() {
  if (next_row_ != whole_.height_px)
    return absl::DataLossError(fmt::format("no tile covers row {}", whole_.y0_px + next_row_));
  GW_ASSIGN_OR_RETURN(std::string head, blank_head(whole_, row_checksums_));
  put_table(table_, head);
  return put_(0, head);
}

absl::Status write_part(const PackedMatteReader& matte, const MattePart& part, PackedMatteWriter::Put put) {
  MatteOutline out = matte.outline();
  const MatteRegion region = part.region.value_or(MatteRegion{
      .x_px = out.x0_px, .y_px = out.y0_px, .width_px = out.width_px, .height_px = out.height_px});
  GW_RETURN_IF_ERROR(check_region(region, out.metadata.width_px(), out.metadata.height_px()));
  MatteRegion inside = region;  // counted from the data window's corner
  inside.x_px -= out.x0_px;
  inside.y_px -= out.y0_px;
  GW_RETURN_IF_ERROR(check_region(inside, out.width_px, out.height_px));
  const int step = sampling_step(region.width_px, region.height_px, part.max_pixels);
  out.x0_px = region.x_px / step;
  out.y0_px = region.y_px / step;
  out.width_px = sampled_length(region.width_px, step);
  out.height_px = sampled_length(region.height_px, step);
  if (step > 1) {
    v1::MatteMetadata& metadata = out.metadata;
    metadata.set_sampling_px(step * std::max(metadata.sampling_px(), 1));
    metadata.set_width_px(sampled_length(metadata.width_px(), step));
    metadata.set_height_px(sampled_length(metadata.height_px(), step));
  }
  GW_ASSIGN_OR_RETURN(PackedMatteWriter writer, PackedMatteWriter::begin(out, std::move(put)));
  int next = out.y0_px;
  GW_RETURN_IF_ERROR(matte.for_rows(
      inside.y_px, out.height_px,
      [&](const Matte& rows) -> absl::Status {
        Matte columns = columns_of(rows, inside.x_px, step, out.x0_px, next, out.width_px);
        columns.metadata = out.metadata;
        next += rows.height_px();
        GW_ASSIGN_OR_RETURN(const std::string tile, encode_matte(columns));
        return writer.add(tile);
      },
      step));
  return writer.finish();
}

}  // namespace glasswing
