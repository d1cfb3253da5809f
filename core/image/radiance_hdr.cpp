#include "core/image/radiance_hdr.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/scanner.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kMaxHdrSide_px = 16384;
constexpr int kMinPacked_px = 8;  // shorter rows are never packed
constexpr size_t kBytes = 4;      // of a pixel: red, green, blue, exponent
constexpr size_t kMaxRun = 127;
constexpr int kBias = 136;
constexpr int kColours = 3;

absl::Status damaged_hdr(std::string_view what) {
  return absl::DataLossError(fmt::format("the .hdr is damaged: {}", what));
}

struct HdrHeader {
  int width_px = 0, height_px = 0;
  size_t length = 0;  // bytes
};

// Lines of text, an empty one, and the size.
absl::StatusOr<HdrHeader> hdr_header_of(std::string_view bytes) {
  constexpr size_t kMaxLine = 1000;
  HdrHeader header;
  bool described = false;
  for (;;) {
    const size_t end = bytes.find('\n', header.length);
    if (end == std::string_view::npos || end - header.length > kMaxLine)
      return damaged_hdr("a line of its header does not end");
    const std::string line(bytes.substr(header.length, end - header.length));
    header.length = end + 1;
    if (described) {
      const bool parsed =
          Scanner(line).then("-Y ").number(header.height_px).then(" +X ").number(header.width_px).done();
      const auto good = [](int side) { return side >= 1 && side <= kMaxHdrSide_px; };
      if (parsed && good(header.width_px) && good(header.height_px)) return header;
      return absl::DataLossError(fmt::format(
          "the .hdr's size is \"{}\"; it must be -Y HEIGHT +X WIDTH of 1 to {} px", line, kMaxHdrSide_px));
    }
    described = line.empty();
    if (line.starts_with("FORMAT=") && line != "FORMAT=32-bit_rle_rgbe")
      return absl::DataLossError(fmt::format("the .hdr has \"{}\"; it must be FORMAT=32-bit_rle_rgbe", line));
  }
}

// Takes bytes from the front of a file.
class HdrSource {
 public:
  explicit HdrSource(std::string_view bytes) : bytes_(bytes) {}
  size_t left() const { return bytes_.size(); }
  std::uint8_t peek(size_t at) const { return at < left() ? static_cast<std::uint8_t>(bytes_[at]) : 0; }
  std::uint8_t take() {
    const std::uint8_t byte = peek(0);
    bytes_.remove_prefix(std::min<size_t>(1, left()));
    return byte;
  }

 private:
  std::string_view bytes_;
};

bool is_packed(const HdrSource& source, int width_px) {
  return width_px >= kMinPacked_px && source.peek(0) == 2 && source.peek(1) == 2 &&
         (source.peek(2) << 8 | source.peek(3)) == width_px;
}

// One channel after the other, in runs of one value (a length above 128) or of several.
absl::Status unpack_hdr_row(HdrSource& source, std::span<std::uint8_t> row) {
  const size_t width = row.size() / kBytes;
  for (size_t i = 0; i < kBytes; ++i) source.take();
  for (size_t channel = 0; channel < kBytes; ++channel) {
    for (size_t x = 0; x < width;) {
      const size_t length = source.take();
      const bool same = length > kMaxRun + 1;
      const size_t count = same ? length - (kMaxRun + 1) : length;
      if (count == 0 || count > width - x) return damaged_hdr("a run ends beyond its row");
      if (source.left() < (same ? 1 : count)) return damaged_hdr("it ends too early");
      const std::uint8_t value = same ? source.take() : 0;
      for (size_t i = 0; i < count; ++i) row[kBytes * x++ + channel] = same ? value : source.take();
    }
  }
  return absl::OkStatus();
}

std::array<std::uint8_t, kBytes> hdr_code_of(const RadianceImage& image, int x, int y) {
  constexpr float kMaxLight = 0x1.fep126f;
  std::array<float, kColours> light{};
  for (int c = 0; c < kColours; ++c) light[c] = std::clamp(image.at(x, y, c), 0.0f, kMaxLight);
  int exponent = 0;
  const float brightest = std::ranges::max(light);
  // For values that round to 256, the next one.
  if (std::frexp(brightest, &exponent) * 256.0f >= 255.5f) ++exponent;
  if (!(brightest > 0.0f) || exponent + 128 < 1) return {};
  std::array<std::uint8_t, kBytes> code{};
  for (size_t c = 0; c < kColours; ++c)
    code[c] = static_cast<std::uint8_t>(std::lround(std::ldexp(light[c], 8 - exponent)));
  code[3] = static_cast<std::uint8_t>(exponent + 128);
  return code;
}

void pack_hdr(std::span<const std::uint8_t> values, std::string& out) {
  constexpr size_t kMinRun = 4;  // a shorter one costs more than it saves
  const auto run_at = [&](size_t at) {
    size_t length = 1;
    while (at + length < values.size() && length < kMaxRun && values[at + length] == values[at]) ++length;
    return length;
  };
  for (size_t at = 0; at < values.size();) {
    size_t run = run_at(at), count = 0;
    while (run < kMinRun && at + count < values.size() && count < kMaxRun) {
      ++count;
      run = at + count < values.size() ? run_at(at + count) : 0;
    }
    if (count > 0) {
      out.push_back(static_cast<char>(count));
      for (size_t i = 0; i < count; ++i) out.push_back(static_cast<char>(values[at + i]));
    } else {
      out.push_back(static_cast<char>(kMaxRun + 1 + run));
      out.push_back(static_cast<char>(values[at]));
      count = run;
    }
    at += count;
  }
}

}  // namespace

bool is_hdr(std::string_view bytes) {
  return bytes.starts_with("#?");
}

absl::StatusOr<RadianceImage> decode_hdr(std::string_view bytes) {
  GW_ASSIGN_OR_RETURN(const HdrHeader header, hdr_header_of(bytes));
  HdrSource source(bytes.substr(header.length));
  const size_t width = header.width_px;
  // The minimum size of a row, so that no header makes us allocate more than its file can fill.
  const size_t min_row = std::min(kBytes * width, kBytes * (1 + 2 * ((width + kMaxRun - 1) / kMaxRun)));
  if (source.left() / min_row < static_cast<size_t>(header.height_px))
    return damaged_hdr("it ends too early");
  RadianceImage image(header.width_px, header.height_px);
  std::vector<std::uint8_t> row(kBytes * width);
  for (int y = 0; y < image.height_px; ++y) {
    if (is_packed(source, image.width_px)) {
      GW_RETURN_IF_ERROR(unpack_hdr_row(source, row));
    } else {
      if (source.left() < row.size()) return damaged_hdr("it ends too early");
      for (std::uint8_t& byte : row) byte = source.take();
    }
    for (size_t x = 0; x < width; ++x) {
      const float unit = std::ldexp(1.0f, row[kBytes * x + 3] - kBias);
      for (size_t c = 0; c < kColours; ++c)
        image.at(static_cast<int>(x), y, static_cast<int>(c)) = unit * row[kBytes * x + c];
    }
  }
  return image;
}

std::string encode_hdr(const RadianceImage& image) {
  std::string out =
      fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", image.height_px, image.width_px);
  const size_t width = image.width_px;
  std::vector<std::uint8_t> row(kBytes * width);
  const bool packed = image.width_px >= kMinPacked_px;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const std::array<std::uint8_t, kBytes> code = hdr_code_of(image, x, y);
      for (size_t i = 0; i < kBytes; ++i)
        row[packed ? i * width + static_cast<size_t>(x) : kBytes * static_cast<size_t>(x) + i] = code[i];
    }
    if (!packed) {
      out.append(row.begin(), row.end());
      continue;
    }
    for (const int byte : {2, 2, image.width_px >> 8, image.width_px & 255})
      out.push_back(static_cast<char>(byte));
    for (size_t i = 0; i < kBytes; ++i) pack_hdr(std::span(row).subspan(i * width, width), out);
  }
  return out;
}

}  // namespace glasswing
