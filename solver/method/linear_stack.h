// What methods solve: a stack whose samples are light. A camera's codes become light by the calibrations that
// the archive embeds, and the drift of the monitors is taken out:
//
//   light = black + (seen - black) / brightness       black: the same pixel, object and exposure, monitors
//   black
#pragma once

#include <absl/status/statusor.h>

#include "core/radiometry/frame_light.h"
#include "core/radiometry/primary_mix.h"
#include "solver/method/method.h"

namespace glasswing {

class LinearStack {
 public:
  // Of every stack of this session. INVALID_ARGUMENT: a calibration that cannot be one.
  static absl::StatusOr<LinearStack> create(const v1::CaptureManifest& manifest);

  // The same rows as light on 16 bits, above a pedestal: what noise brings below 0 is kept, or means around
  // black would come out too bright. The manifest carries the noise of that light. Where samples are light
  // already the stack stays as it is, and nothing is copied.
  FrameStack of(FrameStack stack) const;

  // What was done, for the matte's reader.
  void describe(v1::MatteMetadata& metadata) const;

 private:
  LinearStack(FrameLight light, PrimaryMix mix, std::vector<std::string> warnings)
      : light_(std::move(light)), mix_(std::move(mix)), warnings_(std::move(warnings)) {}

  FrameLight light_;
  PrimaryMix mix_;
  std::vector<std::string> warnings_;
};

}  // namespace glasswing
