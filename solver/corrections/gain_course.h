// How the gains of a session's frames vary over time: whether they flicker, drift or jump, and by how much
// each frame must then be divided.
//
// The scale is that of most frames where the light flickers, that of the first frames where it drifts, and
// that of the empty stage where it jumps; or that of the stripes, where all solids and bars differ from them
// by the same factor.
#pragma once

#include <array>
#include <vector>

#include "solver/frames/frame_report.h"

namespace glasswing {

// A measured frame, in the order of time.
struct GainStep {
  int frame = 0;
  bool object = false, stripe = false;
  double gain = 1.0, sd = 0.0;
  bool same_kind(const GainStep& other) const { return object == other.object && stripe == other.stripe; }
};

struct GainCourse {
  enum class Kind { kSteady, kFlicker, kDrift, kJump };
  Kind kind = Kind::kSteady;
  std::vector<GainStep> steps;
  double scale = 1.0;
  double roughness = 0.0;  // what frames differ by from those beside them
  // By index in the manifest, on that scale: as measured, or, if that is unreliable, that of its neighbours
  // in time that show pictures of the same kind. Empty: steady.
  std::vector<std::array<double, kChannels>> gains;
};

GainCourse gain_course(const v1::CaptureManifest& manifest, const FrameReport& report);

// By which the kinds of frames differ in clean sessions.
inline constexpr double kKindsDiffer = 0.008;

}  // namespace glasswing
