// One monitor's sweeps, white and bars: shared by all tiles.
#pragma once

#include <optional>
#include <vector>

#include "solver/gaussian/broad_light.h"
#include "solver/gaussian/kernels/joint_batch.h"
#include "solver/gaussian/stack_layout.h"

namespace glasswing {

struct SweptMonitor {
  int texture = 0;
  MonitorExtent extent;
  SampleLayout samples;
  std::vector<size_t> sweeps;                      // indices in the layout, in the order of samples.sweeps
  std::vector<ShownArea> areas;                    // in the order of the layout's
  std::optional<BroadLight> broad = std::nullopt;  // if there are areas
};
std::vector<SweptMonitor> swept_monitors(const StackLayout& layout);

}  // namespace glasswing
