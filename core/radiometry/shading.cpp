#include "core/radiometry/shading.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace glasswing {

absl::StatusOr<Shading> Shading::create(const v1::CaptureManifest& manifest) {
  Shading shading;
  shading.width_px_ = manifest.camera().width_px();
  shading.height_px_ = manifest.camera().height_px();
  if (manifest.camera_calibration().has_fall_off()) {
    const v1::FallOff& fall_off = manifest.camera_calibration().fall_off();
    const double r2 = fall_off.r2(), r4 = fall_off.r4();
    double darkest = std::min(1.0, 1.0 + r2 + r4);
    if (r4 > 0.0 && r2 < 0.0 && -r2 < 2.0 * r4) darkest = std::min(darkest, 1.0 - 0.25 * r2 * r2 / r4);
    if (!(darkest > 0.0)) {
      return absl::InvalidArgumentError(fmt::format(
          "the calibration of camera \"{}\": its fall-off leaves {:.3f} of the light somewhere; it must be "
          "above 0 everywhere",
          manifest.camera_calibration().camera(), darkest));
    }
    shading.r2_ = r2;
    shading.r4_ = r4;
    shading.fades_ = r2 != 0.0 || r4 != 0.0;
  }
  for (const v1::DisplayCalibration& calibration : manifest.display_calibrations()) {
    if (!calibration.has_uniformity()) continue;
    const v1::Uniformity& uniformity = calibration.uniformity();
    const bool good =
        uniformity.columns() > 0 && uniformity.rows() > 0 &&
        static_cast<std::int64_t>(uniformity.columns()) * uniformity.rows() == uniformity.light_size() &&
        std::ranges::all_of(uniformity.light(),
                            [](float light) { return light > 0.0f && std::isfinite(light); });
    if (!good) {
      return absl::InvalidArgumentError(fmt::format(
          "the calibration of monitor \"{}\": uniformity is {} x {} with {} values; it must have "
          "columns x rows values above 0",
          calibration.monitor(), uniformity.columns(), uniformity.rows(), uniformity.light_size()));
    }
    for (int texture = 0; texture < manifest.monitors_size(); ++texture) {
      const v1::Monitor& monitor = manifest.monitors(texture);
      if (monitor.name() != calibration.monitor()) continue;
      shading.grids_.resize(manifest.monitors_size());
      shading.grids_[texture] = {
          .columns = uniformity.columns(),
          .rows = uniformity.rows(),
          .cell_width_px = static_cast<double>(monitor.width_px()) / uniformity.columns(),
          .cell_height_px = static_cast<double>(monitor.height_px()) / uniformity.rows(),
          .light = {uniformity.light().begin(), uniformity.light().end()}};
    }
  }
  return shading;
}

double Shading::camera(int x, int y) const {
  const double across_px = x + 0.5 - 0.5 * width_px_, down_px = y + 0.5 - 0.5 * height_px_;
  const double corner_px2 = 0.25 * (1.0 * width_px_ * width_px_ + 1.0 * height_px_ * height_px_);
  const double r2 = (across_px * across_px + down_px * down_px) / corner_px2;
  return 1.0 + r2 * (r2_ + r2 * r4_);
}

double Shading::monitor(int texture, double x_px, double y_px) const {
  if (grids_.empty() || grids_[texture].columns == 0) return 1.0;
  const Grid& grid = grids_[texture];
  const double across = std::clamp(x_px / grid.cell_width_px - 0.5, 0.0, grid.columns - 1.0),
               down = std::clamp(y_px / grid.cell_height_px - 0.5, 0.0, grid.rows - 1.0);
  const int left = static_cast<int>(across), top = static_cast<int>(down);
  const int right = std::min(left + 1, grid.columns - 1), bottom = std::min(top + 1, grid.rows - 1);
  const auto at = [&](int column, int row) {
    return grid.light[static_cast<size_t>(row) * grid.columns + column];
  };
  return std::lerp(std::lerp(at(left, top), at(right, top), across - left),
                   std::lerp(at(left, bottom), at(right, bottom), across - left), down - top);
}

}  // namespace glasswing
