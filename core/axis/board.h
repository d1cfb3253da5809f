// ChArUco boards: a chessboard with a marker in each white square, so that any visible part of it says which
// corners are seen (OpenCV's contributed module aruco).
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

struct Board {
  int columns = 0, rows = 0;  // squares
  double square_mm = 0.0, marker_mm = 0.0;
  int dictionary = 0;  // OpenCV's number
  int count = 1;       // boards that differ in their markers: number k begins where number k - 1 ends
  int markers() const { return columns * rows / 2; }  // of a board
};

// An inner corner of the chessboard.
struct BoardCorner {
  Eigen::Vector2d pixel;  // continuous
  Eigen::Vector3d at_mm;  // on the board
  int board = 0;
};

// "7x5:8:6": squares across and down, their size and the markers', mm; "7x5:8:6:4": four boards.
// INVALID_ARGUMENT names `option`, or lists the dictionaries.
absl::StatusOr<Board> parse_board(std::string_view option, std::string_view text,
                                  std::string_view dictionary);
// "4x4_50, 4x4_100, ..."
std::string dictionary_names();

// The corners seen in a picture of light; none: no board. UNIMPLEMENTED: the module is not installed.
absl::StatusOr<std::vector<BoardCorner>> find_corners(const Board& board, const RadianceImage& picture);

}  // namespace glasswing
