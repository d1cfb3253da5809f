#include "core/calibration/display_shading.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace glasswing {
namespace {

constexpr int kColumns = 16, kRows = 12;
constexpr int kMinCellPixels = 4;   // of a cell
constexpr double kOffRamp = 0.1;    // of blue's code, which u and v predict
constexpr double kBeyond = 0.03;    // of the screen's size, for noise at its edges
constexpr int kRelaxations = 2000;  // many times the longest path through the grid, squared

struct Cell {
  double light = 0.0;
  int pixels = 0;
  bool seen() const { return pixels >= kMinCellPixels; }
};

// The cell of the grid that a pixel sees; none if it does not see the ramp.
std::optional<size_t> cell_of(const Eigen::Vector3d& radiance, const DisplayResponse& response) {
  std::array<double, 3> code{};
  for (size_t p = 0; p < 3; ++p) {
    const ToneCurve& curve = response.primary[p].curve;
    code[p] = curve.code_for(radiance[p]) / curve.highest_code();
  }
  const double u = (code[0] - 0.1) / 0.8, v = (code[1] - 0.1) / 0.8;
  if (std::abs(code[2] - (0.9 - 0.4 * u - 0.4 * v)) > kOffRamp) return std::nullopt;
  if (std::abs(u - 0.5) > 0.5 + kBeyond || std::abs(v - 0.5) > 0.5 + kBeyond) return std::nullopt;
  const int column = std::clamp(static_cast<int>(std::floor(u * kColumns)), 0, kColumns - 1);
  const int row = std::clamp(static_cast<int>(std::floor(v * kRows)), 0, kRows - 1);
  return static_cast<size_t>(row * kColumns + column);
}

// Relaxes each unseen cell to the mean of its neighbours.
void fill(std::vector<Cell>& cells) {
  for (int pass = 0; pass < kRelaxations; ++pass) {
    for (int row = 0; row < kRows; ++row) {
      for (int column = 0; column < kColumns; ++column) {
        Cell& cell = cells[row * kColumns + column];
        if (cell.seen()) continue;
        double sum = 0.0, count = 0.0;
        for (const auto& [down, across] : {std::pair(-1, 0), {1, 0}, {0, -1}, {0, 1}}) {
          const int r = row + down, c = column + across;
          if (r < 0 || r >= kRows || c < 0 || c >= kColumns) continue;
          sum += cells[r * kColumns + c].light;
          count += 1.0;
        }
        cell.light = sum / count;
      }
    }
  }
}

}  // namespace

std::optional<v1::Uniformity> measure_display_shading(const ScreenView& view, const DisplayResponse& response,
                                                      const Shading& camera) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const ScreenView::Light& white : view.white)
    mean += Eigen::Vector3d(white[0], white[1], white[2]) / static_cast<double>(view.white.size());
  Eigen::Matrix3d crosstalk;
  for (int c = 0; c < 3; ++c) {
    for (int p = 0; p < 3; ++p) crosstalk(c, p) = response.crosstalk[c][p];
  }
  const Eigen::Matrix3d primaries_of_light = crosstalk.inverse();

  std::vector<Cell> cells(kColumns * kRows);
  double all = 0.0;
  int pixels = 0;
  for (size_t i = 0; i < view.pixels.size(); ++i) {
    const ScreenView::Light &white = view.white[i], &ramp = view.ramp[i];
    const Eigen::Array3d here = Eigen::Array3d(white[0], white[1], white[2]) / mean.array();
    const Eigen::Vector3d radiance =
        primaries_of_light * (Eigen::Array3d(ramp[0], ramp[1], ramp[2]) / here).matrix();
    const std::optional<size_t> at = cell_of(radiance, response);
    if (!at) continue;
    const int x = static_cast<int>(view.pixels[i]) % view.width_px,
              y = static_cast<int>(view.pixels[i]) / view.width_px;
    const double light = here.mean() / camera.camera(x, y);
    cells[*at].light += light;
    ++cells[*at].pixels;
    all += light;
    ++pixels;
  }
  const auto seen = std::count_if(cells.begin(), cells.end(), [](const Cell& cell) { return cell.seen(); });
  if (2 * seen < kColumns * kRows) return std::nullopt;
  for (Cell& cell : cells) cell.light = cell.seen() ? cell.light / cell.pixels : all / pixels;
  fill(cells);

  double middle = 0.0;
  for (const int row : {kRows / 2 - 1, kRows / 2}) {
    for (const int column : {kColumns / 2 - 1, kColumns / 2})
      middle += 0.25 * cells[row * kColumns + column].light;
  }
  v1::Uniformity uniformity;
  uniformity.set_columns(kColumns);
  uniformity.set_rows(kRows);
  for (const Cell& cell : cells) uniformity.add_light(static_cast<float>(cell.light / middle));
  return uniformity;
}

}  // namespace glasswing
