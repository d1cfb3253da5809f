#include "core/geometry/geometry_fit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/geometry/pose_weakness.h"
#include "core/geometry/reprojection_fit.h"
#include "core/geometry/view_start.h"

namespace glasswing {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kDegree = 180.0 / std::numbers::pi;
constexpr double kHuberSd = 2.0;
constexpr double kMaxSd = 5.0;  // of a point that counts
constexpr int kRejections = 3;  // rounds
constexpr double kMinScatter_px = 1e-4;
constexpr double kMapSd_px = 0.02, kMapPoints = 15.0;  // a polynomial of degree 4 has 15 numbers
constexpr size_t kPoseNumbers = 6;
constexpr int kBlockColumns = 4, kBlockRows = 3, kMinInBlock = 4;
constexpr double kMinEigenvalue = 1e-13;  // of the normal matrix with a diagonal of 1
constexpr double kMaxFocalError = 0.05, kWarnFocalError = 0.003;
constexpr double kWarnRms_px = 0.25, kWarnLeftOut = 0.05, kWorsePose = 3.0;
constexpr size_t kFewPoses = 4;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

class GeometryFitter {
 public:
  GeometryFitter(int width_px, int height_px, std::span<const MonitorView> views,
                 std::span<const double> pitch_mm)
      : width_px_(width_px),
        height_px_(height_px),
        views_(views),
        pitch_mm_(pitch_mm.begin(), pitch_mm.end()),
        picture_{.middle_px = {0.5 * width_px, 0.5 * height_px}, .half_px = 0.5 * width_px},
        smooth_(views.size(), false),
        scale_px_(views.size(), 1.0),
        scatter_sd_(views.size(), 1.0),
        left_out_(views.size(), 0) {}

  absl::StatusOr<GeometryFit> run() {
    GW_RETURN_IF_ERROR(start());
    problem_.held.fill(false);
    GW_RETURN_IF_ERROR(refine(kHuberSd));
    for (int round = 0; round < kRejections; ++round) {
      rescale();
      leave_out();
      GW_RETURN_IF_ERROR(refine(0.0));
    }
    rescale();
    GW_RETURN_IF_ERROR(refine(0.0));
    GW_RETURN_IF_ERROR(find_covariance());
    return result();
  }

 private:
  // Focal length and poses, with the centre in the middle and no distortion.
  absl::Status start() {
    std::vector<ViewStart> starts;
    for (size_t k = 0; k < views_.size(); ++k) {
      starts.push_back(start_of(views_[k], pitch_mm_[k], picture_));
      if (starts.back().mirrored) {
        return absl::FailedPreconditionError(
            fmt::format("pose \"{}\" sees monitor {} mirrored; a geometry cannot have mirrors",
                        views_[k].session, views_[k].monitor));
      }
    }
    std::vector<double> focal_lengths = {1.0, 2.0, 4.0, 8.0};
    if (const std::optional<double> own = focal_length_of(starts)) focal_lengths = {*own};
    add_points();
    std::optional<Reprojection> best;
    double least_px = INFINITY;
    for (const double focal_length : focal_lengths) {
      Reprojection tried = problem_;
      tried.lens = {};
      tried.lens[kFx] = tried.lens[kFy] = focal_length * picture_.half_px;
      tried.lens[kCx] = picture_.middle_px.x();
      tried.lens[kCy] = picture_.middle_px.y();
      tried.held.fill(true);
      tried.held[kFx] = tried.held[kFy] = false;
      for (const ViewStart& view : starts) tried.poses.push_back(pose_of(view, focal_length));
      GW_RETURN_IF_ERROR(fit_reprojection(tried, kHuberSd).status());
      std::vector<double> sizes;
      for (const SeenPoint& point : tried.points) sizes.push_back(tried.residual_px(point).norm());
      const double usual_px = median(std::move(sizes));
      if (usual_px >= least_px) continue;
      least_px = usual_px;
      best = std::move(tried);
    }
    if (!best) return open_camera("no focal length explains the views");
    problem_ = *std::move(best);
    return absl::OkStatus();
  }

  void add_points() {
    for (size_t k = 0; k < views_.size(); ++k) {
      std::vector<double> known;
      for (const Sighting& sighting : views_[k].sightings) {
        if (sighting.sd_px > 0.0) known.push_back(sighting.sd_px);
      }
      smooth_[k] = known.empty();
      const double usual = known.empty() ? 1.0 : median(std::move(known));
      for (const Sighting& sighting : views_[k].sightings) {
        problem_.points.push_back({.pose = k,
                                   .pixel = sighting.pixel,
                                   .at_mm = sighting.monitor_px * pitch_mm_[k],
                                   .sd_px = sighting.sd_px > 0.0 ? sighting.sd_px / usual : 1.0});
      }
    }
  }

  absl::Status refine(double huber_sd) {
    GW_ASSIGN_OR_RETURN(fit_, fit_reprojection(problem_, huber_sd));
    const bool finite =
        std::ranges::all_of(problem_.lens, [](double number) { return std::isfinite(number); });
    if (fit_.information.size() == 0 || !fit_.information.allFinite() || !finite ||
        !(problem_.lens[kFx] > 0.0) || !(problem_.lens[kFy] > 0.0))
      return open_camera("no focal length explains the views");
    return absl::OkStatus();
  }

  // A view's points get the standard deviation that its residuals have.
  void rescale() {
    std::vector<std::vector<double>> sizes(views_.size());
    for (const SeenPoint& point : problem_.points) {
      const Vector2d off_sd = problem_.residual_px(point) / point.sd_px;
      sizes[point.pose].push_back(std::abs(off_sd.x()));
      sizes[point.pose].push_back(std::abs(off_sd.y()));
    }
    constexpr double kSdByMedian = 1.4826;  // of a normal distribution
    std::vector<double> factors;
    for (size_t k = 0; k < views_.size(); ++k) {
      const double scatter_px = kSdByMedian * median(sizes[k]) * scale_px_[k];
      double scale_px = std::max(scatter_px, kMinScatter_px);
      if (smooth_[k]) {
        const auto count = static_cast<double>(sizes[k].size()) / 2.0;
        scale_px = std::max(scatter_px, kMapSd_px) * std::sqrt(std::max(count / kMapPoints, 1.0));
      }
      scatter_sd_[k] = std::max(scatter_px, kMinScatter_px) / scale_px;
      factors.push_back(scale_px / scale_px_[k]);
      scale_px_[k] = scale_px;
    }
    for (SeenPoint& point : problem_.points) point.sd_px *= factors[point.pose];
  }

  void leave_out() {
    std::erase_if(problem_.points, [&](const SeenPoint& point) {
      const double limit_px = kMaxSd * scatter_sd_[point.pose] * point.sd_px;
      const bool far = !(problem_.residual_px(point).norm() <= limit_px);
      left_out_[point.pose] += far;
      return far;
    });
  }

  // The variance of sums over blocks of the picture, relative to that of independent points. Smooth views
  // have few points by intent.
  double variance_factor() const {
    struct Block {
      Vector2d sum = Vector2d::Zero();
      int count = 0;
    };
    std::map<std::array<int, 3>, Block> blocks;
    for (const SeenPoint& point : problem_.points) {
      if (smooth_[point.pose]) continue;
      const auto cell = [](double at, int side, int cells) {
        return std::clamp(static_cast<int>(at / side * cells), 0, cells - 1);
      };
      Block& block = blocks[{static_cast<int>(point.pose), cell(point.pixel.x(), width_px_, kBlockColumns),
                             cell(point.pixel.y(), height_px_, kBlockRows)}];
      block.sum += problem_.residual_px(point) / point.sd_px;
      block.count += 1;
    }
    const auto rough = static_cast<double>(std::ranges::count(smooth_, false));
    double squares = 0.0, degrees = -static_cast<double>(kLensNumbers) - kPoseNumbers * rough;
    for (const auto& [key, block] : blocks) {
      if (block.count < kMinInBlock) continue;
      squares += block.sum.squaredNorm() / block.count;
      degrees += 2.0;
    }
    return degrees > 0.0 ? std::max(squares / degrees, 1.0) : 1.0;
  }

  absl::Status find_covariance() {
    const VectorXd size = fit_.information.diagonal().cwiseSqrt();
    if (!(size.minCoeff() > 0.0)) return open_camera("a parameter of the lens has no effect");
    const VectorXd scale = size.cwiseInverse();
    const MatrixXd scaled = scale.asDiagonal() * fit_.information * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scaled);
    if (!(solver.eigenvalues()[0] > kMinEigenvalue))
      return open_camera("the poses do not determine the lens");
    covariance_ = variance_factor() * (scale.asDiagonal() * solver.eigenvectors() *
                                       solver.eigenvalues().cwiseInverse().asDiagonal() *
                                       solver.eigenvectors().transpose() * scale.asDiagonal());
    for (size_t i = 0; i < kLensNumbers; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      lens_sd_[i] = std::sqrt(covariance_(at, at));
    }
    const double error = std::max(lens_sd_[kFx] / problem_.lens[kFx], lens_sd_[kFy] / problem_.lens[kFy]);
    if (error > kMaxFocalError) {
      return open_camera(fmt::format("the focal length is known only to {:.0f} %; {:.0f} % are needed",
                                     100.0 * error, 100.0 * kMaxFocalError));
    }
    return absl::OkStatus();
  }

  std::vector<Vector3d> normals() const {
    std::vector<Vector3d> normals;
    for (const Reprojection::Pose& pose : problem_.poses) normals.push_back(pose.rotation.col(2));
    return normals;
  }

  absl::Status open_camera(const std::string& what) const {
    const std::string why = too_little_tilt(tilt_spread(normals()));
    return absl::FailedPreconditionError(fmt::format(
        "{}: {}", what,
        why.empty() ? "capture more poses, turned by 20 to 40 degrees about either axis, that together "
                      "fill the picture"
                    : why));
  }

  Eigen::Matrix<double, 6, 6> pose_covariance(size_t pose) const {
    const auto first = static_cast<Eigen::Index>(kLensNumbers + kPoseNumbers * pose);
    return covariance_.block<6, 6>(first, first);
  }

  GeometryFit result() const {
    GeometryFit result;
    put_camera(*result.geometry.mutable_camera());
    std::vector<double> all;
    for (size_t k = 0; k < views_.size(); ++k) {
      std::vector<double> sizes;
      for (const SeenPoint& point : problem_.points) {
        if (point.pose == k) sizes.push_back(problem_.residual_px(point).norm());
      }
      all.insert(all.end(), sizes.begin(), sizes.end());
      result.poses.push_back(pose_fit(k, sizes));
      put_pose(k, result.poses.back(), *result.geometry.add_monitors());
    }
    result.median_px = median(all);
    result.rms_px = rms_of(all);
    result.max_px = *std::ranges::max_element(all);
    result.geometry.set_residual_px(result.rms_px);
    for (const std::string& warning : warnings(result)) result.geometry.add_warnings(warning);
    return result;
  }

  static double rms_of(const std::vector<double>& sizes) {
    double squares = 0.0;
    for (const double size : sizes) squares += size * size;
    return std::sqrt(squares / static_cast<double>(std::max<size_t>(sizes.size(), 1)));
  }

  PoseFit pose_fit(size_t k, const std::vector<double>& sizes) const {
    const Reprojection::Pose& pose = problem_.poses[k];
    const Vector3d from_corner =
        pose.rotation * (0.5 * pitch_mm_[k] * Vector3d(views_[k].width_px, views_[k].height_px, 0.0));
    const Vector3d middle = from_corner + pose.translation_mm;
    const Eigen::Matrix<double, 6, 6> covariance = pose_covariance(k);
    Eigen::Matrix<double, 1, 6> by_pose;
    by_pose << -middle.normalized().transpose() * cross_matrix(from_corner), middle.normalized().transpose();
    return {.median_px = median(sizes),
            .rms_px = rms_of(sizes),
            .max_px = sizes.empty() ? 0.0 : *std::ranges::max_element(sizes),
            .used = static_cast<int>(sizes.size()),
            .left_out = left_out_[k],
            .distance_mm = middle.norm(),
            .distance_sd_mm = std::sqrt((by_pose * covariance * by_pose.transpose())(0, 0)),
            .tilt_deg = kDegree * std::acos(std::clamp(pose.rotation(2, 2), -1.0, 1.0)),
            .turn_sd_deg = kDegree * std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3.0)};
  }

  void put_camera(v1::CameraGeometry& camera) const {
    const auto& lens = problem_.lens;
    camera.set_width_px(width_px_);
    camera.set_height_px(height_px_);
    camera.set_fx_px(lens[kFx]);
    camera.set_fy_px(lens[kFy]);
    camera.set_cx_px(lens[kCx]);
    camera.set_cy_px(lens[kCy]);
    camera.set_k1(lens[kK1]);
    camera.set_k2(lens[kK2]);
    camera.set_p1(lens[kP1]);
    camera.set_p2(lens[kP2]);
    camera.set_k3(lens[kK3]);
    for (const double sd : lens_sd_) camera.add_sd(sd);
    const Eigen::Matrix<double, kLensNumbers, kLensNumbers> covariance =
        covariance_.topLeftCorner<kLensNumbers, kLensNumbers>();
    for (const double value : covariance.reshaped()) camera.add_covariance(value);
  }

  void put_pose(size_t k, const PoseFit& fit, v1::MonitorPose& pose) const {
    pose.set_name(views_[k].session);
    pose.set_monitor(views_[k].monitor);
    pose.set_width_px(views_[k].width_px);
    pose.set_height_px(views_[k].height_px);
    pose.set_pitch_mm(pitch_mm_[k]);
    const Matrix3d across = problem_.poses[k].rotation.transpose();  // row by row
    for (const double value : across.reshaped()) pose.add_rotation(value);
    for (const double value : problem_.poses[k].translation_mm) pose.add_translation_mm(value);
    const Eigen::Matrix<double, 6, 6> covariance = pose_covariance(k);
    for (const double value : covariance.reshaped()) pose.add_covariance(value);
    pose.set_residual_px(fit.rms_px);
    if (views_[k].rail_mm) pose.set_rail_mm(*views_[k].rail_mm);
  }

  std::vector<std::string> warnings(const GeometryFit& fit) const {
    std::vector<std::string> warnings;
    const auto add = [&](std::string warning) {
      if (!warning.empty()) warnings.push_back(std::move(warning));
    };
    add(weak_tilt(tilt_spread(normals())));
    if (views_.size() < kFewPoses)
      add(fmt::format("there are {} poses; six or more would test the lens model", views_.size()));
    std::vector<Vector2d> seen;
    for (const SeenPoint& point : problem_.points) seen.push_back(point.pixel);
    if (const std::string parts = uncovered_parts(width_px_, height_px_, seen); !parts.empty()) {
      add(fmt::format("no pose covers these parts of the picture: {}; the lens is extrapolated there",
                      parts));
    }
    const double focal_error =
        std::max(lens_sd_[kFx] / problem_.lens[kFx], lens_sd_[kFy] / problem_.lens[kFy]);
    if (focal_error > kWarnFocalError)
      add(fmt::format("the focal length is known only to {:.1f} %, and so are all distances",
                      100.0 * focal_error));
    if (fit.rms_px > kWarnRms_px) {
      add(fmt::format(
          "points are off by {:.2f} px (rms): the bars may be too coarse, the monitor not flat, its "
          "pitch wrong, or the camera moved during a pose",
          fit.rms_px));
    }
    std::vector<double> each_px;
    for (const PoseFit& pose : fit.poses) each_px.push_back(pose.rms_px);
    const double usual_px = median(std::move(each_px));
    for (size_t k = 0; k < fit.poses.size(); ++k) {
      const PoseFit& pose = fit.poses[k];
      if (pose.rms_px > kWorsePose * usual_px)
        add(fmt::format("pose \"{}\" is off by {:.2f} px (rms), the typical one by {:.2f}", views_[k].session,
                        pose.rms_px, usual_px));
      if (pose.left_out > kWarnLeftOut * (pose.used + pose.left_out)) {
        add(fmt::format("{} of {} points of pose \"{}\" are outliers and do not count", pose.left_out,
                        pose.used + pose.left_out, views_[k].session));
      }
    }
    return warnings;
  }

  const int width_px_, height_px_;
  const std::span<const MonitorView> views_;
  const std::vector<double> pitch_mm_;
  const PictureScale picture_;
  Reprojection problem_;
  ReprojectionFit fit_;
  MatrixXd covariance_;  // of the lens, then of the poses
  std::array<double, kLensNumbers> lens_sd_{};
  // By view. Without standard errors its points lie on one smooth map, and share its errors of the order of
  // kMapSd_px: together they count as kMapPoints.
  std::vector<bool> smooth_;
  std::vector<double> scale_px_;    // of its points' standard deviations
  std::vector<double> scatter_sd_;  // of its residuals, in units of these
  std::vector<int> left_out_;
};

}  // namespace

absl::StatusOr<GeometryFit> fit_geometry(int width_px, int height_px, std::span<const MonitorView> views,
                                         std::span<const double> pitch_mm) {
  std::set<std::pair<std::string, std::string>> names;
  for (const MonitorView& view : views) {
    if (!names.emplace(view.session, view.monitor).second) {
      return absl::InvalidArgumentError(
          fmt::format("two mattes are from session \"{}\"; each pose needs its own session", view.session));
    }
  }
  if (views.size() < kMinViews) {
    return absl::InvalidArgumentError(fmt::format(
        "there {} {} {}; a lens needs at least {}, turned against each other, and six or more are better",
        views.size() == 1 ? "is" : "are", views.size(), views.size() == 1 ? "pose" : "poses", kMinViews));
  }
  return GeometryFitter(width_px, height_px, views, pitch_mm).run();
}

}  // namespace glasswing
