#include "solver/ramp/ramp_smoother_pilot.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "solver/ramp/for_rows.h"

namespace glasswing {
namespace {

constexpr float kLeastRhoSd = 1e-6f;

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

// By least squares over some of the pixels off the object; zeros if there are too few.
std::array<float, 6> straight_of(const RampFrame& frame) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
  int count = 0;
  const int step = std::max(1, frame.width_px / 64);
  for (int y = 0; y < frame.height_px; y += step) {
    for (int x = 0; x < frame.width_px; x += step) {
      const size_t i = static_cast<size_t>(y) * static_cast<size_t>(frame.width_px) + static_cast<size_t>(x);
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

void take_row(const RampFrame& frame, int y, SmoothPilot& pilot) {
  SmoothSamples& samples = pilot.samples;
  const std::array<float, 6>& s = pilot.straight;
  for (int x = 0; x < pilot.area.width; ++x) {
    const int column = pilot.area.x0 + x, row = pilot.area.y0 + y;
    const size_t from =
        static_cast<size_t>(row) * static_cast<size_t>(frame.width_px) + static_cast<size_t>(column);
    const size_t to = pilot.area.at(x, y);
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

void resize(SmoothState& state, size_t size) {
  for (auto* planes : {&state.value, &state.across, &state.down}) {
    for (Plane& plane : *planes) plane.resize(size);
  }
  for (Plane* plane : {&state.info, &state.count, &state.tightness}) plane->resize(size);
}

}  // namespace

void widen(const SmoothArea& area, const SmoothSamples& samples, float rho_info, int radius_px,
           int thread_count, const SmoothState& before, SmoothState& after) {
  resize(after, area.size());
  const internal::SmoothStep step{.area = area,
                                  .radius = radius_px,
                                  .rho_info = rho_info,
                                  .samples = &samples,
                                  .before = &before,
                                  .after = &after};
  for_rows(area.height, thread_count, [&](int first, int last) { smooth_rows(step, first, last); });
}

SmoothPilot make_pilot(const RampFrame& frame, int thread_count) {
  SmoothPilot pilot;
  pilot.area = area_of(frame);
  pilot.straight = straight_of(frame);
  const float rho_sd = std::max(frame.rho_sd, kLeastRhoSd);
  pilot.rho_info = 1.0f / (rho_sd * rho_sd);
  SmoothSamples& samples = pilot.samples;
  const size_t size = pilot.area.size();
  for (Plane* plane :
       {&samples.value[0], &samples.value[1], &samples.value[2], &samples.info, &samples.object})
    plane->resize(size);
  for_rows(pilot.area.height, thread_count, [&](int first, int last) {
    for (int y = first; y < last; ++y) take_row(frame, y, pilot);
  });
  SmoothState raw, narrow;
  resize(raw, size);
  raw.value = samples.value;
  raw.info = samples.info;
  for (size_t i = 0; i < size; ++i) raw.count[i] = samples.info[i] > 0.0f ? 1.0f : 0.0f;
  widen(pilot.area, samples, pilot.rho_info, 1, thread_count, raw, narrow);
  widen(pilot.area, samples, pilot.rho_info, 2, thread_count, narrow, pilot.state);
  return pilot;
}

}  // namespace glasswing
