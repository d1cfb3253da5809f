// decode_tiff, and picture_size of TIFF and PNG.
#include <algorithm>
#include <span>
#include <tuple>

#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {

std::vector<std::string> seeds() {
  std::vector<std::string> seeds;
  for (const auto& [width, height] : {std::pair{1, 1}, {5, 4}, {4, 5}, {64, 2}}) {
    Image16 image(width, height);
    for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<std::uint16_t>(i * 977);
    seeds.push_back(encode_tiff(image));
  }
  // Compressed: one strip, and several, as samples and as differences.
  for (const auto& [width, height, step] : {std::tuple{64, 2, 0}, {2000, 7, 0}, {2000, 7, 3}}) {
    Image16 image(width, height, 1);
    for (size_t i = 0; i < image.samples.size(); ++i)
      image.samples[i] = static_cast<std::uint16_t>(i * static_cast<size_t>(step) + i * i % 7);
    seeds.push_back(encode_tiff(image, FrameForm::kCompressed));
  }
  // A complete header that promises gigabytes.
  std::string lying = encode_tiff(Image16(1, kMaxSide_px)).substr(0, kTiffPixelOffset);
  seeds.push_back(lying);
  seeds.push_back(encode_tiff(Image16(kMaxSide_px, 1)).substr(0, kTiffPixelOffset + 60));
  seeds.push_back(encode_png16(Image16(9, 2)).value());
  seeds.emplace_back("MM\0\x2a\0\0\0\x08\0\x01\x01\0\0\x03\0\0\0\x01\x01\x2c\0\0", 22);
  return seeds;
}

void try_input(std::string_view input) {
  if (const absl::StatusOr<PictureSize> size = picture_size(input); size.ok()) {
    FUZZ_CHECK(size->width_px >= 1 && size->width_px <= kMaxSide_px);
    FUZZ_CHECK(size->height_px >= 1 && size->height_px <= kMaxSide_px);
  }
  const absl::StatusOr<Image16> image = decode_tiff(input);
  if (!image.ok()) {
    FUZZ_CHECK(!image.status().message().empty());
    return;
  }
  const FrameShape shape = shape_of(*image);
  const TiffRows rows = TiffRows::open(input, shape).value();
  if (!rows.plain().empty()) FUZZ_CHECK(encode_tiff(*image) == input);
  FUZZ_CHECK(input.size() <= tiff_size_bytes(shape));
  FUZZ_CHECK(picture_size(input).value() == (PictureSize{image->width_px, image->height_px}));
  FUZZ_CHECK(check_tiff_head(input.substr(0, tiff_head_bytes(shape)), input.size(), shape).ok());
  FUZZ_CHECK(
      !check_tiff_head(input, input.size(), {image->width_px + 1, image->height_px, image->channels}).ok());
  std::vector<std::uint16_t> last(shape.row_samples());
  FUZZ_CHECK(rows.read(image->height_px - 1, 1, last.data()).ok());
  FUZZ_CHECK(std::ranges::equal(last, std::span(image->samples).last(last.size())));
}

}  // namespace glasswing::fuzz
