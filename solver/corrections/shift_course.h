// How the camera's view moved during a session, from the shifts and turns of its frames (frame_report.h): a
// step, a creep or a tremble.
#pragma once

#include <cmath>
#include <optional>
#include <string>

#include "solver/frames/frame_report.h"

namespace glasswing {

// From this frame on, in time, everything is shifted this much to the right and down, and turned clockwise
// about the picture's centre.
struct Knock {
  int frame = -1;
  double dx_px = 0.0, dy_px = 0.0, turn_rad = 0.0;
  double shift_px() const { return std::hypot(dx_px, dy_px); }
  // Of the corner that moved most, or nearly.
  double size_px(double radius_px) const { return shift_px() + std::abs(turn_rad) * radius_px; }
};

// For users: how far, and the likely cause; `when`: " (83 s after the first)", or nothing.
std::string text_of(const Knock& knock, const std::string& when = "");

struct ShiftCourse {
  std::string warning;  // for users: which frames, how far, and the likely cause
  std::optional<Knock> knock;
  bool trembles = false;
  double moved_px = 0.0;  // by which frames lie apart
};

// Neither if nothing moved by 0.1 px, at the picture's corners if it turned, by ten errors of one frame, or
// by more than frames deviate from the course.
ShiftCourse shift_course(const FrameReport& report);

// The step from the frames before this one to the others.
Knock step_left(const FrameReport& report, int frame);

}  // namespace glasswing
