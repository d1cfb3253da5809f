// Light from the samples of a session's frames, by the calibrations that its archive embeds, in the primaries
// of its monitors:
//
//   light = N^-1 curve(sample),    N = mean over the monitors of their crosstalk, each row divided by its sum
//
// A row's sum is the camera's answer to white, so white keeps its brightness in every channel. Black frames
// belong to no monitor; hence one N for all.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/radiometry/frame_light.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class SessionLight {
 public:
  // INVALID_ARGUMENT: a calibration that cannot be one, such as crosstalk that hardly tells primaries apart.
  static absl::StatusOr<SessionLight> create(const v1::CaptureManifest& manifest);

  struct Pixel {
    std::array<float, 3> light;     // below 0 where noise or unmixing makes it so
    std::array<bool, 3> saturated;  // once channels are mixed, all if one is
  };
  Pixel pixel(const std::uint16_t* samples) const;

  bool linearises() const { return !curves_.is_identity(); }
  bool unmixes() const { return unmixes_; }
  // No pixel that is not saturated comes below or above.
  float lowest() const { return lowest_; }
  float highest() const { return highest_; }
  // Standard deviation of a channel's noise before gray light, over what it was before channels were mixed.
  double noise_factor(int channel) const { return noise_factor_[static_cast<size_t>(channel)]; }
  // For people: what may be wrong with this light.
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  explicit SessionLight(FrameLight curves) : curves_(std::move(curves)) {}
  absl::Status take_out_crosstalk(const v1::CaptureManifest& manifest);
  void find_range();
  void find_warnings(const v1::CaptureManifest& manifest);

  FrameLight curves_;
  bool unmixes_ = false;
  std::array<std::array<float, 3>, 3> unmix_ = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // N^-1
  float lowest_ = 0.0f, highest_ = 1.0f;
  std::array<double, 3> noise_factor_ = {1.0, 1.0, 1.0};
  std::vector<std::string> warnings_;
};

inline SessionLight::Pixel SessionLight::pixel(const std::uint16_t* samples) const {
  Pixel pixel;
  for (size_t c = 0; c < 3; ++c) {
    pixel.light[c] = curves_.light(samples[c], static_cast<int>(c));
    pixel.saturated[c] = curves_.saturated(samples[c]);
  }
  if (!unmixes_) return pixel;
  const std::array<float, 3> seen = pixel.light;
  for (size_t p = 0; p < 3; ++p)
    pixel.light[p] = unmix_[p][0] * seen[0] + unmix_[p][1] * seen[1] + unmix_[p][2] * seen[2];
  pixel.saturated.fill(pixel.saturated[0] || pixel.saturated[1] || pixel.saturated[2]);
  return pixel;
}

}  // namespace glasswing
