// The parts of glasswing-axis.so that OpenCV does.
#pragma once

#include "core/axis/axis_module.h"

namespace glasswing::axis_module_parts {

std::optional<Reprojection::Pose> pose(std::span<const Eigen::Vector2d> slopes,
                                       std::span<const Eigen::Vector3d> at_mm);
std::vector<BoardCorner> find_corners(const Board& board, int width_px, int height_px,
                                      std::span<const std::uint8_t> grey);

}  // namespace glasswing::axis_module_parts
