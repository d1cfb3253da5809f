#include "solver/ramp/video_layout.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
#include "core/pattern/video_frames.h"
#include "solver/background/stage_layout.h"

namespace glasswing {
namespace {

bool is_black_stage(const v1::Frame& frame) {
  const v1::Stimulus& stimulus = frame.stimulus();
  return !frame.object() && frame.also_lit().empty() && kind_of(stimulus) == StimulusKind::kSolid &&
         gray_of(stimulus) == 0.0;
}

}  // namespace

absl::StatusOr<VideoLayout> lay_out_video(const v1::CaptureManifest& manifest) {
  VideoLayout layout;
  layout.frames = video_frames(manifest);
  std::string panel;
  for (const int place : layout.frames) {
    if (place < 0) continue;
    const std::string& own = manifest.frames(place).stimulus().panel();
    if (panel.empty()) panel = own;
    if (own != panel) {
      return absl::FailedPreconditionError(
          fmt::format("the ramp is on monitor \"{}\" and on \"{}\"; a video has it on one", panel, own));
    }
  }
  if (panel.empty()) return absl::FailedPreconditionError("no frame shows the ramp with the object");
  layout.texture = texture_of(manifest, panel);
  if (layout.texture < 0) {
    return absl::FailedPreconditionError(
        fmt::format("the ramp is on monitor \"{}\", which the archive does not list", panel));
  }
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (frame.stimulus().reference()) continue;
    if (is_black_stage(frame)) layout.black.push_back(i);
    if (!frame.object() && kind_of(frame.stimulus()) == StimulusKind::kRamp &&
        frame.stimulus().panel() == panel)
      layout.empty.push_back(i);
  }
  if (layout.empty.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("no frame shows the ramp on monitor \"{}\" without the object", panel));
  }
  return layout;
}

}  // namespace glasswing
