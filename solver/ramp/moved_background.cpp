#include "solver/ramp/moved_background.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/median.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr double kMinRamp = 0.02;     // as a share of the empty stage's light
constexpr double kMaxOfFrame = 0.9;   // an object that covers less leaves enough background
constexpr double kMaxShift_px = 1.0;  // camera px, and at least five standard errors
constexpr double kAlike = 0.7;  // share of alike pixels: no object leaves its background that undistorted
constexpr float kSamePlace_px = 1.0f, kSameRho = 0.03f;
constexpr size_t kMaxSampledPixels = 20'000;  // sampled; enough for a mean
constexpr size_t kMaxOfMean = 2'000;

size_t step_of(const RampStage& stage, size_t most) {
  return stage.behind.size() / most + 1;
}

// The common motion of pixels off the object, none of which shows a change by itself.
absl::Status check_surroundings(const RampStage& stage, const RampLight& light, const RampFrame& frame) {
  constexpr int kArm_px = 4;  // for the slope of the average
  const size_t row = stage.width_px;
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sums = Eigen::Vector3d::Zero();
  double rest = 0.0, count = 0.0;
  const size_t step = step_of(stage, kMaxSampledPixels);
  for (size_t i = 0; i < stage.behind.size(); i += step) {
    const auto x = static_cast<int>(i % row), y = static_cast<int>(i / row);
    if (x < kArm_px || x >= stage.width_px - kArm_px || y < kArm_px || y >= stage.height_px - kArm_px)
      continue;
    const std::array<size_t, 5> cross{i, i - kArm_px, i + kArm_px, i - kArm_px * row, i + kArm_px * row};
    const bool background = std::ranges::all_of(
        cross, [&](size_t at) { return stage.behind[at] == Behind::kRamp && frame.alpha[at] == 0.0f; });
    if (!background) continue;
    for (size_t c = 0; c < 3; ++c) {
      const auto empty = [&](size_t arm) { return static_cast<double>(stage.average[3 * cross[arm] + c]); };
      const Eigen::Vector3d along((empty(1) - empty(2)) / (2 * kArm_px),
                                  (empty(3) - empty(4)) / (2 * kArm_px), empty(0));
      const double difference = light[3 * i + c] - empty(0);
      squares += along * along.transpose();
      sums += along * difference;
      rest += difference * difference;
      count += 1.0;
    }
  }
  if (count < 300.0) return absl::OkStatus();
  const Eigen::Matrix3d inverse = squares.inverse();
  const Eigen::Vector3d moved = inverse * sums;
  if (!moved.allFinite()) return absl::OkStatus();
  const double variance = std::max(rest - moved.dot(sums), 0.0) / count;
  const double error_px = std::sqrt(variance * (inverse(0, 0) + inverse(1, 1)));
  if (std::hypot(moved[0], moved[1]) < kMaxShift_px + 5.0 * error_px) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format(
      "the background moved by {:+.1f} {:+.1f} px since the empty stage was captured", moved[0], moved[1]));
}

}  // namespace

absl::Status check_shows_ramp(const RampStage& stage, const RampLight& light) {
  double seen = 0.0, empty = 0.0;
  const size_t step = step_of(stage, kMaxOfMean);
  for (size_t i = 0; i < stage.behind.size(); i += step) {
    if (stage.behind[i] != Behind::kRamp) continue;
    for (size_t c = 0; c < 3; ++c) {
      seen += static_cast<double>(light[3 * i + c]);
      empty += static_cast<double>(stage.average[3 * i + c]);
    }
  }
  if (seen > kMinRamp * empty) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("the frame does not show the ramp: it has {:.1f} % of the empty stage's light",
                  100.0 * std::max(seen, 0.0) / empty));
}

absl::Status check_background_stands(const RampStage& stage, const RampLight& light, const RampFrame& frame) {
  GW_RETURN_IF_ERROR(check_surroundings(stage, light, frame));
  size_t ramp = 0, changed = 0;
  const size_t step = step_of(stage, kMaxSampledPixels);
  for (size_t i = 0; i < stage.behind.size(); i += step) {
    if (stage.behind[i] != Behind::kRamp) continue;
    ++ramp;
    if (frame.alpha[i] > 0.0f) ++changed;
  }
  if (static_cast<double>(changed) < kMaxOfFrame * static_cast<double>(ramp)) return absl::OkStatus();
  std::vector<float> dx_px, dy_px, rho, sd_px;
  for (size_t i = 0; i < stage.behind.size(); i += step) {
    if (stage.behind[i] != Behind::kRamp || frame.alpha[i] == 0.0f) continue;
    if (!(frame.info_xx[i] > 0.0f && frame.info_yy[i] > 0.0f)) continue;
    dx_px.push_back(frame.x_px[i] - stage.x_px[i]);
    dy_px.push_back(frame.y_px[i] - stage.y_px[i]);
    rho.push_back(frame.rho[i]);
    sd_px.push_back(1.0f / std::sqrt(std::min(frame.info_xx[i], frame.info_yy[i])));
  }
  if (rho.empty()) return absl::OkStatus();
  const float x = median(dx_px), y = median(dy_px), bright = median(rho);
  size_t alike = 0;
  for (size_t i = 0; i < rho.size(); ++i) {
    // Noise moves positions by sd, and rho by about that sd as a share of the monitor.
    const float near_px = kSamePlace_px + 3.0f * sd_px[i];
    const float near_rho = kSameRho + 3.0f * sd_px[i] / static_cast<float>(stage.monitor.width_px());
    if (std::hypot(dx_px[i] - x, dy_px[i] - y) < near_px && std::abs(rho[i] - bright) < near_rho) ++alike;
  }
  if (static_cast<double>(alike) < kAlike * static_cast<double>(changed)) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format(
      "the background is not that of the empty stage: {:.0f} % of it is moved by {:+.1f} {:+.1f} px of the "
      "monitor and {:.2f} times as bright; camera and monitor must stay as they were, or the empty stage be "
      "captured again",
      100.0 * static_cast<double>(changed) / static_cast<double>(ramp), static_cast<double>(x),
      static_cast<double>(y), static_cast<double>(bright)));
}

}  // namespace glasswing
