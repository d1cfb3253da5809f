#include "core/pattern/plan_cost.h"

#include <map>

#include "core/frame/archive.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {

void add_cost(const v1::Plan& plan, const std::vector<Step>& steps, v1::EstimateSessionResponse& estimate) {
  std::map<std::string, double> refresh_hz;
  for (const v1::Monitor& monitor : estimate.monitors()) refresh_hz[monitor.name()] = monitor.refresh_hz();
  int without_object = 0, video_frames = 0;
  double seconds = 0.0, video_seconds = 0.0;
  for (const Step& step : steps) {
    const double step_seconds = hold_refreshes_of(plan) / refresh_hz.at(step.stimulus.panel());
    without_object += step.object ? 0 : 1;
    seconds += step_seconds;
    if (!is_video(plan) || !step.object || kind_of(step.stimulus) != StimulusKind::kRamp) continue;
    video_frames += 1;
    video_seconds += step_seconds;
  }
  const std::int64_t frame_bytes = tiff_size_bytes(shape_of(estimate.camera()));
  estimate.set_step_count(static_cast<int>(steps.size()));
  estimate.set_steps_without_object(without_object);
  estimate.set_seconds(seconds);
  estimate.set_bytes(static_cast<std::int64_t>(steps.size()) * frame_bytes);
  estimate.set_video_frames(video_frames);
  estimate.set_video_seconds(video_seconds);
  estimate.set_video_bytes(video_frames * frame_bytes);
}

}  // namespace glasswing
