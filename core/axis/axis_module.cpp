#include "core/axis/axis_module.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <ceres/rotation.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/axis/board_module.h"

namespace glasswing {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

// Of a position: tip about two axes across the stage's, turn about it (rad), shift (mm).
constexpr int kDeviations = 6;
constexpr int kAxisNumbers = 4;    // the axis's tip and shift across itself
constexpr int kObjectNumbers = 6;  // rotation about the camera's axes, translation

// What deviations have in common: the same standard deviation.
struct Kind {
  int first, count;  // of a position's deviations
  double min_sd;     // less has no effect: 1e-6 of what could be seen
};
constexpr std::array<Kind, 3> kKinds{{{0, 2, 1e-8}, {2, 1, 1e-8}, {3, 3, 1e-6}}};

// An axis as it was at the start of a step, with two directions across it.
struct Frame {
  Vector3d direction, point_mm, across_x, across_y;
};

Frame frame_of(const Vector3d& direction, const Vector3d& point_mm) {
  const Vector3d across = direction.unitOrthogonal();
  return {direction, point_mm, across, direction.cross(across)};
}

struct Seen {
  Eigen::Vector2d pixel;
  Vector3d turned_mm;  // by the object's rotation
  double position_rad, sd_px;
  Frame frame;

  template <typename T>
  bool operator()(const T* lens, const T* axis, const T* object, const T* deviation, T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Vector direction = (frame.direction.cast<T>() + axis[0] * frame.across_x.cast<T>() +
                              axis[1] * frame.across_y.cast<T>())
                                 .normalized();
    const Vector point =
        frame.point_mm.cast<T>() + axis[2] * frame.across_x.cast<T>() + axis[3] * frame.across_y.cast<T>();
    Vector from = turned_mm.cast<T>(), to;
    ceres::AngleAxisRotatePoint(object, from.data(), to.data());
    to += Eigen::Map<const Vector>(object + 3) - point;
    const Vector turn = T(position_rad) * direction;
    ceres::AngleAxisRotatePoint(turn.data(), to.data(), from.data());
    const Vector wobble = deviation[0] * frame.across_x.cast<T>() + deviation[1] * frame.across_y.cast<T>() +
                          deviation[2] * frame.direction.cast<T>();
    ceres::AngleAxisRotatePoint(wobble.data(), from.data(), to.data());
    to += point + Eigen::Map<const Vector>(deviation + 3);
    if (!(to[2] > T(0.0))) return false;
    T at[2];
    lens_pixel(lens, T(to[0] / to[2]), T(to[1] / to[2]), at);
    residual[0] = (at[0] - pixel.x()) / sd_px;
    residual[1] = (at[1] - pixel.y()) / sd_px;
    return true;
  }
};

struct Deviation {
  std::array<double, kDeviations> sd;
  template <typename T>
  bool operator()(const T* deviation, T* residual) const {
    for (int i = 0; i < kDeviations; ++i) residual[i] = deviation[i] / sd[i];
    return true;
  }
};

class Fit {
 public:
  explicit Fit(AxisProblem& problem)
      : problem_(problem),
        deviations_(problem.positions_rad.size()),
        start_(problem.lens),
        frame_(frame_of(problem.direction, problem.point_mm)) {
    for (auto& deviation : deviations_) deviation.fill(0.0);
    for (size_t i = 0; i < kLensNumbers; ++i) {
      if (!(problem.lens_covariance(i, i) > 0.0)) held_.push_back(static_cast<int>(i));
    }
  }

  AxisSolution run() {
    constexpr int kRounds = 60;
    constexpr double kEnd = 1e-3;  // of the standard deviations
    for (int round = 0; round < kRounds; ++round) {
      solve();
      if (estimate() < kEnd && round > 0) break;
    }
    return solution();
  }

 private:
  // With the standard deviations as they are.
  void solve() {
    frame_ = frame_of(problem_.direction, problem_.point_mm);
    std::array<double, kAxisNumbers> axis{};
    std::array<double, kObjectNumbers> object{};
    Eigen::Map<Vector3d> translation(object.data() + 3);
    translation = problem_.object.translation_mm;
    ceres::Problem ceres;
    for (const AxisProblem::Point& point : problem_.points) {
      ceres.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Seen, 2, kLensNumbers, kAxisNumbers, kObjectNumbers, kDeviations>(
              new Seen{point.pixel, problem_.object.rotation * point.at_mm,
                       problem_.positions_rad[point.position], solution_.pixel_sd, frame_}),
          problem_.huber_sd > 0.0 ? new ceres::HuberLoss(problem_.huber_sd) : nullptr, problem_.lens.data(),
          axis.data(), object.data(), deviations_[point.position].data());
    }
    for (auto& deviation : deviations_) {
      ceres.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Deviation, kDeviations, kDeviations>(new Deviation{sd()}), nullptr,
          deviation.data());
    }
    add_lens(ceres);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 50;
    options.function_tolerance = 1e-10;
    options.parameter_tolerance = 1e-10;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &ceres, &summary);
    solution_.converged = summary.termination_type == ceres::CONVERGENCE;
    read(ceres, axis.data(), object.data());
    problem_.direction = (frame_.direction + axis[0] * frame_.across_x + axis[1] * frame_.across_y).normalized();
    problem_.point_mm += axis[2] * frame_.across_x + axis[3] * frame_.across_y;
    const Vector3d turn = Eigen::Map<const Vector3d>(object.data());
    if (turn.norm() > 0.0)
      problem_.object.rotation =
          Eigen::AngleAxisd(turn.norm(), turn.normalized()) * problem_.object.rotation;
    problem_.object.translation_mm = translation;
  }

  // The lens varies within its covariance.
  void add_lens(ceres::Problem& ceres) {
    if (held_.size() == kLensNumbers) {
      ceres.SetParameterBlockConstant(problem_.lens.data());
      return;
    }
    MatrixXd covariance = problem_.lens_covariance;
    for (const int i : held_) covariance(i, i) = 1.0;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> parts(covariance);
    MatrixXd root = parts.eigenvalues().cwiseMax(1e-30).cwiseSqrt().cwiseInverse().asDiagonal() *
                    parts.eigenvectors().transpose();
    ceres.AddResidualBlock(
        new ceres::NormalPrior(root, Eigen::Map<const Eigen::VectorXd>(start_.data(), kLensNumbers)), nullptr,
        problem_.lens.data());
    if (!held_.empty())
      ceres.SetManifold(problem_.lens.data(), new ceres::SubsetManifold(static_cast<int>(kLensNumbers), held_));
  }

  // The residuals and the covariance at the solution.
  void read(ceres::Problem& ceres, double* axis, double* object) {
    ceres::Problem::EvaluateOptions options;
    options.apply_loss_function = false;
    options.parameter_blocks = {axis, object};
    for (auto& deviation : deviations_) options.parameter_blocks.push_back(deviation.data());
    if (held_.size() < kLensNumbers) options.parameter_blocks.push_back(problem_.lens.data());
    std::vector<double> residuals;
    ceres::CRSMatrix sparse;
    ceres.Evaluate(options, nullptr, &residuals, nullptr, &sparse);
    MatrixXd information = MatrixXd::Zero(sparse.num_cols, sparse.num_cols);
    for (int row = 0; row < sparse.num_rows; ++row) {
      for (int i = sparse.rows[row]; i < sparse.rows[row + 1]; ++i) {
        for (int j = sparse.rows[row]; j < sparse.rows[row + 1]; ++j)
          information(sparse.cols[i], sparse.cols[j]) += sparse.values[i] * sparse.values[j];
      }
    }
    // Scaled, since radians and millimetres differ by orders of magnitude.
    const Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
    covariance_ = scale.asDiagonal() *
                  scaled.ldlt().solve(MatrixXd::Identity(scaled.rows(), scaled.cols())) * scale.asDiagonal();
    solution_.residuals_px.resize(problem_.points.size());
    for (size_t i = 0; i < problem_.points.size(); ++i)
      solution_.residuals_px[i] = solution_.pixel_sd * Eigen::Vector2d(residuals[2 * i], residuals[2 * i + 1]);
  }

  // The standard deviations from the solution, by MacKay's fixed point: the sum of squares divided by the number of
  // values that the data determine. Returns the largest relative change.
  double estimate() {
    double change = 0.0, determined = 0.0;
    const auto update = [&](double& sd, double squares, double count, double min_sd) {
      const double next = std::max(std::sqrt(squares / std::max(count, 0.5)), min_sd);
      change = std::max(change, std::abs(next - sd) / std::max(sd, 1e3 * min_sd));
      sd = next;
    };
    for (size_t k = 0; k < kKinds.size(); ++k) {
      const Kind& kind = kKinds[k];
      double squares = 0.0, count = 0.0;
      for (size_t i = 0; i < deviations_.size(); ++i) {
        for (int d = kind.first; d < kind.first + kind.count; ++d) {
          const int at = kAxisNumbers + kObjectNumbers + kDeviations * static_cast<int>(i) + d;
          squares += deviations_[i][d] * deviations_[i][d];
          count += 1.0 - covariance_(at, at) / (sds_[k] * sds_[k]);
        }
      }
      determined += std::max(count, 0.0);
      update(sds_[k], squares, count, kind.min_sd);
    }
    double squares = 0.0;
    for (const Eigen::Vector2d& residual : solution_.residuals_px) squares += residual.squaredNorm();
    update(solution_.pixel_sd, squares,
           2.0 * static_cast<double>(problem_.points.size()) - kAxisNumbers - kObjectNumbers - determined,
           1e-6);
    return change;
  }

  std::array<double, kDeviations> sd() const {
    return {sds_[0], sds_[0], sds_[1], sds_[2], sds_[2], sds_[2]};
  }

  AxisSolution solution() {
    Eigen::Matrix<double, 6, kAxisNumbers> across = Eigen::Matrix<double, 6, kAxisNumbers>::Zero();
    across.block<3, 1>(0, 0) = across.block<3, 1>(3, 2) = frame_.across_x;
    across.block<3, 1>(0, 1) = across.block<3, 1>(3, 3) = frame_.across_y;
    solution_.covariance =
        across * covariance_.topLeftCorner<kAxisNumbers, kAxisNumbers>() * across.transpose();
    solution_.tip_sd_rad = sds_[0];
    solution_.turn_sd_rad = sds_[1];
    solution_.shift_sd_mm = sds_[2];
    return solution_;
  }

  AxisProblem& problem_;
  std::vector<std::array<double, kDeviations>> deviations_;
  const std::array<double, kLensNumbers> start_;
  std::vector<int> held_;  // of the lens
  Frame frame_;
  MatrixXd covariance_;
  std::array<double, kKinds.size()> sds_{1e-3, 1e-3, 0.1};
  AxisSolution solution_{.covariance = {}, .pixel_sd = 0.1, .residuals_px = {}};
};

AxisSolution fit(AxisProblem& problem) { return Fit(problem).run(); }

}  // namespace
}  // namespace glasswing

extern "C" const glasswing::AxisModule glasswing_axis_module;
const glasswing::AxisModule glasswing_axis_module{.fit = glasswing::fit,
                                                  .pose = glasswing::axis_module_parts::pose,
                                                  .find_corners = glasswing::axis_module_parts::find_corners,
                                                  .draw = glasswing::axis_module_parts::draw};
