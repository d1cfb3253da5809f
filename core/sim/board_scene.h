// A square column with ChArUco boards on its four sides on the simulated table, as a calibration of the axis
// needs: upright, lit evenly by the room, opaque. The prints are OpenCV's boards of 7x5 squares with the
// markers of dictionary 4x4_100, 17 for each side.
#pragma once

#include <memory>

#include "core/sim/scene.h"

namespace glasswing {

// Of a square of the board, in widths of the back monitor.
inline constexpr double kBoardSquare = 1.0 / 20.0;

std::unique_ptr<Scene> make_board(MonitorSize back);

}  // namespace glasswing
