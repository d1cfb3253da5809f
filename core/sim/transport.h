// How light gets from the monitors' pixels to the camera's: a sparse matrix, one list of taps for each camera
// pixel and channel, and the light that is there without monitors.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/frame/image.h"
#include "core/pattern/pattern.h"

namespace glasswing {

struct SceneMonitor {
  std::string name;  // "back", "left", "right" or "top": where it stands
  MonitorSize size;
};

struct Tap {
  std::int32_t monitor;  // place in the list the transport was built with
  std::int32_t x_px;
  std::int32_t y_px;
  float weight;  // fraction of that pixel's radiance that arrives
};

class Transport {
 public:
  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }
  // Sorted by monitor, then y, then x; each pixel at most once.
  std::vector<Tap> taps(int x, int y, int channel) const;
  float foreground(int x, int y, int channel) const;

  // The picture that a perfect camera takes while the monitors show these; an empty one is black.
  RadianceImage respond(std::span<const RadianceImage> pictures) const;

  // The same, row by row: what is there without monitors, r, g, b interleaved,
  std::span<const float> foreground_row(int y) const;
  // to which each monitor adds its light. `radiance` gives that of one of its samples (RadianceImage::index).
  template <typename Radiance>
  void add_row(size_t monitor, int y, std::span<float> row, const Radiance& radiance) const;
  // The monitor's rows that a camera row sees: none if last < first.
  struct Rows {
    int first, last;
  };
  Rows rows_seen(size_t monitor, int y) const { return parts_[monitor].rows[static_cast<size_t>(y)]; }

 private:
  friend class TransportBuilder;
  struct SampleTap {
    std::uint32_t sample;
    float weight;
  };
  // Of one monitor.
  struct Part {
    int width_px = 0;
    std::vector<SampleTap> taps;
    std::vector<std::uint16_t> counts;  // of each camera sample
    std::vector<size_t> first_taps;     // of each camera row
    std::vector<Rows> rows;             // seen by each camera row
  };
  size_t row_begin(int y) const { return static_cast<size_t>(y) * static_cast<size_t>(width_px_) * 3; }

  int width_px_ = 0;
  int height_px_ = 0;
  std::vector<Part> parts_;
  std::vector<float> foreground_;
};

template <typename Radiance>
void Transport::add_row(size_t monitor, int y, std::span<float> row, const Radiance& radiance) const {
  const Part& part = parts_[monitor];
  const SampleTap* tap = part.taps.data() + part.first_taps[static_cast<size_t>(y)];
  const std::uint16_t* counts = part.counts.data() + row_begin(y);
  for (size_t i = 0; i < row.size(); ++i) {
    float light = row[i];
    for (int left = counts[i]; left > 0; --left, ++tap) light += tap->weight * radiance(tap->sample);
    row[i] = light;
  }
}

inline constexpr int kRaysAcross = 4;  // to a camera pixel, each way

// Scenes: "crystal", "glass", "brushed", "none". With object = false the stage is empty, whatever the scene.
// Geometry: the back monitor fills the camera's view, one camera pixel to (monitor / camera size) monitor
// pixels; "left", "right" and "top" stand at its edges, perpendicular, towards the camera. `rays_across` 1
// makes of every ray a pixel, where the picture is kRaysAcross times as large. Deterministic.
// INVALID_ARGUMENT: an unknown scene or monitor name lists what there is.
absl::StatusOr<Transport> build_transport(const std::string& scene, bool object,
                                          const std::vector<SceneMonitor>& monitors, int camera_width_px,
                                          int camera_height_px, int rays_across = kRaysAcross);

}  // namespace glasswing
