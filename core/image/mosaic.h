// The mosaic of a raw colour sensor: each photosite measures one of r, g, b, in a pattern that repeats every
// two sites along x and y (Bayer 1976).
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/image/image.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class Mosaic {
 public:
  // "RGGB", "GRBG", "GBRG" or "BGGR": the colours of sites (0, 0), (1, 0), (0, 1) and (1, 1), x right, y
  // down. INVALID_ARGUMENT: another name.
  static absl::StatusOr<Mosaic> parse(std::string_view name);

  // 0, 1 or 2 for r, g or b.
  int channel(int x, int y) const { return channels_[(y & 1) * 2 + (x & 1)]; }

 private:
  std::array<std::int8_t, 4> channels_{};
};

// None if the camera's frames have r, g, b at each pixel. The manifest has passed check_manifest_header().
std::optional<Mosaic> mosaic_of(const v1::Camera& camera);

// The channel of a sample of row y: its photosite's, or r, g, b in turn without a mosaic.
inline int row_channel(const std::optional<Mosaic>& mosaic, size_t at, int y) {
  return mosaic ? mosaic->channel(static_cast<int>(at), y) : static_cast<int>(at % 3);
}

// The content of every frame of a camera.
struct FrameShape {
  int width_px = 0, height_px = 0;
  int channels = 3;  // 1 for a mosaic

  size_t row_samples() const { return static_cast<size_t>(width_px) * channels; }
  bool operator==(const FrameShape&) const = default;
};
FrameShape shape_of(const v1::Camera& camera);
FrameShape shape_of(const Image16& frame);
// INVALID_ARGUMENT names the frame unless both are the same.
absl::Status check_shape(std::string_view frame, const FrameShape& shape, const FrameShape& of_camera);

// What a sensor with this mosaic measures from a picture with all colours.
Image16 sampled(const Image16& picture, const Mosaic& mosaic);

// For viewing: the colours that a site does not measure are the mean of the nearest sites that do (bilinear).
// A picture that has all colours is returned unchanged.
Image16 interpolated(const Image16& frame, const std::optional<Mosaic>& mosaic);

}  // namespace glasswing
