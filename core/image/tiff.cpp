#include "core/image/tiff.h"

#include <fmt/format.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/status.h"
#include "core/image/image.h"

namespace glasswing {
namespace {

static_assert(std::endian::native == std::endian::little, "samples are copied in memory order");

struct Entry {
  std::uint16_t tag, type;
  std::uint32_t count, value;
};
static_assert(sizeof(Entry) == 12);
constexpr std::uint16_t kShortType = 3, kLongType = 4;
constexpr size_t kEntries = 10;  // where they begin
constexpr std::uint32_t kBitsOffset = 200;
constexpr std::uint16_t kUncompressed = 1, kZstd = 50000;
// How a compressed file's samples are written: unchanged, or each minus its left neighbour in the same
// channel.
constexpr std::uint16_t kSamples = 1, kDifferences = 2;

// Small, so that one row costs few others; larger strips hardly compress better.
constexpr size_t kStripBytes = 32 << 10;
// Samples of a sensor are noise, in which matches are accidents: only few, long ones are searched for,
// quickly.
constexpr int kLevel = 1, kMinMatch = 7, kHashLog = 12;
// Of a plain file's size; beyond it, a mappable file is worth more.
constexpr double kMaxCompressedShare = 7.0 / 8.0;

constexpr const char* kNoHeader =
    "not a frame's header (16-bit TIFF of rgb or one channel: uncompressed, one strip at byte 256, or strips "
    "of Zstandard)";

std::string described(const FrameShape& shape) {
  return fmt::format("{}x{} px with {} channel{}", shape.width_px, shape.height_px, shape.channels,
                     shape.channels == 1 ? "" : "s");
}

// How a compressed file divides its rows.
class Strips {
 public:
  explicit Strips(const FrameShape& shape)
      : height_(shape.height_px),
        row_bytes_(2 * shape.row_samples()),
        rows_(std::clamp(static_cast<int>(kStripBytes / row_bytes_), 1, height_)) {}

  int rows() const { return rows_; }
  int count() const { return (height_ + rows_ - 1) / rows_; }
  int first_row(int strip) const { return strip * rows_; }
  int end_row(int strip) const { return std::min(first_row(strip) + rows_, height_); }
  size_t size_bytes(int strip) const {
    return static_cast<size_t>(end_row(strip) - first_row(strip)) * row_bytes_;
  }
  // Their places and sizes in the file follow the header, unless it has room for them.
  size_t table_bytes() const { return count() == 1 ? 0 : 8 * static_cast<size_t>(count()); }
  size_t begin() const { return kTiffPixelOffset + table_bytes(); }

 private:
  int height_;
  size_t row_bytes_;
  int rows_;
};

std::string with_entries(const std::vector<Entry>& entries, bool rgb) {
  std::string header(kTiffPixelOffset, '\0');
  const std::array<std::uint16_t, 2> magic{0x4949, 42};
  const std::uint32_t first_directory = 8;
  const auto count = static_cast<std::uint16_t>(entries.size());
  const std::array<std::uint16_t, 3> bits{16, 16, 16};
  std::memcpy(&header[0], magic.data(), 4);
  std::memcpy(&header[4], &first_directory, 4);
  std::memcpy(&header[8], &count, 2);
  std::memcpy(&header[kEntries], entries.data(), entries.size() * sizeof(Entry));
  if (rgb) std::memcpy(&header[kBitsOffset], bits.data(), sizeof bits);
  return header;
}

// `predictor`: none of a plain file. `only_strip_bytes`: of a compressed file with one strip.
std::string header_of(const FrameShape& shape, std::optional<std::uint16_t> predictor = std::nullopt,
                      std::uint32_t only_strip_bytes = 0) {
  const auto width = static_cast<std::uint32_t>(shape.width_px),
             height = static_cast<std::uint32_t>(shape.height_px),
             channels = static_cast<std::uint32_t>(shape.channels);
  const bool rgb = shape.channels == 3;
  const Strips strips(shape);
  const auto count = static_cast<std::uint32_t>(predictor ? strips.count() : 1);
  const auto after_offsets = static_cast<std::uint32_t>(kTiffPixelOffset) + 4 * count;
  const std::uint32_t sizes = !predictor  ? width * height * channels * 2
                              : count > 1 ? after_offsets
                                          : only_strip_bytes;
  std::vector<Entry> entries{
      {256, kLongType, 1, width},
      {257, kLongType, 1, height},
      {258, kShortType, channels, rgb ? kBitsOffset : 16u},
      {259, kShortType, 1, predictor ? kZstd : kUncompressed},
      {262, kShortType, 1, rgb ? 2u : 1u},  // rgb, or 0 is black
      {273, kLongType, count, kTiffPixelOffset},
      {274, kShortType, 1, 1},  // top-left first
      {277, kShortType, 1, channels},
      {278, kLongType, 1, predictor ? static_cast<std::uint32_t>(strips.rows()) : height},
      {279, kLongType, count, sizes},
      {284, kShortType, 1, 1}};
  if (predictor) entries.push_back({317, kShortType, 1, *predictor});
  return with_entries(entries, rgb);
}

std::uint32_t entry_value(std::string_view header, size_t entry) {
  constexpr size_t kValue = 8;
  std::uint32_t number = 0;
  std::memcpy(&number, &header[kEntries + entry * sizeof(Entry) + kValue], sizeof number);
  return number;
}

// The shape that a header gives. Its sides need not be plausible.
FrameShape shape_in(std::string_view header) {
  constexpr size_t kWidth = 0, kHeight = 1, kChannels = 7;
  return {.width_px = static_cast<int>(entry_value(header, kWidth)),
          .height_px = static_cast<int>(entry_value(header, kHeight)),
          .channels = static_cast<int>(entry_value(header, kChannels))};
}

// The predictor of a compressed file, or none of a plain one. DATA_LOSS: neither has this header.
absl::StatusOr<std::optional<std::uint16_t>> predictor_in(std::string_view header, const FrameShape& shape) {
  constexpr size_t kSizes = 9;
  if (header == header_of(shape)) return std::nullopt;
  if (header.size() == kTiffPixelOffset) {
    for (const std::uint16_t predictor : {kSamples, kDifferences}) {
      if (header == header_of(shape, predictor, entry_value(header, kSizes))) return predictor;
    }
  }
  return absl::DataLossError(fmt::format("{} of {}", kNoHeader, described(shape)));
}

// A number of the tables behind a compressed file's header.
std::uint32_t table_value(std::string_view bytes, size_t index) {
  std::uint32_t number = 0;
  std::memcpy(&number, &bytes[kTiffPixelOffset + 4 * index], sizeof number);
  return number;
}

struct Place {
  size_t begin = 0, size_bytes = 0;
};
// A strip's position according to a checked head.
Place place_of(std::string_view head, const Strips& strips, int strip) {
  constexpr size_t kSizes = 9;
  if (strips.count() == 1) return {.begin = kTiffPixelOffset, .size_bytes = entry_value(head, kSizes)};
  const auto count = static_cast<size_t>(strips.count()), at = static_cast<size_t>(strip);
  return {.begin = table_value(head, at), .size_bytes = table_value(head, count + at)};
}

void take_differences(std::span<std::uint16_t> row, size_t channels) {
  for (size_t i = row.size(); i-- > channels;)
    row[i] = static_cast<std::uint16_t>(row[i] - row[i - channels]);
}

template <size_t kChannels>
void add_up(std::span<std::uint16_t> row) {
  for (size_t i = kChannels; i < row.size(); ++i)
    row[i] = static_cast<std::uint16_t>(row[i] + row[i - kChannels]);
}

struct FreeContext {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

using Compressor = std::unique_ptr<ZSTD_CCtx, FreeContext>;
Compressor make_compressor() {
  Compressor compressor(ZSTD_createCCtx());
  ZSTD_CCtx_setParameter(compressor.get(), ZSTD_c_compressionLevel, kLevel);
  ZSTD_CCtx_setParameter(compressor.get(), ZSTD_c_minMatch, kMinMatch);
  ZSTD_CCtx_setParameter(compressor.get(), ZSTD_c_hashLog, kHashLog);
  return compressor;
}

// Appends the strip to `out`; returns its size there.
size_t append_strip(const Image16& image, const Strips& strips, int strip, std::uint16_t predictor,
                    std::string& out) {
  thread_local const Compressor compressor = make_compressor();
  const size_t row = shape_of(image).row_samples();
  std::vector<std::uint16_t> differences;
  std::span<const std::uint16_t> samples =
      std::span(image.samples)
          .subspan(row * static_cast<size_t>(strips.first_row(strip)), strips.size_bytes(strip) / 2);
  if (predictor == kDifferences) {
    differences.assign(samples.begin(), samples.end());
    for (size_t at = 0; at < differences.size(); at += row)
      take_differences(std::span(differences).subspan(at, row), static_cast<size_t>(image.channels));
    samples = differences;
  }
  const size_t before = out.size();
  out.resize(before + ZSTD_compressBound(samples.size_bytes()));
  const size_t size = ZSTD_compress2(compressor.get(), &out[before], out.size() - before, samples.data(),
                                     samples.size_bytes());
  assert(!ZSTD_isError(size));  // the buffer is large enough
  out.resize(before + size);
  return size;
}

// None: it would save too little.
std::optional<std::string> compressed(const Image16& image) {
  const FrameShape shape = shape_of(image);
  const Strips strips(shape);
  // The middle one is representative: pictures of a stage have their object there.
  std::string trial;
  const int middle = strips.count() / 2;
  const size_t as_they_are = append_strip(image, strips, middle, kSamples, trial);
  const size_t as_differences = append_strip(image, strips, middle, kDifferences, trial);
  const std::uint16_t predictor = as_differences < as_they_are ? kDifferences : kSamples;
  const auto saves = [](size_t size, size_t plain) {
    return static_cast<double>(size) <= kMaxCompressedShare * static_cast<double>(plain);
  };
  if (!saves(std::min(as_they_are, as_differences), strips.size_bytes(middle))) return std::nullopt;
  std::string bytes(strips.begin(), '\0');
  bytes.reserve(tiff_size_bytes(shape));
  const size_t count = strips.count();
  std::uint32_t size = 0;
  for (size_t strip = 0; strip < count; ++strip) {
    const auto begin = static_cast<std::uint32_t>(bytes.size());
    size = static_cast<std::uint32_t>(append_strip(image, strips, static_cast<int>(strip), predictor, bytes));
    if (count == 1) break;
    std::memcpy(&bytes[kTiffPixelOffset + 4 * strip], &begin, sizeof begin);
    std::memcpy(&bytes[kTiffPixelOffset + 4 * (count + strip)], &size, sizeof size);
  }
  const std::string header = header_of(shape, predictor, size);
  std::ranges::copy(header, bytes.begin());
  if (!saves(bytes.size(), tiff_size_bytes(shape))) return std::nullopt;
  return bytes;
}

}  // namespace

std::string encode_tiff(const Image16& image, FrameForm form) {
  if (form == FrameForm::kCompressed) {
    if (std::optional<std::string> bytes = compressed(image)) return *std::move(bytes);
  }
  std::string bytes = header_of(shape_of(image));
  bytes.append(reinterpret_cast<const char*>(image.samples.data()), image.samples.size() * 2);
  return bytes;
}

absl::StatusOr<Image16> decode_tiff(std::string_view bytes) {
  if (bytes.size() < kTiffPixelOffset) return absl::DataLossError("shorter than a frame's header");
  const FrameShape shape = shape_in(bytes);
  // Keeps the size within 32 bits.
  const auto good = [](int side) { return side >= 1 && side <= kMaxSide_px; };
  if (!good(shape.width_px) || !good(shape.height_px) || (shape.channels != 1 && shape.channels != 3))
    return absl::DataLossError(kNoHeader);
  // Checked before allocating, since the header may promise more than the file holds.
  GW_ASSIGN_OR_RETURN(const TiffRows rows, TiffRows::open(bytes, shape));
  Image16 image(shape.width_px, shape.height_px, shape.channels);
  GW_RETURN_IF_ERROR(rows.read(0, shape.height_px, image.samples.data()));
  return image;
}

size_t tiff_head_bytes(const FrameShape& shape) {
  return Strips(shape).begin();
}

namespace {

// Like check_tiff_head; the predictor of a compressed file, or none of a plain one.
absl::StatusOr<std::optional<std::uint16_t>> checked_predictor(std::string_view head, size_t file_bytes,
                                                               const FrameShape& shape) {
  GW_ASSIGN_OR_RETURN(const std::optional<std::uint16_t> predictor,
                      predictor_in(head.substr(0, kTiffPixelOffset), shape));
  if (!predictor) {
    if (file_bytes == tiff_size_bytes(shape)) return predictor;
    return absl::DataLossError(fmt::format("holds {} bytes; {}x{} needs {}", file_bytes, shape.width_px,
                                           shape.height_px, tiff_size_bytes(shape)));
  }
  const Strips strips(shape);
  if (head.size() < strips.begin())
    return absl::DataLossError(fmt::format("its list of {} strips is truncated", strips.count()));
  size_t end = strips.begin();
  for (int strip = 0; strip < strips.count(); ++strip) {
    const Place place = place_of(head, strips, strip);
    if (place.begin != end || place.size_bytes > tiff_size_bytes(shape)) {
      return absl::DataLossError(
          fmt::format("strip {} is listed with {} bytes at {}; it must follow the previous one, at {}", strip,
                      place.size_bytes, place.begin, end));
    }
    end += place.size_bytes;
  }
  if (end == file_bytes && file_bytes <= tiff_size_bytes(shape)) return predictor;
  return absl::DataLossError(fmt::format("has {} bytes; its strips end at {}, and {}x{} needs at most {}",
                                         file_bytes, end, shape.width_px, shape.height_px,
                                         tiff_size_bytes(shape)));
}

}  // namespace

absl::Status check_tiff_head(std::string_view head, size_t file_bytes, const FrameShape& shape) {
  return checked_predictor(head, file_bytes, shape).status();
}

absl::StatusOr<TiffRows> TiffRows::open(std::string_view bytes, const FrameShape& shape) {
  GW_ASSIGN_OR_RETURN(const std::optional<std::uint16_t> predictor,
                      checked_predictor(bytes, bytes.size(), shape));
  TiffRows rows(bytes, shape);
  rows.has_differences_ = predictor == kDifferences;
  if (!predictor) {
    rows.plain_ = {reinterpret_cast<const std::uint16_t*>(bytes.data() + kTiffPixelOffset),
                   shape.row_samples() * static_cast<size_t>(shape.height_px)};
  }
  return rows;
}

int TiffRows::strip_rows() const {
  return Strips(shape_).rows();
}

absl::Status TiffRows::read(int first_row, int row_count, std::uint16_t* samples) const {
  thread_local const std::unique_ptr<ZSTD_DCtx, FreeContext> context(ZSTD_createDCtx());
  thread_local std::vector<std::uint16_t> partial;
  const size_t row = shape_.row_samples();
  if (!plain_.empty()) {
    const auto wanted =
        plain_.subspan(row * static_cast<size_t>(first_row), row * static_cast<size_t>(row_count));
    // The file's bytes need not be aligned.
    std::memcpy(samples, wanted.data(), wanted.size_bytes());
    return absl::OkStatus();
  }
  const Strips strips(shape_);
  const int end_row = first_row + row_count;
  for (int strip = first_row / strips.rows(); strip < strips.count() && strips.first_row(strip) < end_row;
       ++strip) {
    const int begin = std::max(strips.first_row(strip), first_row),
              end = std::min(strips.end_row(strip), end_row);
    std::uint16_t* const out = samples + row * static_cast<size_t>(begin - first_row);
    const bool is_whole = begin == strips.first_row(strip) && end == strips.end_row(strip);
    const size_t size = strips.size_bytes(strip);
    if (!is_whole) partial.resize(size / 2);
    std::uint16_t* const rows = is_whole ? out : partial.data();
    const Place place = place_of(bytes_, strips, strip);
    const size_t got =
        ZSTD_decompressDCtx(context.get(), rows, size, bytes_.data() + place.begin, place.size_bytes);
    if (got != size) {
      return absl::DataLossError(fmt::format(
          "rows {} to {} cannot be decompressed: {}", strips.first_row(strip), strips.end_row(strip) - 1,
          ZSTD_isError(got) ? ZSTD_getErrorName(got) : fmt::format("{} bytes instead of {}", got, size)));
    }
    if (has_differences_) {
      for (int y = begin; y < end; ++y) {
        const std::span<std::uint16_t> line(rows + row * static_cast<size_t>(y - strips.first_row(strip)),
                                            row);
        shape_.channels == 3 ? add_up<3>(line) : add_up<1>(line);
      }
    }
    if (!is_whole) {
      std::copy_n(rows + row * static_cast<size_t>(begin - strips.first_row(strip)),
                  row * static_cast<size_t>(end - begin), out);
    }
  }
  return absl::OkStatus();
}

}  // namespace glasswing
