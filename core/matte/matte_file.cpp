#include "core/matte/matte_file.h"

#include <ImathBox.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfTileDescription.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <mutex>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/matte/exr_header.h"
#include "core/matte/exr_writer.h"
#include "core/matte/matte_head.h"
#include "core/matte/matte_layers.h"

namespace glasswing {
namespace {

class MemoryReader final : public Imf::IStream {
 public:
  explicit MemoryReader(std::string_view bytes) : IStream("matte"), bytes_(bytes) {}
  bool read(char c[], int n) override {
    const size_t size = n;
    if (at_ > bytes_.size() || bytes_.size() - at_ < size) throw std::runtime_error("it ends too early");
    std::memcpy(c, bytes_.data() + at_, size);
    at_ += size;
    return at_ < bytes_.size();
  }
  uint64_t tellg() override { return at_; }
  void seekg(uint64_t position) override { at_ = position; }

 private:
  std::string_view bytes_;
  size_t at_ = 0;
};

absl::Status check(const Matte& matte, int first, int rows) {
  const bool boxes = matte.metadata.footprint() == kBoxFootprint;
  const auto is_good = [&](const Mode& mode) {
    for (const ModeLayer& layer : kModeLayers) {
      if (layer.member != nullptr && !std::isfinite(mode.*layer.member)) return false;
    }
    return mode.weight >= 0.0f && mode.weight_sd >= 0.0f && mode.centre_sd_px >= 0.0f &&
           mode.xx_px2 >= 0.0f && mode.yy_px2 >= 0.0f && (!boxes || mode.xy_px2 == 0.0f) &&
           mode.texture >= 0 && mode.texture < matte.metadata.monitors_size();
  };
  const auto is_pyramid = [&](const PyramidFootprint& pyramid) {
    return std::isfinite(pyramid.foreground) && pyramid.noise_sd >= 0.0f && std::isfinite(pyramid.noise_sd) &&
           pyramid.prior_sd >= 0.0f && std::isfinite(pyramid.prior_sd) && pyramid.texture >= 0 &&
           pyramid.texture < matte.metadata.monitors_size() &&
           std::ranges::all_of(pyramid.coefficients, [&](const Coefficient& own) {
             return own.level >= 0 && own.level < kPyramidLevels + matte.modes_per_channel() &&
                    own.weight > 0.0f && std::isfinite(own.weight);
           });
  };
  for (int y = first; y < first + rows; ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      bool good = std::isfinite(matte.coverage(x, y));
      for (int c = 0; c < kChannels; ++c) {
        good = good && std::isfinite(matte.foreground(x, y)[c]);
        if (!matte.is_colourless() || c == 0)
          good = good && std::ranges::all_of(matte.modes(x, y, c), is_good);
        for (const PyramidFootprint& pyramid : matte.pyramids(x, y, c)) good = good && is_pyramid(pyramid);
      }
      if (!good)
        return absl::DataLossError(fmt::format("pixel ({}, {}) has values that no matte can have", x, y));
    }
  }
  return absl::OkStatus();
}

// Reads the rows of a file a block at a time and verifies their checksums.
class RowReader {
 public:
  RowReader(Imf::MultiPartInputFile& file, const MatteHead& head)
      : outline_(head.outline),
        row_checksums_(head.row_checksums),
        stored_(file.header(0).dataWindow()),
        parts_(matte_parts(outline_.modes_per_channel, outline_.colourless, outline_.pyramids)),
        block_(outline_.modes_per_channel, outline_.colourless, outline_.width_px, outline_.pyramids) {
    for (size_t i = 0; i < parts_.size(); ++i) inputs_.emplace_back(file, static_cast<int>(i));
  }

  // Reads `rows` rows, at most one block, from `row` on, counted from the outline's first. Pixels missing in
  // the file are 0.
  absl::Status read(int row, int rows) {
    const int top = outline_.y0_px + row, bottom = top + rows - 1;
    const int first = std::max(top, stored_.min.y), last = std::min(bottom, stored_.max.y);
    if (first > top || last < bottom) block_.clear();
    if (first > last) return absl::OkStatus();
    const Imath::Box2i pixels({outline_.x0_px, top}, {outline_.x0_px + outline_.width_px - 1, bottom});
    for (size_t part = 0; part < parts_.size(); ++part) {
      Imf::FrameBuffer buffer;
      for (size_t c = 0; c < parts_[part].channels.size(); ++c)
        buffer.insert(parts_[part].channels[c], Imf::Slice::Make(Imf::FLOAT, block_.planes(part)[c], pixels));
      inputs_[part].setFrameBuffer(buffer);
      inputs_[part].readPixels(first, last);
    }
    const std::string found = row_checksums(block_.checksums(
        first - top, last - first + 1, stored_.min.x - outline_.x0_px, stored_.max.x - stored_.min.x + 1));
    for (int y = first; y <= last; ++y) {
      const auto digits = [](std::string_view all, int i) {
        return all.substr(static_cast<size_t>(i) * kRowChecksumDigits, kRowChecksumDigits);
      };
      if (digits(found, y - first) != digits(row_checksums_, y - stored_.min.y))
        return absl::DataLossError(fmt::format("its row {} does not match its checksum", y));
    }
    return absl::OkStatus();
  }

  const MatteBlock& block() const { return block_; }

 private:
  const MatteOutline& outline_;
  const std::string& row_checksums_;
  const Imath::Box2i stored_;
  const std::vector<ExrPart> parts_;
  std::vector<Imf::InputPart> inputs_;
  MatteBlock block_;
};

// Rows that one thread reads consecutively: a tiled file is unpacked by rows of tiles.
int rows_at_a_time(const Imf::MultiPartInputFile& file) {
  const Imf::Header& header = file.header(0);
  if (!header.hasTileDescription()) return kMaxBlockRows;
  const int tile = static_cast<int>(header.tileDescription().ySize);
  return (tile + kMaxBlockRows - 1) / kMaxBlockRows * kMaxBlockRows;
}

// Calls `use` with the head of a matte file and the open file.
template <typename Use>
auto with_matte_file(std::string_view bytes, const Use& use)
    -> decltype(use(std::declval<const MatteHead&>(), std::declval<Imf::MultiPartInputFile&>())) {
  constexpr std::string_view kOpenExr = "\x76\x2f\x31\x01";
  if (!bytes.starts_with(kOpenExr))
    return absl::DataLossError(
        "it is damaged or not a matte: it is not an OpenEXR file from glasswing "
        "fetch");
  GW_RETURN_IF_ERROR(check_exr_header(bytes).status());
  try {
    MemoryReader reader(bytes);
    Imf::MultiPartInputFile file(reader, 1, false);
    GW_ASSIGN_OR_RETURN(const MatteHead head, read_matte_head(file, bytes.size()));
    return use(head, file);
  } catch (const std::exception& error) {
    return absl::DataLossError(fmt::format("it is damaged or not a matte: {}", error.what()));
  }
}

}  // namespace

absl::StatusOr<std::string> encode_matte(const Matte& matte) {
  const bool pyramids = matte.metadata.footprint() == kPyramidFootprint;
  std::vector<ExrPart> parts = matte_parts(matte.modes_per_channel(), matte.is_colourless(), pyramids);
  const std::string metadata = json_of(matte.metadata);
  // Row checksums are known only after the pixels are written; a placeholder of the same length reserves
  // their place.
  describe(parts, metadata, std::string(static_cast<size_t>(matte.height_px()) * kRowChecksumDigits, '-'));
  return written_exr([&] {
    ExrWriter writer(parts, window_of(matte));
    MatteBlock block(matte.modes_per_channel(), matte.is_colourless(), matte.width_px(), pyramids);
    std::vector<std::uint64_t> checksums;
    for (int y = 0; y < matte.height_px(); y += kMaxBlockRows) {
      const int rows = std::min(kMaxBlockRows, matte.height_px() - y);
      block.take(matte, y, rows);
      for (const std::uint64_t checksum : block.checksums(rows)) checksums.push_back(checksum);
      for (int row = 0; row < rows; ++row) {
        for (size_t part = 0; part < parts.size(); ++part) writer.put(part, block.row(part, row));
      }
    }
    std::string bytes = writer.finish();
    const std::string rows = row_checksums(checksums);
    put_attribute(bytes, kMatteRows, rows);
    put_attribute(bytes, kMatteChecksum, matte_checksum(metadata, parts, rows));
    return bytes;
  });
}

absl::StatusOr<Matte> decode_matte(std::string_view bytes, Pyramids pyramids) {
  return with_matte_file(bytes,
                         [&](const MatteHead& head, Imf::MultiPartInputFile& file) -> absl::StatusOr<Matte> {
                           const MatteOutline& outline = head.outline;
                           Matte matte(outline.x0_px, outline.y0_px, outline.width_px, outline.height_px,
                                       outline.modes_per_channel, outline.colourless);
                           matte.metadata = outline.metadata;
                           RowReader reader(file, head);
                           for (int y = 0; y < matte.height_px(); y += kMaxBlockRows) {
                             const int rows = std::min(kMaxBlockRows, matte.height_px() - y);
                             GW_RETURN_IF_ERROR(reader.read(y, rows));
                             reader.block().give(matte, y, rows);
                             GW_RETURN_IF_ERROR(check(matte, y, rows));
                           }
                           if (pyramids == Pyramids::kDropped) matte.drop_pyramids();
                           return matte;
                         });
}

absl::Status for_rows_of_matte(std::string_view bytes,
                               absl::FunctionRef<absl::Status(const Matte& rows)> use) {
  return for_blocks_of_matte(bytes, 1, [&](const Matte& rows) { return use(rows); });
}

absl::Status for_blocks_of_matte(std::string_view bytes, int thread_count,
                                 absl::FunctionRef<absl::Status(Matte& rows)> use, Pyramids pyramids) {
  GW_ASSIGN_OR_RETURN(const MatteHead head, read_matte_head(bytes));
  const MatteOutline& outline = head.outline;
  std::atomic<int> next = 0;
  std::mutex mutex;
  absl::Status failed;
  const auto read_blocks = [&](const MatteHead&, Imf::MultiPartInputFile& file) -> absl::Status {
    RowReader reader(file, head);
    const int span = rows_at_a_time(file);
    for (int top = next.fetch_add(span); top < outline.height_px; top = next.fetch_add(span)) {
      const int bottom = std::min(top + span, outline.height_px);
      for (int y = top; y < bottom; y += kMaxBlockRows) {
        const int count = std::min(kMaxBlockRows, bottom - y);
        GW_RETURN_IF_ERROR(reader.read(y, count));
        Matte rows(outline.x0_px, outline.y0_px + y, outline.width_px, count, outline.modes_per_channel,
                   outline.colourless);
        rows.metadata = outline.metadata;
        reader.block().give(rows, 0, count);
        GW_RETURN_IF_ERROR(check(rows, 0, count));
        if (pyramids == Pyramids::kDropped) rows.drop_pyramids();
        GW_RETURN_IF_ERROR(use(rows));
      }
    }
    return absl::OkStatus();
  };
  for_rows((outline.height_px + kMaxBlockRows - 1) / kMaxBlockRows, thread_count, [&](int, int) {
    const absl::Status read = with_matte_file(bytes, read_blocks);
    if (read.ok()) return;
    next = outline.height_px;  // ends the others
    const std::lock_guard lock(mutex);
    failed.Update(read);
  });
  return failed;
}

absl::Status verify_matte(std::string_view bytes) {
  return for_rows_of_matte(bytes, [](const Matte&) { return absl::OkStatus(); });
}

absl::StatusOr<MatteHead> read_matte_head(std::string_view bytes) {
  return with_matte_file(
      bytes,
      [](const MatteHead& head, Imf::MultiPartInputFile&) -> absl::StatusOr<MatteHead> { return head; });
}

absl::StatusOr<MatteOutline> outline_of(std::string_view bytes) {
  GW_ASSIGN_OR_RETURN(const MatteHead head, read_matte_head(bytes));
  return head.outline;
}

absl::Status check_matte(const Matte& matte) {
  return check(matte, 0, matte.height_px());
}

absl::StatusOr<Matte> read_matte(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
  absl::StatusOr<Matte> matte = decode_matte(bytes);
  if (matte.ok()) return matte;
  return absl::Status(matte.status().code(),
                      fmt::format("{}: {}", path.string(), std::string(matte.status().message())));
}

}  // namespace glasswing
