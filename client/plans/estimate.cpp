#include "client/plans/estimate.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>
#include <string>
#include <vector>

#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/pattern/plan.h"

namespace glasswing {
namespace {

std::string bytes_of(std::int64_t bytes) {
  return bytes_text(static_cast<double>(bytes));
}

// "191 frames of 640x480", or of each of several cameras.
std::string frames_text(const v1::EstimateSessionResponse& estimate) {
  const auto size = [](const v1::Camera& camera) {
    return fmt::format("{}x{}", camera.width_px(), camera.height_px());
  };
  if (estimate.cameras().empty())
    return fmt::format("{} frames of {}", estimate.step_count(), size(estimate.camera()));
  std::vector<std::string> cameras;
  for (const v1::Camera& camera : estimate.cameras()) cameras.push_back(camera.name() + " " + size(camera));
  return fmt::format("{} frames of each: {}", estimate.step_count(), fmt::join(cameras, ", "));
}

}  // namespace

void print_cost(const v1::Plan& plan, const v1::EstimateSessionResponse& estimate) {
  std::vector<std::string> monitors;
  for (const v1::Monitor& monitor : estimate.monitors()) {
    monitors.push_back(fmt::format("{} {}x{} at {} Hz", monitor.name(), monitor.width_px(),
                                   monitor.height_px(), monitor.refresh_hz()));
  }
  std::cout << fmt::format("steps     {} ({} of them without the object)\n", estimate.step_count(),
                           estimate.steps_without_object())
            << fmt::format("duration  {} (each held for {} refreshes, without retakes)\n",
                           seconds_text(estimate.seconds()), hold_refreshes_of(plan))
            << fmt::format("data      {} ({})\n", bytes_of(estimate.bytes()), frames_text(estimate))
            << fmt::format("monitors  {}\n", fmt::join(monitors, ", "));
  if (estimate.video_frames() == 0) return;
  std::cout << fmt::format("video     {} at {:.4g} frames per second, {} of it; each frame once\n",
                           seconds_text(estimate.video_seconds()),
                           estimate.video_frames() / estimate.video_seconds(),
                           bytes_of(estimate.video_bytes()));
}

void print_rig_state(const v1::EstimateSessionResponse& estimate) {
  std::cout << fmt::format("space     {} free at the camera node\n", bytes_of(estimate.free_bytes()))
            << fmt::format("rig       {}\n",
                           estimate.has_holder() ? "held by " + holder_text(estimate.holder()) : "free");
  for (const std::string& warning : estimate.warnings())
    std::cout << fmt::format("warning   {}\n", printable(warning));
}

std::string holder_text(const v1::RigHolder& holder) {
  return fmt::format("{} since {}: {}", holder.client().empty() ? "somebody" : holder.client(),
                     holder.since(), holder.what());
}

}  // namespace glasswing
