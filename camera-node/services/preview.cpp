#include "camera-node/services/preview.h"

#include <algorithm>
#include <cmath>

#include "camera-node/services/focus.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

double clipped_fraction(const Image16& image, std::uint16_t full_scale) {
  const auto clipped = std::count_if(image.samples.begin(), image.samples.end(),
                                     [&](std::uint16_t sample) { return sample >= full_scale; });
  return static_cast<double>(clipped) / static_cast<double>(image.samples.size());
}

}  // namespace

absl::StatusOr<v1::PreviewResponse> preview_of(const Image16& frame, const std::optional<Mosaic>& mosaic,
                                               int max_width_px, std::uint16_t full_scale) {
  const Image16 image = interpolated(frame, mosaic);
  RadianceImage radiance(image.width_px, image.height_px);
  std::transform(image.samples.begin(), image.samples.end(), radiance.samples.begin(), radiance_of);
  double sum = 0.0;
  for (const float value : radiance.samples) sum += static_cast<double>(value);
  v1::PreviewResponse response;
  response.set_width_px(std::min(max_width_px, image.width_px));
  response.set_height_px(std::max(static_cast<int>(std::lround(static_cast<double>(image.height_px) *
                                                               response.width_px() / image.width_px)),
                                  1));
  GW_ASSIGN_OR_RETURN(*response.mutable_jpeg(),
                      encode_jpeg(resized(radiance, response.width_px(), response.height_px())));
  const Focus focus = focus_of(image, full_scale);
  response.set_focus(focus.value);
  response.set_focus_hint(focus.hint);
  response.set_clipped_fraction(clipped_fraction(frame, full_scale));
  response.set_mean(sum / static_cast<double>(radiance.samples.size()));
  return response;
}

v1::FrameLight light_of(const Image16& image, const FrameLight& light, std::uint16_t full_scale) {
  v1::FrameLight result;
  std::int64_t clipped = 0;
  for (int y = 0; y < image.height_px; ++y) {
    double sum = 0.0;
    for (int x = 0; x < image.width_px; ++x) {
      for (int c = 0; c < 3; ++c) {
        const std::uint16_t sample = image.at(x, y, c);
        sum += static_cast<double>(light.light(sample, c));
        clipped += sample >= full_scale || light.saturated(sample);
      }
    }
    result.add_row_mean(static_cast<float>(sum / (3.0 * image.width_px)));
  }
  result.set_clipped_fraction(static_cast<double>(clipped) / static_cast<double>(image.samples.size()));
  return result;
}

}  // namespace glasswing
