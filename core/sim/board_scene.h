// A ChArUco board on the simulated table, as a calibration of the axis needs: a stiff plate that stands
// upright, leans back a little and faces the camera while the table is at 0, lit evenly by the room. It is
// printed with OpenCV's board of 7x5 squares and dictionary 4x4_50, of cells (core/sim/board_scene.cpp) that
// are eighths of a square, with a white margin of one cell.
#pragma once

#include <memory>

#include "core/sim/scene.h"

namespace glasswing {

// Of a square of the board, in widths of the back monitor.
inline constexpr double kBoardSquare = 1.0 / 20.0;

std::unique_ptr<Scene> make_board(MonitorSize back);

}  // namespace glasswing
