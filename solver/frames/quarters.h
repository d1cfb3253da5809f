// What each quarter of the pixels beside the object says by itself of what all of them show. What the rig
// does to a frame it does everywhere; light that the object throws beside itself, and what the model lacks,
// lie somewhere.
#pragma once

#include <vector>

#include "solver/frames/frame_report.h"
#include "solver/frames/gain_course.h"

namespace glasswing {

// Measured when something is found.
class Quarters {
 public:
  Quarters(const v1::CaptureManifest& manifest, const ComparedFrames& compared, const Removed& removed)
      : manifest_(manifest), compared_(compared), removed_(removed) {}

  bool say_ghosts(const FrameReport& whole) const;
  bool say_flare(const FrameReport& whole) const;
  // Whether gains differ from `scale` as `steps` do, in the sum over the frames that a quarter tells of.
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
