#include "solver/gaussian/swept_monitor.h"

namespace glasswing {

std::vector<SweptMonitor> swept_monitors(const StackLayout& layout) {
  std::vector<SweptMonitor> monitors;
  for (size_t s = 0; s < layout.sweeps.size(); ++s) {
    const SweepLayout& sweep = layout.sweeps[s];
    if (monitors.empty() || monitors.back().texture != sweep.texture) {
      const EmptyMonitor& monitor = layout.stage.monitors[sweep.texture];
      monitors.push_back({.texture = sweep.texture,
                          .extent = {.width_px = static_cast<double>(monitor.width_px),
                                     .height_px = static_cast<double>(monitor.height_px)},
                          .samples = {},
                          .sweeps = {},
                          .areas = {}});
    }
    monitors.back().sweeps.push_back(s);
    monitors.back().samples.add(
        {.cos_phi = sweep.cos_phi, .sin_phi = sweep.sin_phi, .sigma_px = sweep.sigma_px}, sweep.r_px);
  }
  for (SweptMonitor& monitor : monitors) {
    std::vector<LitArea> lit;
    for (const AreaFrames& area : layout.areas[monitor.texture]) {
      monitor.areas.push_back({.lit = area.lit, .light = area.light});
      lit.push_back(area.lit);
    }
    if (!lit.empty()) monitor.broad.emplace(monitor.samples, lit, monitor.extent);
  }
  return monitors;
}

}  // namespace glasswing
