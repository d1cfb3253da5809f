// The places that a camera's pixels see on the monitors, from the matte of a stage: the pixels that show no
// object, or all of them if no empty stage was captured.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace glasswing {

struct Sighting {
  Eigen::Vector2d pixel;       // centre of a camera's pixel, continuous
  Eigen::Vector2d monitor_px;  // where it looks
  double sd_px = 0.0;          // standard error of that, monitor px; 0: unknown
};
// One monitor in front of the camera.
struct MonitorView {
  std::string session, monitor;
  int width_px = 0, height_px = 0;
  std::vector<Sighting> sightings;
  std::optional<double> rail_mm = {};  // where it stood
};
struct StageView {
  int width_px = 0, height_px = 0;  // of the camera's picture
  std::vector<MonitorView> monitors;
};

inline constexpr int kMinSightings = 50;  // of a view

// Reads a matte's file a few rows at a time, and samples rows and columns of large pictures. Monitors with
// fewer than kMinSightings are left out. FAILED_PRECONDITION: part of a picture, or a matte that does not
// record what its pixels see. Otherwise errors of decode_matte().
absl::StatusOr<StageView> sightings_in(std::string_view matte);

}  // namespace glasswing
