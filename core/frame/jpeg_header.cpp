#include "core/frame/jpeg_header.h"

namespace glasswing {
namespace {

constexpr unsigned char kMarker = 0xFF, kStartOfScan = 0xDA;
constexpr std::string_view kEndOfImage = "\xFF\xD9";

// SOF0 to SOF15, except DHT, JPG and DAC, which share their range.
bool is_frame_header(unsigned char marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

struct Header {
  PictureSize size;
  size_t scan = 0;  // where the entropy-coded data begins; 0: not found
};

Header header_of(std::string_view bytes) {
  const auto byte = [&](size_t at) { return static_cast<unsigned char>(bytes[at]); };
  const auto word = [&](size_t at) { return static_cast<int>(byte(at) << 8 | byte(at + 1)); };
  Header header;
  size_t at = 2;
  while (at + 9 <= bytes.size() && byte(at) == kMarker) {
    const unsigned char marker = byte(at + 1);
    if (marker == kMarker) {  // fill
      ++at;
      continue;
    }
    if (is_frame_header(marker)) header.size = {.width_px = word(at + 7), .height_px = word(at + 5)};
    if (marker == kStartOfScan) {
      header.scan = at;
      break;
    }
    at += 2 + static_cast<size_t>(word(at + 2));
  }
  return header;
}

}  // namespace

bool is_jpeg(std::string_view bytes) {
  return bytes.substr(0, 3) == "\xFF\xD8\xFF";
}

PictureSize jpeg_size(std::string_view bytes) {
  return header_of(bytes).size;
}

absl::Status check_jpeg(std::string_view bytes) {
  const size_t scan = header_of(bytes).scan;
  if (scan == 0) return absl::DataLossError("the JPEG's headers are damaged, or cut off");
  // Entropy-coded data never contains a marker.
  if (bytes.find(kEndOfImage, scan) == std::string_view::npos)
    return absl::DataLossError("the JPEG is truncated");
  return absl::OkStatus();
}

}  // namespace glasswing
