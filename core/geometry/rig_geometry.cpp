#include "core/geometry/rig_geometry.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/text_format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/matte/matte_region.h"

namespace glasswing {
namespace {

class FirstError final : public google::protobuf::io::ErrorCollector {
 public:
  void AddError(int line, int, const std::string& message) override {
    if (text.empty()) text = fmt::format("line {}: {}", line + 1, message);
  }
  std::string text;
};

Eigen::Matrix3d rotation_of(const v1::MonitorPose& pose) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(pose.rotation().data());
}

// Checks each number of `message`, which `title` names: finite, and small enough that products are too.
absl::Status check_numbers(const google::protobuf::Message& message, const std::string& title) {
  constexpr double kMaxNumber = 1e9;
  const google::protobuf::Reflection& values = *message.GetReflection();
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  values.ListFields(message, &fields);
  for (const google::protobuf::FieldDescriptor* field : fields) {
    if (field->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_DOUBLE) continue;
    const int count = field->is_repeated() ? values.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      const double value = field->is_repeated() ? values.GetRepeatedDouble(message, field, i)
                                                : values.GetDouble(message, field);
      if (std::abs(value) <= kMaxNumber) continue;
      return absl::InvalidArgumentError(fmt::format("{} of {} is {}; it must be a number of up to {}",
                                                    field->name(), title, value, kMaxNumber));
    }
  }
  return absl::OkStatus();
}

absl::Status check_axis(const v1::AxisGeometry& axis) {
  constexpr double kMaxDeviation = 1e-6;
  GW_RETURN_IF_ERROR(check_numbers(axis, fmt::format("axis \"{}\"", axis.name())));
  const auto wrong = [&](const std::string& what) {
    return absl::InvalidArgumentError(fmt::format("axis \"{}\" has {}", axis.name(), what));
  };
  if (axis.name().empty()) return absl::InvalidArgumentError("an axis has no name");
  if (axis.direction_size() != 3 || axis.point_mm_size() != 3) {
    return wrong(fmt::format("{} numbers of direction and {} of point_mm; they must be 3 and 3",
                             axis.direction_size(), axis.point_mm_size()));
  }
  const double length = Eigen::Map<const Eigen::Vector3d>(axis.direction().data()).norm();
  if (!(std::abs(length - 1.0) < kMaxDeviation))
    return wrong(fmt::format("a direction of length {}; it must be 1", length));
  if (!axis.covariance().empty() && axis.covariance_size() != 36)
    return wrong(fmt::format("{} numbers of covariance; they must be 36, or none", axis.covariance_size()));
  return absl::OkStatus();
}

}  // namespace

absl::Status check_geometry(const v1::RigGeometry& geometry) {
  const v1::CameraGeometry& camera = geometry.camera();
  GW_RETURN_IF_ERROR(check_numbers(camera, "the camera"));
  if (!(camera.fx_px() > 0.0 && camera.fy_px() > 0.0) || camera.width_px() < 1 || camera.height_px() < 1) {
    return absl::InvalidArgumentError(
        fmt::format("the camera is {}x{} px, its fx_px {} and fy_px {}; all must be above 0",
                    camera.width_px(), camera.height_px(), camera.fx_px(), camera.fy_px()));
  }
  if (geometry.monitors().empty()) return absl::InvalidArgumentError("it has no poses in monitors");
  for (const v1::MonitorPose& pose : geometry.monitors()) {
    GW_RETURN_IF_ERROR(check_numbers(pose, fmt::format("pose \"{}\"", pose.name())));
    if (pose.rotation_size() != 9 || pose.translation_mm_size() != 3) {
      return absl::InvalidArgumentError(
          fmt::format("pose \"{}\" has {} numbers of rotation and {} of translation_mm; they must be 9 and 3",
                      pose.name(), pose.rotation_size(), pose.translation_mm_size()));
    }
    if (pose.width_px() < 1 || pose.height_px() < 1 || !(pose.pitch_mm() > 0.0)) {
      return absl::InvalidArgumentError(
          fmt::format("pose \"{}\" has a monitor of {}x{} px of {} mm; all must be above 0", pose.name(),
                      pose.width_px(), pose.height_px(), pose.pitch_mm()));
    }
    if (!pose.covariance().empty() && pose.covariance_size() != 36) {
      return absl::InvalidArgumentError(
          fmt::format("pose \"{}\" has {} numbers of covariance; they must be 36, or none", pose.name(),
                      pose.covariance_size()));
    }
    const Eigen::Matrix3d rotation = rotation_of(pose);
    constexpr double kMaxDeviation = 1e-3;
    const double deviation =
        (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    if (!(deviation < kMaxDeviation) || rotation.determinant() < 0.0) {
      return absl::InvalidArgumentError(
          fmt::format("the rotation of pose \"{}\" deviates by {} from a rotation matrix; at most {} is "
                      "allowed",
                      pose.name(), rotation.determinant() < 0.0 ? 2.0 : deviation, kMaxDeviation));
    }
    if (!(MonitorPlane(pose).depth_mm() > 0.0)) {
      return absl::InvalidArgumentError(
          fmt::format("pose \"{}\" is {} mm along its normal (x cross y) from the camera; it must be above 0",
                      pose.name(), MonitorPlane(pose).depth_mm()));
    }
  }
  for (const v1::AxisGeometry& axis : geometry.axes()) GW_RETURN_IF_ERROR(check_axis(axis));
  return absl::OkStatus();
}

absl::StatusOr<v1::RigGeometry> parse_geometry(std::string_view text, std::string_view file_name) {
  v1::RigGeometry geometry;
  FirstError errors;
  google::protobuf::TextFormat::Parser parser;
  parser.RecordErrorsTo(&errors);
  if (!parser.ParseFromString(std::string(text), &geometry))
    return absl::InvalidArgumentError(fmt::format("{}: {}", file_name, errors.text));
  const absl::Status checked = check_geometry(geometry);
  if (!checked.ok())
    return absl::InvalidArgumentError(fmt::format("{}: {}", file_name, std::string(checked.message())));
  return geometry;
}

absl::StatusOr<v1::RigGeometry> read_geometry(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  return parse_geometry(text, path.string());
}

std::string geometry_text(const v1::RigGeometry& geometry) {
  std::string text;
  google::protobuf::TextFormat::Printer printer;
  printer.SetUseShortRepeatedPrimitives(true);
  printer.PrintToString(geometry, &text);
  return text;
}

absl::StatusOr<const v1::MonitorPose*> find_pose(const v1::RigGeometry& geometry, std::string_view name,
                                                 std::string_view monitor) {
  std::vector<std::string> names;
  for (const v1::MonitorPose& pose : geometry.monitors()) {
    if (pose.name() == name && (pose.monitor().empty() || pose.monitor() == monitor)) return &pose;
    names.push_back(pose.monitor().empty() ? pose.name()
                                           : fmt::format("{} of {}", pose.name(), pose.monitor()));
  }
  return absl::NotFoundError(fmt::format("the geometry has no pose \"{}\" of monitor \"{}\"; it has: {}",
                                         name, monitor, fmt::join(names, ", ")));
}

v1::CameraGeometry sampled_camera(const v1::CameraGeometry& camera, int step) {
  if (step == 1) return camera;
  const auto in_samples = [step](double at_px) { return (at_px - 0.5) / step + 0.5; };
  v1::CameraGeometry sampled = camera;
  sampled.set_width_px(sampled_length(camera.width_px(), step));
  sampled.set_height_px(sampled_length(camera.height_px(), step));
  sampled.set_fx_px(camera.fx_px() / step);
  sampled.set_fy_px(camera.fy_px() / step);
  sampled.set_cx_px(in_samples(camera.cx_px()));
  sampled.set_cy_px(in_samples(camera.cy_px()));
  sampled.clear_sd();
  sampled.clear_covariance();
  return sampled;
}

CameraLens::CameraLens(const v1::CameraGeometry& camera)
    : numbers_{camera.fx_px(), camera.fy_px(), camera.cx_px(), camera.cy_px(), camera.k1(),
               camera.k2(),    camera.p1(),    camera.p2(),    camera.k3()} {}

Eigen::Vector2d CameraLens::pixel_of(const Eigen::Vector2d& u) const {
  Eigen::Vector2d pixel;
  lens_pixel(numbers_.data(), u.x(), u.y(), pixel.data());
  return pixel;
}

Eigen::Vector2d CameraLens::slope_of(const Eigen::Vector2d& pixel) const {
  constexpr int kMaxSteps = 50;
  constexpr double kEnd = 1e-13;
  const Eigen::Vector2d d((pixel.x() - numbers_[kCx]) / numbers_[kFx],
                          (pixel.y() - numbers_[kCy]) / numbers_[kFy]);
  Eigen::Vector2d u = d;
  for (int step = 0; step < kMaxSteps; ++step) {
    const Eigen::Vector2d back = pixel_of(u);
    const Eigen::Vector2d off((pixel.x() - back.x()) / numbers_[kFx], (pixel.y() - back.y()) / numbers_[kFy]);
    u += off;
    if (off.norm() < kEnd) break;
  }
  return u;
}

MonitorPlane::MonitorPlane(const v1::MonitorPose& pose) : pitch_mm(pose.pitch_mm()) {
  const Eigen::Matrix3d rotation = rotation_of(pose);
  corner_mm = Eigen::Map<const Eigen::Vector3d>(pose.translation_mm().data());
  x_mm = rotation.col(0) * pitch_mm;
  y_mm = rotation.col(1) * pitch_mm;
  normal = x_mm.cross(y_mm).normalized();
}

MonitorPlane MonitorPlane::at_depth(double depth) const {
  MonitorPlane moved = *this;
  moved.corner_mm += (depth - depth_mm()) * normal;
  return moved;
}

}  // namespace glasswing
