// What each quarter of the pixels beside the object measures separately of what all of them show. Effects of
// the rig on a frame are the same everywhere; light that the object casts beside itself, and errors of the
// model, are local.
#pragma once

#include <vector>

#include "solver/corrections/gain_course.h"
#include "solver/frames/frame_report.h"

namespace glasswing {

// Measured when something is found.
class Quarters {
 public:
  Quarters(const v1::CaptureManifest& manifest, const ComparedFrames& compared, const Removed& removed)
      : manifest_(manifest), compared_(compared), removed_(removed) {}

  bool say_ghosts(const FrameReport& whole) const;
  bool say_flare(const FrameReport& whole) const;
  // Whether gains differ from `scale` as `steps` do, in the sum over the frames that a quarter measures.
  bool say_gains(const std::vector<GainStep>& steps, double scale) const;
  bool say_offset(int frame, double offset) const;

 private:
  const std::vector<FrameReport>& reports() const;

  const v1::CaptureManifest& manifest_;
  const ComparedFrames& compared_;
  const Removed removed_;
  mutable std::vector<FrameReport> reports_;
};

}  // namespace glasswing
