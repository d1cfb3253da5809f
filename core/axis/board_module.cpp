#include "core/axis/board_module.h"

#include <algorithm>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace glasswing::axis_module_parts {
namespace {

cv::Ptr<cv::aruco::CharucoBoard> board_of(const Board& board, int number) {
  const cv::Ptr<cv::aruco::CharucoBoard> chart = cv::aruco::CharucoBoard::create(
      board.columns, board.rows, static_cast<float>(board.square_mm), static_cast<float>(board.marker_mm),
      cv::aruco::getPredefinedDictionary(board.dictionary));
  for (int& id : chart->ids) id += number * board.markers();
  return chart;
}

// How far from a corner there are no edges of markers, px.
int reach(const Board& board, const std::vector<std::vector<cv::Point2f>>& markers) {
  constexpr int kMin_px = 2, kMax_px = 10;
  double shortest_px = 1e9;
  for (const std::vector<cv::Point2f>& marker : markers) {
    for (size_t i = 0; i < marker.size(); ++i)
      shortest_px = std::min(shortest_px, cv::norm(marker[i] - marker[(i + 1) % marker.size()]));
  }
  const double free_px = shortest_px * (board.square_mm - board.marker_mm) / (2.0 * board.marker_mm);
  return std::clamp(static_cast<int>(free_px), kMin_px, kMax_px);
}

}  // namespace

std::vector<BoardCorner> find_corners(const Board& board, int width_px, int height_px,
                                      std::span<const std::uint8_t> grey) {
  std::vector<BoardCorner> found;
  try {
    cv::Mat picture(height_px, width_px, CV_8UC1);
    std::ranges::copy(grey, picture.data);
    const cv::Ptr<cv::aruco::DetectorParameters> parameters = cv::aruco::DetectorParameters::create();
    parameters->minMarkerPerimeterRate = 0.01;  // of the picture's width; a board may be small in it
    std::vector<std::vector<cv::Point2f>> all;
    std::vector<int> all_ids;
    cv::aruco::detectMarkers(picture, board_of(board, 0)->dictionary, all, all_ids, parameters);
    for (int number = 0; number < board.count; ++number) {
      const cv::Ptr<cv::aruco::CharucoBoard> chart = board_of(board, number);
      std::vector<std::vector<cv::Point2f>> markers;
      std::vector<int> ids;
      for (size_t i = 0; i < all.size(); ++i) {
        if (all_ids[i] / board.markers() != number) continue;
        markers.push_back(all[i]);
        ids.push_back(all_ids[i]);
      }
      if (ids.empty()) continue;
      std::vector<cv::Point2f> corners;
      std::vector<int> numbers;
      cv::aruco::interpolateCornersCharuco(markers, ids, picture, chart, corners, numbers);
      if (corners.empty()) continue;
      // interpolateCornersCharuco() leaves them off by up to 0.05 px.
      const int reach_px = reach(board, markers);
      cv::cornerSubPix(picture, corners, {reach_px, reach_px}, {-1, -1},
                       {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4});
      for (size_t i = 0; i < corners.size(); ++i) {
        const cv::Point3f& at = chart->chessboardCorners[numbers[i]];
        // OpenCV's first pixel has its centre at 0.
        found.push_back({.pixel = {corners[i].x + 0.5, corners[i].y + 0.5},
                         .at_mm = {at.x, at.y, at.z},
                         .board = number});
      }
    }
  } catch (const cv::Exception&) {
    found.clear();
  }
  return found;
}

std::optional<Reprojection::Pose> pose(std::span<const Eigen::Vector2d> slopes,
                                       std::span<const Eigen::Vector3d> at_mm) {
  std::vector<cv::Point2d> seen;
  std::vector<cv::Point3d> points;
  for (const Eigen::Vector2d& slope : slopes) seen.emplace_back(slope.x(), slope.y());
  for (const Eigen::Vector3d& at : at_mm) points.emplace_back(at.x(), at.y(), at.z());
  try {
    cv::Vec3d turn, shift;
    if (!cv::solvePnP(points, seen, cv::Matx33d::eye(), cv::noArray(), turn, shift, false,
                      cv::SOLVEPNP_SQPNP))
      return std::nullopt;
    cv::solvePnPRefineLM(points, seen, cv::Matx33d::eye(), cv::noArray(), turn, shift);
    cv::Matx33d rotation;
    cv::Rodrigues(turn, rotation);
    if (!(shift[2] > 0.0)) return std::nullopt;
    Reprojection::Pose pose;
    pose.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.val);
    pose.translation_mm = {shift[0], shift[1], shift[2]};
    return pose;
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
}

}  // namespace glasswing::axis_module_parts
