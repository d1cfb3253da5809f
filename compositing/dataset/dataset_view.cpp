#include "compositing/dataset/dataset_view.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "compositing/dataset/point_errors.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/footprint/mode_reduction.h"

namespace glasswing {
namespace {

absl::StatusOr<Eigen::Matrix4d> rigid_motion(const nlohmann::json& rows) {
  constexpr double kMaxDeviation = 1e-6, kMaxLength_mm = 1e9;
  Eigen::Matrix4d pose;
  if (!rows.is_array() || rows.size() != 4) return absl::InvalidArgumentError("is not of four rows");
  for (int row = 0; row < 4; ++row) {
    if (!rows[row].is_array() || rows[row].size() != 4)
      return absl::InvalidArgumentError("has a row that is not of four numbers");
    for (int column = 0; column < 4; ++column) {
      if (!rows[row][column].is_number())
        return absl::InvalidArgumentError("has a row that is not of four numbers");
      pose(row, column) = rows[row][column].get<double>();
    }
  }
  const Eigen::Matrix3d turn = pose.topLeftCorner<3, 3>();
  const double off = (turn * turn.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off < kMaxDeviation) || turn.determinant() < 0.0 ||
      !(pose.topRightCorner<3, 1>().cwiseAbs().maxCoeff() <= kMaxLength_mm) ||
      pose.row(3) != Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0)) {
    return absl::InvalidArgumentError("is not a rotation and a translation with 0 0 0 1 below");
  }
  return pose;
}

// The four pixels around a place, with their weights; those outside have none.
struct Around {
  std::array<int, 4> x{}, y{};
  std::array<double, 4> weight{};
  bool inside = true;
};
Around around(const Eigen::Vector2d& pixel, int width_px, int height_px) {
  constexpr double kNone = 1e-9;
  const double left = std::floor(pixel.x() - 0.5), top = std::floor(pixel.y() - 0.5);
  const double right_part = pixel.x() - 0.5 - left, bottom_part = pixel.y() - 0.5 - top;
  Around found;
  for (int i = 0; i < 4; ++i) {
    found.x[i] = static_cast<int>(left) + i % 2, found.y[i] = static_cast<int>(top) + i / 2;
    found.weight[i] =
        (i % 2 == 1 ? right_part : 1.0 - right_part) * (i / 2 == 1 ? bottom_part : 1.0 - bottom_part);
    const bool on = found.x[i] >= 0 && found.x[i] < width_px && found.y[i] >= 0 && found.y[i] < height_px;
    if (found.weight[i] < kNone || !on) {
      if (found.weight[i] >= kNone) found.inside = false;
      found.weight[i] = 0.0;
    }
  }
  return found;
}

// Calls use(x, y, the pixels around its place in the distorted picture).
template <typename Use>
void for_undistorted(const v1::CameraGeometry& camera, const Use& use) {
  const CameraLens lens(camera);
  for (int y = 0; y < camera.height_px(); ++y) {
    for (int x = 0; x < camera.width_px(); ++x) {
      const Eigen::Vector2d u((x + 0.5 - camera.cx_px()) / camera.fx_px(),
                              (y + 0.5 - camera.cy_px()) / camera.fy_px());
      // Far outside a lens's picture its polynomial is meaningless.
      const Eigen::Vector2d pixel = lens.pixel_of(u).cwiseMax(-2.0).cwiseMin(
          Eigen::Vector2d(camera.width_px() + 2.0, camera.height_px() + 2.0));
      use(x, y, around(pixel, camera.width_px(), camera.height_px()));
    }
  }
}

// In dataset_view.h.
bool together(const ScreenPoints& points, const Around& from, int width_px) {
  Eigen::Vector2d step = Eigen::Vector2d::Zero();
  for (int i = 0; i < 4; ++i) {
    if (from.weight[i] == 0.0) return true;  // on a row or column of pixels
    const Eigen::Vector2d& at = points.at_px[from.y[i] * width_px + from.x[i]];
    step += (i == 0 || i == 3 ? 1.0 : -1.0) * at;
    for (int k = 0; k < i; ++k) {
      if ((at - points.at_px[from.y[k] * width_px + from.x[k]]).norm() > kTogether_px) return false;
    }
  }
  return step.norm() <= kStep_px;
}

double sigma_px(const Mode& mode) {
  return std::sqrt(std::max(0.5 * (double{mode.xx_px2} + double{mode.yy_px2}), 0.0));
}

// The strongest mode with those beside it: a fit makes two of a footprint that is curved. Errors of the parts
// are correlated, and say nothing about those of the whole: a part of the way from the strongest to the whole
// stands for them. Without light its weight is 0.
Mode point_mode(std::span<const Mode> modes, bool boxes) {
  constexpr double kBeside = 1.5;  // sigmas of both
  constexpr double kPart = 0.25;
  const auto strongest = std::ranges::max_element(modes, {}, &Mode::weight);
  Mode whole = *strongest;
  for (auto mode = modes.begin(); mode != modes.end(); ++mode) {
    if (mode == strongest || !(mode->weight > 0.0f) || mode->texture != strongest->texture) continue;
    const double apart_px = std::hypot(mode->x_px - strongest->x_px, mode->y_px - strongest->y_px);
    if (apart_px > kBeside * (sigma_px(*mode) + sigma_px(*strongest))) continue;
    whole = merged(whole, *mode, boxes);
    whole.centre_sd_px = static_cast<float>(
        kPart * std::hypot(whole.x_px - strongest->x_px, whole.y_px - strongest->y_px) / std::numbers::sqrt2);
  }
  return whole;
}

}  // namespace

absl::StatusOr<ObjectPoses> read_object_poses(const std::string& file) {
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(file));
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("object_to_rig") || !json["object_to_rig"].is_object()) {
    return absl::InvalidArgumentError(
        fmt::format("{}: it must be JSON with \"object_to_rig\": {{NAME: four rows of four numbers}}", file));
  }
  ObjectPoses poses;
  for (const auto& [name, rows] : json["object_to_rig"].items()) {
    absl::StatusOr<Eigen::Matrix4d> pose = rigid_motion(rows);
    if (!pose.ok()) {
      return absl::InvalidArgumentError(
          fmt::format("{}: the pose \"{}\" {}", file, name, std::string(pose.status().message())));
    }
    poses[name] = *pose;
  }
  return poses;
}

ScreenPoints screen_points(const DatasetView& view, int channel, bool object) {
  const Matte& matte = view.matte;
  ScreenPoints points;
  std::vector<PointFootprint> footprints;
  const bool boxes = matte.metadata.footprint() == kBoxFootprint;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      float all = 0.0f;
      for (const Mode& mode : matte.modes(x, y, channel)) all += mode.weight;
      const Mode strongest = point_mode(matte.modes(x, y, channel), boxes);
      const float coverage = matte.coverage(x, y);
      // Beside the object a poor fit only says that the stage is not smooth.
      const int flags = matte.flags(x, y) & (object ? ~kFlagNone : ~kFlagPoorFit);
      bool known = flags == 0 && (object ? coverage >= 1.0f : coverage <= 0.0f) && strongest.weight > 0.0f &&
                   strongest.weight >= 0.5f * all && strongest.texture < std::ssize(view.monitors);
      if (known) {
        const v1::Monitor& monitor = matte.metadata.monitors(strongest.texture);
        known = strongest.x_px >= 0.0f && strongest.x_px <= static_cast<float>(monitor.width_px()) &&
                strongest.y_px >= 0.0f && strongest.y_px <= static_cast<float>(monitor.height_px());
      }
      points.known.push_back(known ? 1 : 0);
      points.at_px.emplace_back(known ? strongest.x_px : 0.0, known ? strongest.y_px : 0.0);
      points.at_mm.emplace_back(0.0, 0.0, 0.0);
      points.sd_mm.push_back(0.0f);
      footprints.emplace_back();
      if (!known) continue;
      const MonitorPlane& plane = view.monitors[strongest.texture];
      points.at_mm.back() = plane.at(strongest.x_px, strongest.y_px);
      points.sd_mm.back() = strongest.centre_sd_px * static_cast<float>(plane.pitch_mm);
      footprints.back() = {.weight = strongest.weight,
                           .weight_sd = strongest.weight_sd,
                           .sigma_mm = plane.pitch_mm * sigma_px(strongest),
                           .texture = strongest.texture};
    }
  }
  if (object) correct_points(view, footprints, points);
  return points;
}

bool has_distortion(const v1::CameraGeometry& camera) {
  return camera.k1() != 0.0 || camera.k2() != 0.0 || camera.k3() != 0.0 || camera.p1() != 0.0 ||
         camera.p2() != 0.0;
}

RadianceImage undistorted(const v1::CameraGeometry& camera, const RadianceImage& picture) {
  if (!has_distortion(camera)) return picture;
  RadianceImage pinhole(picture.width_px, picture.height_px, picture.channels);
  for_undistorted(camera, [&](int x, int y, const Around& from) {
    for (int c = 0; c < picture.channels; ++c) {
      double sum = 0.0;
      for (int i = 0; i < 4; ++i) {
        if (from.weight[i] > 0.0) sum += from.weight[i] * picture.at(from.x[i], from.y[i], c);
      }
      pinhole.at(x, y, c) = static_cast<float>(sum);
    }
  });
  return pinhole;
}

ScreenPoints undistorted(const v1::CameraGeometry& camera, const ScreenPoints& points) {
  if (!has_distortion(camera)) return points;
  const int width = camera.width_px();
  ScreenPoints pinhole;
  for_undistorted(camera, [&](int, int, const Around& from) {
    bool known = from.inside;
    Eigen::Vector3d at_mm = Eigen::Vector3d::Zero();
    Eigen::Vector2d at_px = Eigen::Vector2d::Zero();
    double sd_mm = 0.0;
    for (int i = 0; i < 4 && known; ++i) {
      if (from.weight[i] == 0.0) continue;
      const int pixel = from.y[i] * width + from.x[i];
      known = points.known[pixel] != 0;
      at_mm += from.weight[i] * points.at_mm[pixel];
      at_px += from.weight[i] * points.at_px[pixel];
      sd_mm += from.weight[i] * points.sd_mm[pixel];
    }
    known = known && together(points, from, width);
    pinhole.known.push_back(known ? 1 : 0);
    pinhole.at_mm.push_back(known ? at_mm : Eigen::Vector3d::Zero());
    pinhole.at_px.push_back(known ? at_px : Eigen::Vector2d::Zero());
    pinhole.sd_mm.push_back(known ? static_cast<float>(sd_mm) : 0.0f);
  });
  return pinhole;
}

RadianceImage coverage_of(const Matte& matte) {
  RadianceImage coverage(matte.width_px(), matte.height_px(), 1);
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) coverage.at(x, y, 0) = matte.coverage(x, y);
  }
  return coverage;
}

Eigen::Matrix3d camera_matrix(const v1::CameraGeometry& camera, double centre) {
  const double less = 0.5 - centre;
  Eigen::Matrix3d matrix;
  matrix << camera.fx_px(), 0.0, camera.cx_px() - less, 0.0, camera.fy_px(), camera.cy_px() - less, 0.0, 0.0,
      1.0;
  return matrix;
}

}  // namespace glasswing
