#include "core/geometry/pose_weakness.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kNoTilt_deg = 5.0, kLittleTilt_deg = 15.0, kOneAxis_deg = 3.0;

double degrees(double rad) {
  return rad * 180.0 / std::numbers::pi;
}

}  // namespace

TiltSpread tilt_spread(std::span<const Eigen::Vector3d> normals) {
  TiltSpread spread;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& normal : normals) mean += normal;
  mean.normalize();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& normal : normals) {
    for (const Eigen::Vector3d& other : normals)
      spread.max_deg = std::max(spread.max_deg, degrees(std::acos(std::min(normal.dot(other), 1.0))));
    const Eigen::Vector3d across = normal - mean * mean.dot(normal);
    scatter += across * across.transpose() / static_cast<double>(normals.size());
  }
  // The smallest eigenvalue belongs to the mean itself.
  const Eigen::Vector3d variances = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvalues();
  spread.across_deg = degrees(std::sqrt(std::max(variances[1], 0.0)));
  return spread;
}

std::string too_little_tilt(const TiltSpread& tilts) {
  if (tilts.max_deg >= kNoTilt_deg) return {};
  return fmt::format(
      "all poses are parallel within {:.1f} degrees, so a longer focal length looks like a greater distance; "
      "turn the monitor or the camera by 20 to 40 degrees in some poses, about either axis",
      tilts.max_deg);
}

std::string weak_tilt(const TiltSpread& tilts) {
  if (tilts.max_deg < kLittleTilt_deg) {
    return fmt::format(
        "the poses turn only by {:.1f} degrees, which couples focal length and distance; 20 to 40 degrees "
        "are "
        "better",
        tilts.max_deg);
  }
  if (tilts.across_deg < kOneAxis_deg) return "the poses turn about only one axis; turn some about the other";
  return {};
}

std::string uncovered_parts(int width_px, int height_px, std::span<const Eigen::Vector2d> seen) {
  constexpr size_t kParts = 3, kCells = 9;
  constexpr int kMaxOpen = 3;  // cells, of nine in a part
  std::array<std::array<bool, kCells>, kCells> covered{};
  for (const Eigen::Vector2d& pixel : seen) {
    const auto cell = [](double at, int side) {
      return static_cast<size_t>(std::clamp(at / side, 0.0, 0.999) * static_cast<double>(kCells));
    };
    covered[cell(pixel.y(), height_px)][cell(pixel.x(), width_px)] = true;
  }
  constexpr std::array<std::array<const char*, kParts>, kParts> kNames{
      {{"top left", "top", "top right"},
       {"left", "middle", "right"},
       {"bottom left", "bottom", "bottom right"}}};
  std::vector<std::string> open;
  for (size_t row = 0; row < kParts; ++row) {
    for (size_t column = 0; column < kParts; ++column) {
      int count = 0;
      for (size_t i = 0; i < kParts; ++i) {
        for (size_t j = 0; j < kParts; ++j) count += !covered[kParts * row + i][kParts * column + j];
      }
      if (count >= kMaxOpen) open.emplace_back(kNames[row][column]);
    }
  }
  return fmt::format("{}", fmt::join(open, ", "));
}

}  // namespace glasswing
