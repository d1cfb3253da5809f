// What OpenCSP's SOFAST loads: a measurement of fringes for each view, and camera, display and their
// orientation, in metres. The fringes are composites: the object as it would look in front of them.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <numbers>

#include "compositing/dataset/dataset_format.h"
#include "compositing/dataset/hdf5_module.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/composite/fast_compositor.h"
#include "core/process/module.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kShifts = 4;
constexpr double kWhite = 255.0;  // of the images
constexpr double kMetres = 1e-3;

absl::Status write_hdf5(const fs::path& path, const std::vector<Hdf5Dataset>& datasets) {
  GW_ASSIGN_OR_RETURN(const Hdf5Module* const module, hdf5_module());
  UnfinishedFile file(path);
  if (!module->write(file.path().string(), datasets))
    return absl::UnavailableError(fmt::format("{} cannot be written", path.string()));
  return file.finish();
}

std::vector<double> numbers_of(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

// In periods a screen; the finest has at least eight pixels.
std::vector<double> periods_for(int length_px) {
  std::vector<double> periods{0.9};
  for (double periods_across = 4.0; periods_across * 8.0 <= length_px; periods_across *= 4.0)
    periods.push_back(periods_across);
  return periods;
}

// SOFAST counts a screen's fraction from 1 at its left and upper edge to 0: its axes run against the pixels'.
RadianceImage fringe(const v1::Monitor& monitor, bool along_y, double periods, int shift) {
  RadianceImage picture(monitor.width_px(), monitor.height_px());
  const int length = along_y ? picture.height_px : picture.width_px;
  for (int y = 0; y < picture.height_px; ++y) {
    for (int x = 0; x < picture.width_px; ++x) {
      const double fraction = 1.0 - static_cast<double>(along_y ? y : x) / std::max(length - 1, 1);
      const double phase = 2.0 * std::numbers::pi * periods * fraction - 0.5 * std::numbers::pi * shift;
      for (int c = 0; c < kChannels; ++c)
        picture.at(x, y, c) = static_cast<float>(0.5 + 0.5 * std::cos(phase));
    }
  }
  return picture;
}

// Of what the camera sees of pictures on the first monitor: height x width x pictures.
class Stack {
 public:
  Stack(const DatasetView& view, const FastCompositor& compositor, int channel)
      : view_(view), compositor_(compositor), channel_(channel) {}
  absl::Status add(RadianceImage picture) {
    std::vector<RadianceImage> behind(view_.monitors.size());
    behind[0] = std::move(picture);
    GW_ASSIGN_OR_RETURN(RadianceImage seen, compositor_.composite(behind));
    pictures_.push_back(std::move(seen));
    return absl::OkStatus();
  }
  Hdf5Dataset dataset(const std::string& name) const {
    const int height = view_.matte.height_px(), width = view_.matte.width_px();
    std::vector<float> samples;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        for (const RadianceImage& picture : pictures_)
          samples.push_back(static_cast<float>(kWhite) * picture.at(x, y, channel_));
      }
    }
    return {
        .name = name,
        .value = std::move(samples),
        .shape = {static_cast<std::uint64_t>(height), static_cast<std::uint64_t>(width), pictures_.size()}};
  }

 private:
  const DatasetView& view_;
  const FastCompositor& compositor_;
  const int channel_;
  std::vector<RadianceImage> pictures_;
};

class SofastWriter final : public DatasetWriter {
 public:
  explicit SofastWriter(const DatasetOptions& options) : options_(options) {}

  absl::Status add(const DatasetView& view) override {
    if (view.monitors.size() != 1) {
      return absl::InvalidArgumentError(
          fmt::format("{} has {} monitors; SOFAST has one screen", view.name, view.monitors.size()));
    }
    const v1::Monitor& monitor = view.matte.metadata.monitors(0);
    GW_ASSIGN_OR_RETURN(const FastCompositor compositor, FastCompositor::create(view.matte));
    Stack masks(view, compositor, options_.channel), fringes(view, compositor, options_.channel);
    RadianceImage white(monitor.width_px(), monitor.height_px());
    GW_RETURN_IF_ERROR(masks.add(white));
    std::ranges::fill(white.samples, 1.0f);
    GW_RETURN_IF_ERROR(masks.add(std::move(white)));
    const std::vector<double> periods_x = periods_for(monitor.width_px()),
                              periods_y = periods_for(monitor.height_px());
    for (const bool along_y : {true, false}) {
      for (const double periods : along_y ? periods_y : periods_x) {
        for (int shift = 0; shift < kShifts; ++shift)
          GW_RETURN_IF_ERROR(fringes.add(fringe(monitor, along_y, periods, shift)));
      }
    }
    const MonitorPlane& plane = view.monitors[0];
    const Eigen::Vector3d middle = plane.at(0.5 * monitor.width_px(), 0.5 * monitor.height_px());
    const double distance_mm = (middle - view.object_to_camera.topRightCorner<3, 1>()).norm();
    const std::string group = "MeasurementSofastFringe/";
    const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    GW_RETURN_IF_ERROR(write_hdf5(options_.directory / fmt::format("measurement-{}.h5", view.name),
                                  {masks.dataset(group + "mask_images"),
                                   fringes.dataset(group + "fringe_images"),
                                   {group + "fringe_periods_x", periods_x, {periods_x.size()}},
                                   {group + "fringe_periods_y", periods_y, {periods_y.size()}},
                                   {group + "v_measure_point_facet", std::vector<double>(3), {3}},
                                   {group + "dist_optic_screen", std::vector<double>{kMetres * distance_mm}},
                                   {group + "date", fmt::format("{:%Y-%m-%dT%H:%M:%S}", fmt::gmtime(now))},
                                   {group + "name", view.name}}));
    return write_rig(view, monitor, middle);
  }
  absl::Status finish() override { return absl::OkStatus(); }

 private:
  // One for each view, as they may have different geometries.
  absl::Status write_rig(const DatasetView& view, const v1::Monitor& monitor,
                         const Eigen::Vector3d& middle) const {
    const v1::CameraGeometry& camera = view.camera;
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> matrix = camera_matrix(camera, 0.0);
    const MonitorPlane& plane = view.monitors[0];
    Eigen::Matrix3d screen;  // its axes in the camera's frame
    screen << -plane.x_mm / plane.pitch_mm, -plane.y_mm / plane.pitch_mm, plane.normal;
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(screen.transpose()));
    return write_hdf5(
        options_.directory / fmt::format("rig-{}.h5", view.name),
        {{"Camera/intrinsic_mat", std::vector<double>(matrix.data(), matrix.data() + 9), {3, 3}},
         {"Camera/distortion_coef",
          std::vector<double>{camera.k1(), camera.k2(), camera.p1(), camera.p2(), camera.k3()},
          {5}},
         {"Camera/image_shape_xy",
          std::vector<double>{1.0 * camera.width_px(), 1.0 * camera.height_px()},
          {2}},
         {"Camera/name", std::string("camera")},
         {"DisplayShape/screen_model", std::string("rectangular2D")},
         {"DisplayShape/screen_x", std::vector<double>{kMetres * plane.pitch_mm * (monitor.width_px() - 1)}},
         {"DisplayShape/screen_y", std::vector<double>{kMetres * plane.pitch_mm * (monitor.height_px() - 1)}},
         {"DisplayShape/name", monitor.name()},
         {"SpatialOrientation/r_cam_screen", numbers_of(turn.angle() * turn.axis()), {3}},
         {"SpatialOrientation/v_cam_screen_cam", numbers_of(kMetres * middle), {3}},
         {"SpatialOrientation/optic_oriented", std::vector<double>{0.0}}});
  }

  DatasetOptions options_;
};

}  // namespace

absl::StatusOr<const Hdf5Module*> hdf5_module() {
  static const absl::StatusOr<const void*> loaded = load_module("glasswing-hdf5.so", "glasswing_hdf5_module");
  if (!loaded.ok()) return loaded.status();
  return static_cast<const Hdf5Module*>(*loaded);
}

std::unique_ptr<DatasetWriter> sofast_writer(const DatasetOptions& options) {
  return std::make_unique<SofastWriter>(options);
}

}  // namespace glasswing
