#include "solver/ramp/smoother/ramp_smoother_pilot.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "core/base/for_rows.h"

namespace glasswing {
namespace {

// Standard deviations by which rho may move.
constexpr float kMaxRho_sd = 3.0f;
constexpr float kMinRhoSd = 1e-6f;
// Pictures of this many pixels are smoothed at half resolution: the same windows then reach twice as far, at
// a quarter of the cost.
constexpr int kLarge_px = 300'000;

SmoothArea area_of(const RampFrame& frame) {
  int left = frame.width_px, right = -1, top = frame.height_px, bottom = -1;
  for (int y = 0; y < frame.height_px; ++y) {
    const auto row = frame.alpha.begin() + static_cast<std::ptrdiff_t>(y) * frame.width_px;
    const auto on = [](float alpha) { return alpha > 0.0f; };
    const auto first = std::find_if(row, row + frame.width_px, on);
    if (first == row + frame.width_px) continue;
    const auto last =
        std::find_if(std::make_reverse_iterator(row + frame.width_px), std::make_reverse_iterator(row), on);
    left = std::min(left, static_cast<int>(first - row));
    right = std::max(right, static_cast<int>(last.base() - row) - 1);
    top = std::min(top, y);
    bottom = y;
  }
  if (right < 0) return {};
  return {.x0 = left, .y0 = top, .width = right - left + 1, .height = bottom - top + 1};
}

// Fitted by least squares to some of the pixels off the object; zeros if there are too few.
std::array<float, 6> straight_of(const RampFrame& frame) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
  int count = 0;
  const int step = std::max(1, frame.width_px / 64);
  for (int y = 0; y < frame.height_px; y += step) {
    for (int x = 0; x < frame.width_px; x += step) {
      const size_t i = static_cast<size_t>(y) * frame.width_px + x;
      if (frame.alpha[i] > 0.0f) continue;
      const Eigen::Vector3d place(1.0, x, y);
      normal += place * place.transpose();
      right += place * Eigen::RowVector2d(frame.x_px[i], frame.y_px[i]);
      ++count;
    }
  }
  std::array<float, 6> straight{};
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  if (count < 16 || solver.rcond() < 1e-9) return straight;
  Eigen::Map<Eigen::Matrix<float, 3, 2>>(straight.data()) = solver.solve(right).cast<float>();
  return straight;
}

void take_row(const RampFrame& frame, const std::array<float, 6>& s, const SmoothArea& area, int y,
              SmoothSamples& samples) {
  const int width = std::min(area.width, frame.width_px - area.x0);
  for (int x = 0; x < width; ++x) {
    const int column = area.x0 + x, row = area.y0 + y;
    const size_t from = static_cast<size_t>(row) * frame.width_px + column;
    const size_t to = area.at(x, y);
    if (frame.alpha[from] <= 0.0f) continue;
    const auto fx = static_cast<float>(column), fy = static_cast<float>(row);
    samples.object[to] = 1.0f;
    samples.value[0][to] = frame.x_px[from] - (s[0] + s[1] * fx + s[2] * fy);
    samples.value[1][to] = frame.y_px[from] - (s[3] + s[4] * fx + s[5] * fy);
    samples.value[2][to] = frame.rho[from];
    // 1 / the mean variance of x and y
    const float xx = frame.info_xx[from], xy = frame.info_xy[from], yy = frame.info_yy[from];
    const float determinant = xx * yy - xy * xy;
    samples.info[to] = determinant > 0.0f ? 2.0f * determinant / (xx + yy) : 0.0f;
  }
}

SmoothSamples samples_of(const RampFrame& frame, const std::array<float, 6>& straight, const SmoothArea& area,
                         int thread_count) {
  SmoothSamples samples;
  resize(samples, area.size());
  const int height = std::min(area.height, frame.height_px - area.y0);
  for_rows(height, thread_count, [&](int first, int last) {
    for (int y = first; y < last; ++y) take_row(frame, straight, area, y, samples);
  });
  return samples;
}

// The area extended to even positions, if necessary beyond the picture.
SmoothArea even(const SmoothArea& area) {
  const int x0 = area.x0 / 2 * 2, y0 = area.y0 / 2 * 2;
  const auto up = [](int length) { return (length + 1) / 2 * 2; };
  return {
      .x0 = x0, .y0 = y0, .width = up(area.x0 + area.width - x0), .height = up(area.y0 + area.height - y0)};
}

// Means of 2 x 2 pixels weighted by their information. If one of them has none, neither does the mean, which
// would belong to another position.
void halve_row(const SmoothFine& fine, const SmoothArea& area, int y, SmoothSamples& samples) {
  for (int x = 0; x < area.width; ++x) {
    const size_t to = area.at(x, y), above = fine.area.at(2 * x, 2 * y), below = above + fine.area.stride();
    const std::array<size_t, 4> from{above, above + 1, below, below + 1};
    const SmoothSamples& all = fine.samples;
    float info = 0.0f, least = all.info[above];
    std::array<float, 3> sum{};
    for (const size_t i : from) {
      const float own = all.info[i];
      samples.object[to] = std::max(samples.object[to], all.object[i]);
      least = std::min(least, own);
      info += own;
      sum[0] += own * all.value[0][i];
      sum[1] += own * all.value[1][i];
      sum[2] += all.value[2][i];
    }
    if (least <= 0.0f) continue;
    samples.value[0][to] = sum[0] / info;
    samples.value[1][to] = sum[1] / info;
    samples.value[2][to] = 0.25f * sum[2];
    samples.info[to] = info;
  }
}

void halve(SmoothPilot& pilot, int thread_count) {
  const SmoothFine& fine =
      pilot.fine.emplace(SmoothFine{pilot.area, std::move(pilot.samples), pilot.rho_info});
  pilot.area = {.x0 = fine.area.x0 / 2,
                .y0 = fine.area.y0 / 2,
                .width = fine.area.width / 2,
                .height = fine.area.height / 2};
  pilot.rho_info = 4.0f * fine.rho_info;
  pilot.samples = {};
  resize(pilot.samples, pilot.area.size());
  for_rows(pilot.area.height, thread_count, [&](int first, int last) {
    for (int y = first; y < last; ++y) halve_row(fine, pilot.area, y, pilot.samples);
  });
}

// Copies row y of the area.
void put_row(const std::array<float, 6>& s, const SmoothArea& area, const SmoothSamples& samples,
             float rho_info, const SmoothState& state, int y, RampFrame& frame) {
  const float most = kMaxRho_sd * kMaxRho_sd / rho_info;
  for (int x = 0; x < area.width; ++x) {
    const size_t from = area.at(x, y);
    if (samples.object[from] == 0.0f || state.info[from] <= 0.0f) continue;
    const int column = area.x0 + x, row = area.y0 + y;
    const size_t to = static_cast<size_t>(row) * frame.width_px + column;
    if (frame.highlight[to] > 0.0f) continue;
    const auto fx = static_cast<float>(column), fy = static_cast<float>(row);
    frame.x_px[to] = state.value[0][from] + (s[0] + s[1] * fx + s[2] * fy);
    frame.y_px[to] = state.value[1][from] + (s[3] + s[4] * fx + s[5] * fy);
    if (samples.info[from] <= 0.0f) continue;
    const float moved = state.value[2][from] - frame.rho[to];
    if (moved * moved < most) frame.rho[to] = state.value[2][from];
  }
}

}  // namespace

void resize(SmoothSamples& samples, size_t size) {
  for (Plane& plane : samples.value) plane.resize(size);
  samples.info.resize(size);
  samples.object.resize(size);
}

void resize(SmoothState& state, size_t size) {
  for (auto* planes : {&state.value, &state.across, &state.down}) {
    for (Plane& plane : *planes) plane.resize(size);
  }
  for (Plane* plane : {&state.info, &state.count, &state.tightness}) plane->resize(size);
}

void put_rows(const std::array<float, 6>& straight, const SmoothArea& area, const SmoothSamples& samples,
              float rho_info, const SmoothState& state, int first, int last, RampFrame& frame) {
  for (int y = first; y < last; ++y) put_row(straight, area, samples, rho_info, state, y, frame);
}

void widen(const SmoothArea& area, const SmoothSamples& samples, float rho_info, int radius_px,
           int thread_count, const SmoothState* before, SmoothState& after) {
  resize(after, area.size());
  const internal::SmoothStep step{.area = area,
                                  .radius = radius_px,
                                  .rho_info = rho_info,
                                  .samples = &samples,
                                  .before = before,
                                  .after = &after};
  for_rows(area.height, thread_count, [&](int first, int last) { internal::smooth_rows(step, first, last); });
}

SmoothPilot make_pilot(const RampFrame& frame, int thread_count) {
  SmoothPilot pilot;
  const bool large = frame.width_px * frame.height_px >= kLarge_px;
  pilot.area = large ? even(area_of(frame)) : area_of(frame);
  pilot.straight = straight_of(frame);
  const float rho_sd = std::max(frame.rho_sd, kMinRhoSd);
  pilot.rho_info = 1.0f / (rho_sd * rho_sd);
  pilot.samples = samples_of(frame, pilot.straight, pilot.area, thread_count);
  if (large) halve(pilot, thread_count);
  SmoothState narrow;
  widen(pilot.area, pilot.samples, pilot.rho_info, 1, thread_count, nullptr, narrow);
  widen(pilot.area, pilot.samples, pilot.rho_info, 2, thread_count, &narrow, pilot.state);
  return pilot;
}

}  // namespace glasswing
