#include "core/axis/axis_module.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <ceres/rotation.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/axis/board_module.h"
#include "core/geometry/least_squares.h"

namespace glasswing {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

// Of a position: tip about two axes across the stage's, turn about it (rad), shift (mm).
constexpr int kDeviations = 6;
constexpr int kAxisNumbers = 4;   // the axis's tip and shift across itself
constexpr int kBoardNumbers = 6;  // rotation about the camera's axes, translation
// A table's bearing makes the axis tip and shift periodically: sums of vectors across it that rotate this
// often in a turn. Once is the board's own tip and shift, never is the axis's. Of each tip and shift, along
// and ahead of it.
constexpr std::array<int, 4> kHarmonics{-2, -1, 2, 3};
constexpr int kWobbleNumbers = 4 * static_cast<int>(kHarmonics.size());

// What has a standard deviation in common, and which is negligible.
enum Kind { kTip, kTurn, kShift, kWobble, kRunout, kKinds };
constexpr std::array<double, kKinds> kNegligible{1e-6, 1e-6, 1e-4, 1e-6, 1e-4};
constexpr std::array<Kind, kDeviations> kOfDeviation{kTip, kTip, kTurn, kShift, kShift, kShift};
Kind kind_of_wobble(int number) {
  return number % 4 < 2 ? kWobble : kRunout;
}

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
  Vector3d turned_mm;  // by the board's rotation
  double position_rad, sd_px;
  Frame frame;

  template <typename T>
  bool operator()(const T* lens, const T* axis, const T* wobble, const T* board, const T* deviation,
                  T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Vector direction =
        (frame.direction.cast<T>() + axis[0] * frame.across_x.cast<T>() + axis[1] * frame.across_y.cast<T>())
            .normalized();
    const Vector point =
        frame.point_mm.cast<T>() + axis[2] * frame.across_x.cast<T>() + axis[3] * frame.across_y.cast<T>();
    Vector from = turned_mm.cast<T>(), to;
    ceres::AngleAxisRotatePoint(board, from.data(), to.data());
    to += Eigen::Map<const Vector>(board + 3) - point;
    const Vector turn = T(position_rad) * direction;
    ceres::AngleAxisRotatePoint(turn.data(), to.data(), from.data());
    std::array<T, 4> across{deviation[0], deviation[1], T(0.0), T(0.0)};  // tip, shift
    for (size_t k = 0; k < kHarmonics.size(); ++k) {
      const double c = std::cos(kHarmonics[k] * position_rad), s = std::sin(kHarmonics[k] * position_rad);
      for (size_t i = 0; i < 4; i += 2) {
        across[i] += c * wobble[4 * k + i] - s * wobble[4 * k + i + 1];
        across[i + 1] += s * wobble[4 * k + i] + c * wobble[4 * k + i + 1];
      }
    }
    const Vector tip = across[0] * frame.across_x.cast<T>() + across[1] * frame.across_y.cast<T>() +
                       deviation[2] * frame.direction.cast<T>();
    ceres::AngleAxisRotatePoint(tip.data(), from.data(), to.data());
    to += point + across[2] * frame.across_x.cast<T>() + across[3] * frame.across_y.cast<T>() +
          Eigen::Map<const Vector>(deviation + 3);
    if (!(to[2] > T(0.0))) return false;
    T at[2];
    lens_pixel(lens, T(to[0] / to[2]), T(to[1] / to[2]), at);
    residual[0] = (at[0] - pixel.x()) / sd_px;
    residual[1] = (at[1] - pixel.y()) / sd_px;
    return true;
  }
};

// Numbers drawn from normal distributions around 0.
template <int kCount>
struct Drawn {
  std::array<double, kCount> sd;
  template <typename T>
  bool operator()(const T* numbers, T* residual) const {
    for (int i = 0; i < kCount; ++i) residual[i] = numbers[i] / sd[i];
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
    for (int i = 0; i < kWobbleNumbers; ++i) kinds_.push_back(kind_of_wobble(i));
    for (size_t i = 0; i < deviations_.size(); ++i)
      kinds_.insert(kinds_.end(), kOfDeviation.begin(), kOfDeviation.end());
    for (int i = 0; i < static_cast<int>(kLensNumbers); ++i)
      (problem.lens_covariance(i, i) > 0.0 ? free_ : held_).push_back(i);
    lens_information_ = problem.lens_covariance(free_, free_).inverse();
  }

  AxisSolution run() {
    constexpr int kRounds = 6;
    constexpr double kEnd = 1e-2;  // of the standard deviations
    for (int round = 0; round < kRounds; ++round) {
      solve();
      const auto before = sds_;
      const double pixel_before = solution_.pixel_sd;
      estimate();
      double change = std::abs(solution_.pixel_sd / pixel_before - 1.0);
      for (int k = 0; k < kKinds; ++k)
        change = std::max(change, std::abs(sds_[k] - before[k]) / std::max(before[k], kNegligible[k]));
      if (change < kEnd) break;
    }
    return solution();
  }

 private:
  // With the standard deviations as they are.
  void solve() {
    frame_ = frame_of(problem_.direction, problem_.point_mm);
    std::array<double, kAxisNumbers> axis{};
    std::vector<std::array<double, kBoardNumbers>> boards(problem_.boards.size());
    for (size_t b = 0; b < boards.size(); ++b)
      std::copy_n(problem_.boards[b].translation_mm.data(), 3, boards[b].data() + 3);
    ceres::Problem ceres;
    std::vector<ceres::ResidualBlockId> seen;
    for (const AxisProblem::Point& point : problem_.points) {
      seen.push_back(ceres.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Seen, 2, kLensNumbers, kAxisNumbers, kWobbleNumbers, kBoardNumbers,
                                          kDeviations>(
              new Seen{point.pixel, problem_.boards[point.board].rotation * point.at_mm,
                       problem_.positions_rad[point.position], solution_.pixel_sd, frame_}),
          problem_.huber_sd > 0.0 ? new ceres::HuberLoss(problem_.huber_sd) : nullptr, problem_.lens.data(),
          axis.data(), wobble_.data(), boards[point.board].data(), deviations_[point.position].data()));
    }
    for (auto& deviation : deviations_) {
      Drawn<kDeviations> drawn{};
      for (int d = 0; d < kDeviations; ++d) drawn.sd[d] = sds_[kOfDeviation[d]];
      ceres.AddResidualBlock(new ceres::AutoDiffCostFunction<Drawn<kDeviations>, kDeviations, kDeviations>(
                                 new Drawn<kDeviations>(drawn)),
                             nullptr, deviation.data());
    }
    Drawn<kWobbleNumbers> drawn{};
    for (int i = 0; i < kWobbleNumbers; ++i) drawn.sd[i] = sds_[kind_of_wobble(i)];
    ceres.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Drawn<kWobbleNumbers>, kWobbleNumbers, kWobbleNumbers>(
            new Drawn<kWobbleNumbers>(drawn)),
        nullptr, wobble_.data());
    add_lens(ceres);
    solution_.converged = solve_least_squares(ceres);
    read(ceres, seen, axis.data(), boards);
    problem_.direction =
        (frame_.direction + axis[0] * frame_.across_x + axis[1] * frame_.across_y).normalized();
    problem_.point_mm += axis[2] * frame_.across_x + axis[3] * frame_.across_y;
    for (size_t b = 0; b < boards.size(); ++b) {
      const Eigen::Map<const Vector3d> turn(boards[b].data()), translation(boards[b].data() + 3);
      if (turn.norm() > 0.0)
        problem_.boards[b].rotation =
            Eigen::AngleAxisd(turn.norm(), turn.normalized()) * problem_.boards[b].rotation;
      problem_.boards[b].translation_mm = translation;
    }
  }

  // The lens varies within its covariance.
  void add_lens(ceres::Problem& ceres) {
    if (free_.empty()) {
      ceres.SetParameterBlockConstant(problem_.lens.data());
      return;
    }
    MatrixXd root = MatrixXd::Zero(static_cast<Eigen::Index>(free_.size()), kLensNumbers);
    const MatrixXd factor = lens_information_.llt().matrixU();
    for (size_t i = 0; i < free_.size(); ++i) root.col(free_[i]) = factor.col(static_cast<Eigen::Index>(i));
    ceres.AddResidualBlock(
        new ceres::NormalPrior(root, Eigen::Map<const Eigen::VectorXd>(start_.data(), kLensNumbers)), nullptr,
        problem_.lens.data());
    if (!held_.empty())
      ceres.SetManifold(problem_.lens.data(),
                        new ceres::SubsetManifold(static_cast<int>(kLensNumbers), held_));
  }

  // The residuals at the solution, and the points' normal equations there: those of the numbers x = (axis,
  // boards, wobble, deviations, lens), with the lens relative to its start.
  void read(ceres::Problem& ceres, const std::vector<ceres::ResidualBlockId>& seen, double* axis,
            std::vector<std::array<double, kBoardNumbers>>& boards) {
    ceres::Problem::EvaluateOptions options;
    options.apply_loss_function = problem_.huber_sd > 0.0;
    options.residual_blocks = seen;
    options.parameter_blocks = {axis};
    for (auto& board : boards) options.parameter_blocks.push_back(board.data());
    options.parameter_blocks.push_back(wobble_.data());
    for (auto& deviation : deviations_) options.parameter_blocks.push_back(deviation.data());
    if (!free_.empty()) options.parameter_blocks.push_back(problem_.lens.data());
    std::vector<double> residuals;
    ceres::CRSMatrix sparse;
    ceres.Evaluate(options, nullptr, &residuals, nullptr, &sparse);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(sparse.num_cols);
    std::ranges::copy(wobble_, x.data() + drawn_at());
    for (size_t i = 0; i < deviations_.size(); ++i)
      std::ranges::copy(deviations_[i], x.data() + drawn_at() + kWobbleNumbers + kDeviations * i);
    for (size_t i = 0; i < free_.size(); ++i)
      x[drawn_at() + static_cast<int>(kinds_.size() + i)] = problem_.lens[free_[i]] - start_[free_[i]];
    information_ = MatrixXd::Zero(sparse.num_cols, sparse.num_cols);
    pull_ = Eigen::VectorXd::Zero(sparse.num_cols);
    squares_ = 0.0;
    const double sd_px = solution_.pixel_sd;
    for (int row = 0; row < sparse.num_rows; ++row) {
      double at_zero = residuals[row] * sd_px;
      for (int i = sparse.rows[row]; i < sparse.rows[row + 1]; ++i) {
        at_zero -= sd_px * sparse.values[i] * x[sparse.cols[i]];
        for (int j = sparse.rows[row]; j < sparse.rows[row + 1]; ++j)
          information_(sparse.cols[i], sparse.cols[j]) += sd_px * sd_px * sparse.values[i] * sparse.values[j];
      }
      squares_ += at_zero * at_zero;
      for (int i = sparse.rows[row]; i < sparse.rows[row + 1]; ++i)
        pull_[sparse.cols[i]] -= sd_px * sparse.values[i] * at_zero;
    }
    solution_.residuals_px.resize(problem_.points.size());
    for (size_t i = 0; i < problem_.points.size(); ++i)
      solution_.residuals_px[i] = sd_px * Eigen::Vector2d(residuals[2 * i], residuals[2 * i + 1]);
  }

  // x at the least sum of squares of the linear problem, and its covariance, with the standard deviations as
  // they are.
  Eigen::VectorXd solve_linear() {
    MatrixXd total = information_ / (solution_.pixel_sd * solution_.pixel_sd);
    for (size_t i = 0; i < kinds_.size(); ++i) {
      const auto at = drawn_at() + static_cast<Eigen::Index>(i);
      total(at, at) += 1.0 / (sds_[kinds_[i]] * sds_[kinds_[i]]);
    }
    const auto lens = static_cast<Eigen::Index>(free_.size());
    if (lens > 0) total.bottomRightCorner(lens, lens) += lens_information_;
    // Scaled, since radians and millimetres differ by orders of magnitude.
    const Eigen::VectorXd scale = total.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = scale.asDiagonal() * total * scale.asDiagonal();
    covariance_ = scale.asDiagonal() * scaled.llt().solve(MatrixXd::Identity(scaled.rows(), scaled.cols())) *
                  scale.asDiagonal();
    return covariance_ * pull_ / (solution_.pixel_sd * solution_.pixel_sd);
  }

  // The standard deviations, by MacKay's fixed point: the sum of squares divided by the number of values that
  // the data determine.
  void estimate() {
    constexpr int kRounds = 30;
    constexpr double kEnd = 1e-3, kMinPixel_sd = 1e-6;
    for (int round = 0; round < kRounds; ++round) {
      const Eigen::VectorXd x = solve_linear();
      std::array<double, kKinds> sums{}, counts{};
      for (size_t i = 0; i < kinds_.size(); ++i) {
        const auto at = drawn_at() + static_cast<Eigen::Index>(i);
        sums[kinds_[i]] += x[at] * x[at];
        counts[kinds_[i]] += 1.0 - covariance_(at, at) / (sds_[kinds_[i]] * sds_[kinds_[i]]);
      }
      double change = 0.0, determined = 0.0;
      for (int k = 0; k < kKinds; ++k) {
        determined += std::max(counts[k], 0.0);
        const double next = std::max(std::sqrt(sums[k] / std::max(counts[k], 1e-9)), 1e-2 * kNegligible[k]);
        change = std::max(change, std::abs(next - sds_[k]) / std::max(sds_[k], kNegligible[k]));
        sds_[k] = next;
      }
      const double squares = squares_ - 2.0 * pull_.dot(x) + x.dot(information_ * x);
      const double count = 2.0 * static_cast<double>(problem_.points.size()) - drawn_at() - determined;
      const double next = std::max(std::sqrt(std::max(squares, 0.0) / std::max(count, 1.0)), kMinPixel_sd);
      change = std::max(change, std::abs(next / solution_.pixel_sd - 1.0));
      solution_.pixel_sd = next;
      if (change < kEnd) break;
    }
    solve_linear();
  }

  int drawn_at() const { return kAxisNumbers + kBoardNumbers * static_cast<int>(problem_.boards.size()); }

  AxisSolution solution() {
    Eigen::Matrix<double, 6, kAxisNumbers> across = Eigen::Matrix<double, 6, kAxisNumbers>::Zero();
    across.block<3, 1>(0, 0) = across.block<3, 1>(3, 2) = frame_.across_x;
    across.block<3, 1>(0, 1) = across.block<3, 1>(3, 3) = frame_.across_y;
    solution_.covariance =
        across * covariance_.topLeftCorner<kAxisNumbers, kAxisNumbers>() * across.transpose();
    solution_.tip_sd_rad = sds_[kTip];
    solution_.turn_sd_rad = sds_[kTurn];
    solution_.shift_sd_mm = sds_[kShift];
    double tips = 0.0, shifts = 0.0;
    for (int i = 0; i < kWobbleNumbers; ++i)
      (kind_of_wobble(i) == kWobble ? tips : shifts) += wobble_[i] * wobble_[i];
    solution_.wobble_sd_rad = std::sqrt(tips);
    solution_.runout_sd_mm = std::sqrt(shifts);
    return solution_;
  }

  AxisProblem& problem_;
  std::vector<std::array<double, kDeviations>> deviations_;
  const std::array<double, kLensNumbers> start_;
  std::vector<int> free_, held_;  // of the lens
  MatrixXd lens_information_;     // of free_
  Frame frame_;
  MatrixXd information_, covariance_;
  Eigen::VectorXd pull_;
  double squares_ = 0.0;  // of the residuals at x = 0, px^2
  std::array<double, kWobbleNumbers> wobble_{};
  std::vector<Kind> kinds_;  // of the numbers that are drawn: wobble_, then deviations_
  std::array<double, kKinds> sds_{1e-3, 1e-3, 0.1, 1e-3, 0.1};
  AxisSolution solution_{.covariance = {}, .pixel_sd = 0.1, .residuals_px = {}};
};

AxisSolution fit(AxisProblem& problem) {
  return Fit(problem).run();
}

}  // namespace
}  // namespace glasswing

extern "C" const glasswing::AxisModule glasswing_axis_module;
const glasswing::AxisModule glasswing_axis_module{.fit = glasswing::fit,
                                                  .pose = glasswing::axis_module_parts::pose,
                                                  .find_corners = glasswing::axis_module_parts::find_corners};
