// Light transport from the monitors' pixels to the camera's: a sparse matrix, one list of taps for each
// camera pixel and channel, plus the light that does not come from monitors.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/pattern/pattern.h"
#include "core/sim/panel_pose.h"
#include "core/sim/turntable.h"

namespace glasswing {

struct SceneMonitor {
  std::string name;  // its position: "back", "left", "right" or "top"
  MonitorSize size;
  double pitch_mm = 1.0;  // of its pixels, which are as large as the back monitor's
  PanelPose pose = {};
  friend bool operator==(const SceneMonitor&, const SceneMonitor&) = default;
};

struct Tap {
  std::int32_t monitor;  // index in the list that the transport was built with
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

  // The picture of a perfect camera while the monitors show these; an empty one is black.
  RadianceImage respond(std::span<const RadianceImage> pictures) const;

  // The same, row by row. Sets a row, r, g, b interleaved, to the light without monitors.
  void start_row(int y, std::span<float> row) const;
  // Adds a monitor's light. `radiance` returns that of one of its samples (RadianceImage::index).
  template <typename Radiance>
  void add_row(size_t monitor, int y, std::span<float> row, const Radiance& radiance) const;
  // The monitor's rows that a camera row sees; none if last < first.
  struct Rows {
    int first, last;
  };
  Rows rows_seen(size_t monitor, int y) const { return parts_[monitor].rows[y]; }

 private:
  friend class TransportBuilder;
  struct SampleTap {
    std::uint32_t sample;  // of red if one tap serves all channels
    float weight;
  };
  // The taps of one monitor.
  struct Part {
    int width_px = 0;
    std::vector<SampleTap> taps;
    std::vector<std::uint16_t> counts;  // by camera sample, or by pixel if colourless
    std::vector<size_t> first_taps;     // by camera row
    std::vector<Rows> rows;             // seen, by camera row
  };
  // The stored columns of a camera row, [first, last) px.
  struct Columns {
    int first = 0, last = 0;
    size_t first_pixel = 0;  // number of pixels in the rows above
  };
  bool owns(int x, int y) const {
    const Columns& own = own_[y];
    return x >= own.first && x < own.last;
  }
  size_t samples_a_pixel() const { return colourless_ ? 1 : 3; }
  // The first tap of a stored pixel, and the tap counts of its samples.
  struct PixelTaps {
    const SampleTap* tap;
    const std::uint16_t* count;
  };
  PixelTaps find(const Part& part, int x, int y) const;
  template <typename Radiance>
  void add_columns(size_t monitor, int y, int first, int last, std::span<float> row,
                   const Radiance& radiance) const;

  int width_px_ = 0;
  int height_px_ = 0;
  bool colourless_ = false;
  std::vector<Columns> own_;                 // columns stored here, by row
  std::shared_ptr<const Transport> around_;  // the rest; null if all is stored here
  std::vector<Part> parts_;
  std::vector<float> foreground_;
};

template <typename Radiance>
void Transport::add_row(size_t monitor, int y, std::span<float> row, const Radiance& radiance) const {
  const Columns& own = own_[y];
  if (around_ != nullptr) {
    around_->add_columns(monitor, y, 0, own.first, row, radiance);
    around_->add_columns(monitor, y, own.last, width_px_, row, radiance);
  }
  add_columns(monitor, y, own.first, own.last, row, radiance);
}

template <typename Radiance>
void Transport::add_columns(size_t monitor, int y, int first, int last, std::span<float> row,
                            const Radiance& radiance) const {
  if (first == last) return;
  auto [tap, count] = find(parts_[monitor], first, y);
  const size_t begin = 3 * static_cast<size_t>(first), end = 3 * static_cast<size_t>(last);
  if (colourless_) {
    for (size_t i = begin; i < end; i += 3, ++count) {
      float red = row[i], green = row[i + 1], blue = row[i + 2];
      for (int left = *count; left > 0; --left, ++tap) {
        red += tap->weight * radiance(tap->sample);
        green += tap->weight * radiance(tap->sample + 1);
        blue += tap->weight * radiance(tap->sample + 2);
      }
      row[i] = red;
      row[i + 1] = green;
      row[i + 2] = blue;
    }
    return;
  }
  for (size_t i = begin; i < end; ++i, ++count) {
    float light = row[i];
    for (int left = *count; left > 0; --left, ++tap) light += tap->weight * radiance(tap->sample);
    row[i] = light;
  }
}

inline constexpr int kRaysAcross = 4;        // per camera pixel and axis
inline constexpr double kFocalWidths = 4.0;  // the camera's focal length in widths of its picture

// Scenes: "crystal", "glass", "brushed", "still-life", "wobble", "wobble-lit", "board", "none"; a moving
// scene is in its first phase. With object = false the stage is empty. Geometry: the camera is a pinhole,
// `focal_widths` widths of the back monitor in front of its middle. At its own place the back monitor fills
// the camera's view, one camera pixel covers (monitor / camera size) monitor pixels; "left", "right" and
// "top" stand at its edges, perpendicular, towards the camera. `rays_across` 1 makes every ray a pixel, for a
// picture kRaysAcross times as large. A ray sees the pixel of a monitor on which it lands; with `areas`,
// where tracing takes three times as long, what its part of the camera's pixel covers there, so that nothing
// depends on how rays fall on monitors' pixels. Deterministic. INVALID_ARGUMENT lists the known scenes or
// monitor names.
absl::StatusOr<Transport> build_transport(const std::string& scene, bool object,
                                          const std::vector<SceneMonitor>& monitors, int camera_width_px,
                                          int camera_height_px, int rays_across = kRaysAcross,
                                          double focal_widths = kFocalWidths, const Turntable& table = {},
                                          bool areas = false);

// Called once or twice for each row of a trace, by one thread at a time, with the share of the work that is
// done: 0 to 1, never falling. Returns false to stop the trace.
using TraceReport = std::function<bool(double share)>;

// The same for the empty stage and all phases of a scene (scene.h), traced on all cores. A phase stores only
// the columns between the object's edges; all phases share the empty stage around them. The 36 phases of
// "wobble" take 0.2 GB at 640x480, proportional to the camera's pixels. CANCELLED: `report` stopped it.
struct StageTransports {
  std::shared_ptr<const Transport> empty;
  std::vector<std::shared_ptr<const Transport>> phases;
};
absl::StatusOr<StageTransports> build_phases(const std::string& scene,
                                             const std::vector<SceneMonitor>& monitors, int camera_width_px,
                                             int camera_height_px, int rays_across = kRaysAcross,
                                             double focal_widths = kFocalWidths,
                                             const TraceReport& report = nullptr, const Turntable& table = {},
                                             bool areas = false);

}  // namespace glasswing
