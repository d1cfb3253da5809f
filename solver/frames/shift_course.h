// How what the camera sees moved during a session, from the shifts of its frames (frame_report.h): a step, a
// creep or a tremble.
#pragma once

#include <cmath>
#include <optional>
#include <string>

#include "solver/frames/frame_report.h"

namespace glasswing {

// From this frame on, in time, everything lies that much to the right and below.
struct Knock {
  int frame = -1;
  double dx_px = 0.0, dy_px = 0.0;
  double size_px() const { return std::hypot(dx_px, dy_px); }
};

struct ShiftCourse {
  std::string warning;  // for users: which frames, how far, and the likely cause
  std::optional<Knock> knock;
  bool trembles = false;
  double moved_px = 0.0;  // by which frames lie apart
};

// Neither if nothing moved by 0.1 px, by ten errors of one frame, or by more than frames lie off the course.
ShiftCourse shift_course(const FrameReport& report);

// The step from the frames before this one to the others.
Knock step_left(const FrameReport& report, int frame);

}  // namespace glasswing
