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
  std::span<const Tap> taps(int x, int y, int channel) const;
  float foreground(int x, int y, int channel) const;

  // The picture that a perfect camera takes while the monitors show these; an empty one is black.
  RadianceImage respond(std::span<const RadianceImage> pictures) const;

 private:
  friend class TransportBuilder;
  int width_px_ = 0;
  int height_px_ = 0;
  std::vector<std::int64_t> first_tap_;  // height x width x 3 + 1
  std::vector<Tap> taps_;
  std::vector<float> foreground_;
};

// Scenes: "crystal", "glass", "brushed", "none". With object = false the stage is empty, whatever the scene.
// Geometry: the back monitor fills the camera's view, one camera pixel to (monitor / camera size) monitor
// pixels; "left", "right" and "top" stand at its edges, perpendicular, towards the camera. Deterministic.
// INVALID_ARGUMENT: an unknown scene or monitor name lists what there is.
absl::StatusOr<Transport> build_transport(const std::string& scene, bool object,
                                          const std::vector<SceneMonitor>& monitors, int camera_width_px,
                                          int camera_height_px);

}  // namespace glasswing
