// Objects on the simulated stage. Units are px of the back monitor, which lies at z = 0 with its top-left
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
#include "core/sim/turntable.h"

namespace glasswing {

// One path of a camera ray's light: it arrives along `ray` (traced backwards) with this weight.
struct Path {
  Ray ray;
  double weight;
};

// A small luminous ball on the camera's side of the object, for highlights.
struct Lamp {
  Vec3 centre;
  double radius;
  double radiance;
  bool lights(const Ray& ray) const;
};

class Scene {
 public:
  virtual ~Scene() = default;
  // The paths of a camera ray in one colour channel; `sample` numbers the ray, for objects that scatter. None
  // if the ray misses the object.
  virtual std::optional<std::vector<Path>> trace(const Ray& ray, int channel, int sample) const = 0;
  // Light of the room or of its own that the object sends back along a ray that hits it.
  virtual Colour foreground(const Ray&) const { return {0.0f, 0.0f, 0.0f}; }
  virtual std::optional<Lamp> lamp() const { return std::nullopt; }
  // True if the paths are the same in all channels.
  virtual bool is_colourless() const { return false; }
};

// The motion of a scene, which cycles through its phases.
struct Motion {
  int phases = 1;  // 1: static
  nanoseconds period = std::chrono::seconds(1);

  int phase_at(nanoseconds time) const {
    const nanoseconds since = (time % period + period) % period;
    return static_cast<int>(since * phases / period);
  }
};
Motion motion_of(const std::string& scene);

// Where the axis of the object's table stands: upright, below the object.
Vec3 table_centre(const std::string& scene, MonitorSize back);

// Null for "none". `phase` is below motion_of(name).phases. A lamp stays where it is when the table turns.
// INVALID_ARGUMENT lists the scenes.
absl::StatusOr<std::unique_ptr<Scene>> make_scene(const std::string& name, MonitorSize back, int phase = 0,
                                                  const Turntable& table = {});

}  // namespace glasswing
