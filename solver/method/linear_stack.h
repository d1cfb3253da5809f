// The stack that methods solve, whose samples are light. The calibrations that the archive embeds turn the
// camera's codes into light, and the brightness drift of the monitors is removed:
//
//   light = black + (seen - black) / brightness
//         = seen / brightness                      in archives without black frames (exposure_changes.h)
//
// where black is the same pixel in front of black monitors, with the same object and exposure. Effects of the
// rig on the frames are removed first (frame_correction.h).
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/radiometry/frame_light.h"
#include "core/radiometry/primary_mix.h"
#include "solver/method/method.h"

namespace glasswing {

class LinearStack {
 public:
  // Converts every stack of this session. INVALID_ARGUMENT: an invalid calibration.
  static absl::StatusOr<LinearStack> create(const v1::CaptureManifest& manifest);

  // Treats samples as codes of this response (core/import/photograph_response.h) from now on, whatever the
  // manifest says. INVALID_ARGUMENT: no such response.
  absl::Status decode(const std::string& response);

  // The same rows as light as 16-bit samples, above a pedestal that preserves noise below 0: without it means
  // near black would be too bright. A stack whose samples are already light and that has no drift is returned
  // as it is, without a copy.
  FrameStack of(FrameStack stack) const;

  // The manifest with its camera's noise on the scale of light instead of codes.
  v1::CaptureManifest manifest_of_light(v1::CaptureManifest manifest) const;

  // Records the conversion and its warnings.
  void describe(v1::MatteMetadata& metadata) const;

 private:
  // Frames whose drift is removed with the same black.
  using BlackKey = std::pair<bool, double>;  // object, exposure_ms
  struct FrameKind {
    BlackKey key;
    bool black = false;  // of a monitor
  };

  LinearStack(FrameLight light, PrimaryMix mix) : light_(std::move(light)), mix_(std::move(mix)) {}
  // A frame's light with FrameStack::corrections; empty without.
  std::vector<float> corrected(const FrameStack& stack, size_t frame) const;
  // The first black frame that has rows, by key.
  std::map<BlackKey, size_t> black_frames(const FrameStack& stack) const;

  FrameLight light_;
  PrimaryMix mix_;
  std::vector<std::string> warnings_;
  std::vector<FrameKind> frames_;  // by index in manifest.frames
};

}  // namespace glasswing
