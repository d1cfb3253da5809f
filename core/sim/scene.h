// What stands on the simulated stage. Units are px of the back monitor, which lies at z = 0 with its top-left
// corner at the origin, y down; the camera is at z < 0 and looks along +z.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "core/pattern/pattern.h"
#include "core/sim/optics.h"

namespace glasswing {

// One way that a camera ray's light came: from along `ray` (followed backwards), with this weight.
struct Path {
  Ray ray;
  double weight;
};

// A small ball that shines on the object from the camera's side, for highlights.
struct Lamp {
  Vec3 centre;
  double radius;
  double radiance;
  bool lights(const Ray& ray) const;
};

class Scene {
 public:
  virtual ~Scene() = default;
  // The paths of a camera ray, for one colour channel; `sample` numbers the ray, for those that scatter.
  // Nothing if the ray misses the object.
  virtual std::optional<std::vector<Path>> trace(const Ray& ray, int channel, int sample) const = 0;
  // Light that the object itself sends, where a ray hits it.
  virtual Colour foreground() const { return {0.0f, 0.0f, 0.0f}; }
  virtual std::optional<Lamp> lamp() const { return std::nullopt; }
  // All channels' paths are the same.
  virtual bool is_colourless() const { return false; }
};

// How a scene moves: round and round through its phases.
struct Motion {
  int phases = 1;  // 1: it stands still
  nanoseconds period = std::chrono::seconds(1);

  int phase_at(nanoseconds time) const {
    const nanoseconds since = (time % period + period) % period;
    return static_cast<int>(since * phases / period);
  }
};
Motion motion_of(const std::string& scene);

// Null for "none". `phase` is below motion_of(name).phases. INVALID_ARGUMENT lists the scenes.
absl::StatusOr<std::unique_ptr<Scene>> make_scene(const std::string& name, MonitorSize back, int phase = 0);

}  // namespace glasswing
