// Pictures from cameras and users, PNG, JPEG, TIFF and .hdr: their headers, the checks before decoding, and
// the results.
#include <cmath>
#include <cstring>

#include "camera-node/backends/pixel_format.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/image/picture_header.h"
#include "core/image/radiance_hdr.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

constexpr int kWidth_px = 12, kHeight_px = 7;  // of the camera
constexpr std::int64_t kMaxPixels = 1 << 20;   // larger valid pictures only take time

std::string jpeg_of(int width_px, int height_px) {
  RadianceImage image(width_px, height_px);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<float>(i % 17) / 16.0f;
  return encode_jpeg(image).value();
}

}  // namespace

std::vector<std::string> seeds() {
  Image16 image(9, 4);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<std::uint16_t>(i * 977);
  std::vector<std::string> seeds{jpeg_of(kWidth_px, kHeight_px), jpeg_of(1, 1), jpeg_of(40, 33),
                                 encode_png16(image).value(), encode_tiff(image)};
  // A small file whose header promises gigabytes.
  std::string lying = seeds[0];
  const size_t frame = lying.find("\xFF\xC0");
  for (size_t i = 5; i < 9; ++i) lying[frame + i] = '\x3f';
  seeds.push_back(lying);
  // Fill bytes and a comment before the rest.
  seeds.push_back(seeds[0].substr(0, 2) + std::string(5, '\xff') + std::string("\xff\xfe\0\x04hi", 6) +
                  seeds[0].substr(2));
  RadianceImage light(20, 3);
  for (size_t i = 0; i < light.samples.size(); ++i)
    light.samples[i] = i % 3 == 0 ? 4.0f : static_cast<float>(i);
  seeds.push_back(encode_hdr(light));
  seeds.push_back(encode_hdr(RadianceImage(2, 2)));
  seeds.emplace_back("RIFF\x1a\0\0\0WEBPVP8L\x0d\0\0\0/\0\0\0\x10\x07\x10\x11\x11\x88\x88\xfe\x07\0",
                     34);  // 1x1
  return seeds;
}

void try_input(std::string_view input) {
  if (is_hdr(input)) {
    const absl::StatusOr<RadianceImage> light = decode_radiance(input, Encoding::kDisplay);
    if (!light.ok()) return;
    for (const float each : light->samples) FUZZ_CHECK(std::isfinite(each) && each >= 0.0f);
    FUZZ_CHECK(decode_hdr(encode_hdr(*light)).ok());
    return;
  }
  const absl::StatusOr<PictureSize> size = picture_size(input);
  if (size.ok()) {
    FUZZ_CHECK(size->width_px >= 1 && size->width_px <= kMaxSide_px);
    FUZZ_CHECK(size->height_px >= 1 && size->height_px <= kMaxSide_px);
  }
  FUZZ_CHECK(check_picture(input).ok() || !size.ok() || !decode_radiance(input, Encoding::kDisplay).ok());

  RawPicture raw;
  raw.format = find_pixel_format("MJPEG");
  raw.width_px = kWidth_px;
  raw.height_px = kHeight_px;
  raw.planes.emplace_back(input.begin(), input.end());
  if (const absl::StatusOr<Image16> frame = image_of(raw); frame.ok())
    FUZZ_CHECK(size.ok() && *size == (PictureSize{kWidth_px, kHeight_px}));

  // Other formats and sizes out of range must not be decoded at all.
  if (size.ok() && std::int64_t{size->width_px} * size->height_px > kMaxPixels) return;
  const absl::StatusOr<RadianceImage> radiance = decode_radiance(input, Encoding::kDisplay);
  if (radiance.ok()) {
    FUZZ_CHECK(size.ok());
    const bool turned = radiance->width_px == size->height_px && radiance->height_px == size->width_px;
    FUZZ_CHECK(turned || (radiance->width_px == size->width_px && radiance->height_px == size->height_px));
  } else {
    FUZZ_CHECK(!radiance.status().message().empty());
  }
  const absl::StatusOr<Image16> png = decode_png(input);
  FUZZ_CHECK(!png.ok() || radiance.ok());
}

}  // namespace glasswing::fuzz
