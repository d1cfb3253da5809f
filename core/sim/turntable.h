// The table on which a simulated object stands: how far it has turned, and how its axis errs.
#pragma once

#include "core/sim/optics.h"

namespace glasswing {

struct Turntable {
  double turn_deg = 0.0;    // clockwise, seen from above
  double wobble_deg = 0.0;  // by which the axis tips; the direction goes round twice in a turn
  friend bool operator==(const Turntable&, const Turntable&) = default;
};

// Columns of a rotation, each the image of a unit vector.
struct Rotation {
  Vec3 x{1.0, 0.0, 0.0}, y{0.0, 1.0, 0.0}, z{0.0, 0.0, 1.0};
  Vec3 operator()(Vec3 v) const { return v.x * x + v.y * y + v.z * z; }
  Vec3 back(Vec3 v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
};
// From the table's own frame to the scene's.
Rotation rotation_of(const Turntable& table);

}  // namespace glasswing
