// What stands on the simulated stage. Units are px of the back monitor, which lies at z = 0 with its top-left
// corner at the origin, y down; the camera is at z < 0 and looks along +z.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/pattern/pattern.h"
#include "core/sim/optics.h"

namespace glasswing {

// One way that a camera ray's light came: from along `ray` (followed backwards), with this weight.
struct Path {
  Ray ray;
  double weight;
};

class Scene {
 public:
  virtual ~Scene() = default;
  // The paths of a camera ray, for one colour channel; `sample` numbers the ray, for those that scatter.
  // Nothing if the ray misses the object.
  virtual std::optional<std::vector<Path>> trace(const Ray& ray, int channel, int sample) const = 0;
  // Light that the object itself sends, where a ray hits it.
  virtual Colour foreground() const { return {0.0f, 0.0f, 0.0f}; }
};

// Null for "none". INVALID_ARGUMENT lists the scenes.
absl::StatusOr<std::unique_ptr<Scene>> make_scene(const std::string& name, MonitorSize back);

}  // namespace glasswing
