// The folders of IDR and of NeTO: a pinhole camera, projections in cameras.npz, pixels with centres at whole
// numbers, and the object inside a sphere.
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "compositing/dataset/dataset_files.h"
#include "compositing/dataset/dataset_format.h"
#include "compositing/dataset/npz.h"
#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

struct Sphere {
  Eigen::Vector3d centre;
  double radius;
};

// The outlines of the object from all views, in its frame.
class Outlines {
 public:
  void add(const DatasetView& view, const RadianceImage& mask) {
    const Eigen::Isometry3d to_object = Eigen::Isometry3d(view.object_to_camera).inverse();
    View own{.camera = to_object.translation(), .middle = Eigen::Vector3d::Zero(), .edge = {}};
    const auto inside = [&](int x, int y) {
      return x >= 0 && y >= 0 && x < mask.width_px && y < mask.height_px && mask.at(x, y, 0) > 0.5f;
    };
    const v1::CameraGeometry& camera = view.camera;
    for (int y = 0; y < mask.height_px; ++y) {
      for (int x = 0; x < mask.width_px; ++x) {
        if (!inside(x, y)) continue;
        const Eigen::Vector3d direction((x + 0.5 - camera.cx_px()) / camera.fx_px(),
                                        (y + 0.5 - camera.cy_px()) / camera.fy_px(), 1.0);
        const Eigen::Vector3d turned = (to_object.linear() * direction).normalized();
        own.middle += turned;
        if (!inside(x - 1, y) || !inside(x + 1, y) || !inside(x, y - 1) || !inside(x, y + 1))
          own.edge.push_back(turned);
      }
    }
    if (own.edge.empty()) return;
    own.middle.normalize();
    views_.push_back(std::move(own));
  }

  // Around the point nearest to the rays through the outlines' middles, as large as they need. Of one view it
  // is the origin of the object's frame. FAILED_PRECONDITION: no view shows the object.
  absl::StatusOr<Sphere> sphere() const {
    if (views_.empty())
      return absl::FailedPreconditionError("no matte has a pixel that shows the object, so it has no size");
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    for (const View& view : views_) {
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - view.middle * view.middle.transpose();
      sum += across;
      at += across * view.camera;
    }
    constexpr double kSpread = 1e-3;  // of the rays' directions, squared
    const double spread = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(sum).eigenvalues()[0];
    Sphere sphere{.centre = Eigen::Vector3d::Zero(), .radius = 0.0};
    if (spread > kSpread * static_cast<double>(views_.size())) sphere.centre = sum.ldlt().solve(at);
    for (const View& view : views_) {
      for (const Eigen::Vector3d& direction : view.edge)
        sphere.radius = std::max(sphere.radius, direction.cross(sphere.centre - view.camera).norm());
    }
    constexpr double kMargin = 1.05;
    sphere.radius *= kMargin;
    return sphere;
  }

 private:
  struct View {
    Eigen::Vector3d camera, middle;
    std::vector<Eigen::Vector3d> edge;
  };
  std::vector<View> views_;
};

// world_mat_i projects the object's frame, mm, to pixels; scale_mat_i maps the unit sphere to that of the
// object.
absl::Status write_cameras(const fs::path& path, const std::vector<Eigen::Matrix4d>& projections,
                           const Sphere& sphere) {
  using Rows = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  GW_ASSIGN_OR_RETURN(NpzWriter file, NpzWriter::create(path));
  Rows scale = Rows::Identity();
  scale.topLeftCorner<3, 3>() *= sphere.radius;
  scale.topRightCorner<3, 1>() = sphere.centre;
  for (int i = 0; i < std::ssize(projections); ++i) {
    const Rows world = projections[i];
    const std::span<const double> projection(world.data(), 16), sphere_numbers(scale.data(), 16);
    GW_RETURN_IF_ERROR(file.add(fmt::format("world_mat_{}", i), numpy_array(projection, {4, 4})));
    GW_RETURN_IF_ERROR(file.add(fmt::format("scale_mat_{}", i), numpy_array(sphere_numbers, {4, 4})));
  }
  return file.finish();
}

RadianceImage mask_of(const DatasetView& view) {
  return undistorted(view.camera, coverage_of(view.matte));
}

class PinholeWriter : public DatasetWriter {
 public:
  explicit PinholeWriter(const DatasetOptions& options, const char* cameras)
      : options_(options), cameras_(cameras) {}
  absl::Status add(const DatasetView& view) override {
    const RadianceImage mask = mask_of(view);
    GW_RETURN_IF_ERROR(put(view, "mask", mask));
    GW_RETURN_IF_ERROR(add(view, mask));
    outlines_.add(view, mask);
    Eigen::Matrix4d projection = Eigen::Matrix4d::Identity();
    projection.topRows<3>() = camera_matrix(view.camera, 0.0) * view.object_to_camera.topRows<3>();
    projections_.push_back(projection);
    return absl::OkStatus();
  }
  absl::Status finish() override {
    GW_ASSIGN_OR_RETURN(const Sphere sphere, outlines_.sphere());
    return write_cameras(options_.directory / cameras_, projections_, sphere);
  }

 protected:
  virtual absl::Status add(const DatasetView& view, const RadianceImage& mask) = 0;
  // A mask of the next view.
  absl::Status put(const DatasetView&, const char* folder, const RadianceImage& mask) const {
    GW_ASSIGN_OR_RETURN(const fs::path path, next(folder));
    return write_mask(path, mask);
  }
  absl::StatusOr<fs::path> next(const char* folder) const {
    GW_RETURN_IF_ERROR(make_directory_durably(options_.directory / folder));
    return options_.directory / folder / fmt::format("{:03}.png", projections_.size());
  }
  const DatasetOptions& options() const { return options_; }

 private:
  DatasetOptions options_;
  const char* cameras_;
  Outlines outlines_;
  std::vector<Eigen::Matrix4d> projections_;
};

class IdrWriter final : public PinholeWriter {
 public:
  explicit IdrWriter(const DatasetOptions& options) : PinholeWriter(options, "cameras.npz") {}

 private:
  absl::Status add(const DatasetView& view, const RadianceImage&) override {
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, options().picture(view.matte));
    GW_ASSIGN_OR_RETURN(const fs::path path, next("image"));
    return write_png(path, undistorted(view.camera, picture));
  }
};

// screen_point.npy: the place on the monitor that a pixel saw, in the object's frame; light_mask: where there
// is one.
class NetoWriter final : public PinholeWriter {
 public:
  explicit NetoWriter(const DatasetOptions& options) : PinholeWriter(options, "cameras_sphere.npz") {}
  absl::Status finish() override {
    GW_RETURN_IF_ERROR(PinholeWriter::finish());
    const std::int64_t pixels = std::int64_t{width_} * height_, views = std::ssize(sd_) / pixels;
    GW_RETURN_IF_ERROR(write_npy(options().directory / "screen_point.npy",
                                 numpy_array(std::span(points_), {views, height_, width_, 3})));
    return write_npy(options().directory / "screen_point_sd.npy",
                     numpy_array(std::span(sd_), {views, height_, width_}));
  }

 private:
  absl::Status add(const DatasetView& view, const RadianceImage&) override {
    const int width = view.matte.width_px(), height = view.matte.height_px();
    if (width_ != 0 && (width != width_ || height != height_)) {
      return absl::InvalidArgumentError(
          fmt::format("{} is {}x{}, but those before it are {}x{}; screen_point.npy has one size", view.name,
                      width, height, width_, height_));
    }
    width_ = width, height_ = height;
    const ScreenPoints points = undistorted(view.camera, screen_points(view, options().channel, true));
    const Eigen::Isometry3d to_object = Eigen::Isometry3d(view.object_to_camera).inverse();
    RadianceImage known(width, height, 1);
    for (int i = 0; i < std::ssize(points.known); ++i) {
      known.samples[i] = points.known[i];
      const Eigen::Vector3d at =
          points.known[i] != 0 ? to_object * points.at_mm[i] : Eigen::Vector3d(0, 0, 0);
      points_.insert(points_.end(), at.data(), at.data() + 3);
    }
    sd_.insert(sd_.end(), points.sd_mm.begin(), points.sd_mm.end());
    return put(view, "light_mask", known);
  }

  int width_ = 0, height_ = 0;
  std::vector<float> points_, sd_;
};

}  // namespace

std::unique_ptr<DatasetWriter> idr_writer(const DatasetOptions& options) {
  return std::make_unique<IdrWriter>(options);
}

std::unique_ptr<DatasetWriter> neto_writer(const DatasetOptions& options) {
  return std::make_unique<NetoWriter>(options);
}

}  // namespace glasswing
