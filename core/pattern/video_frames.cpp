#include "core/pattern/video_frames.h"

#include <map>

#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {

std::vector<int> video_frames(const v1::CaptureManifest& manifest) {
  std::vector<int> in_order;
  std::map<int, int> place_of_step;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (!frame.object() || kind_of(frame.stimulus()) != StimulusKind::kRamp || frame.stimulus().reference())
      continue;
    in_order.push_back(i);
    if (frame.step() >= 0) place_of_step.emplace(frame.step(), i);
  }
  if (!is_video(manifest.plan()) || place_of_step.empty()) return in_order;
  // A video's steps are the last of its plan.
  const absl::StatusOr<std::vector<Step>> steps =
      expand(manifest.plan(), {manifest.monitors().begin(), manifest.monitors().end()});
  if (!steps.ok()) return in_order;
  std::vector<int> video;
  for (const Step& step : *steps) {
    if (!step.object || kind_of(step.stimulus) != StimulusKind::kRamp) continue;
    const auto found = place_of_step.find(step.number);
    video.push_back(found == place_of_step.end() ? -1 : found->second);
  }
  return video;
}

std::vector<int> lost_frames(const std::vector<int>& video) {
  std::vector<int> lost;
  for (size_t i = 0; i < video.size(); ++i) {
    if (video[i] < 0) lost.push_back(static_cast<int>(i));
  }
  return lost;
}

}  // namespace glasswing
