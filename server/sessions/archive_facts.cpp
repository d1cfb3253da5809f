#include "server/sessions/archive_facts.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
#include "core/pattern/video_frames.h"

namespace glasswing {

std::string usual_method(const v1::CaptureManifest& manifest) {
  if (check_method(manifest.plan().method()).ok()) return manifest.plan().method();
  const bool only_ramp = std::ranges::all_of(manifest.frames(), [](const v1::Frame& frame) {
    const v1::Stimulus& stimulus = frame.stimulus();
    return !frame.object() || kind_of(stimulus) == StimulusKind::kRamp ||
           kind_of(stimulus) == StimulusKind::kPatch || stimulus.reference();
  });
  if (only_ramp && !video_frames(manifest).empty()) return std::string(kRampMethod);
  const SolvingMethod* usual = nullptr;
  for (const SolvingMethod& method : solving_methods()) {
    const bool shown =
        method.name != kRampMethod && std::ranges::any_of(manifest.frames(), [&](const v1::Frame& frame) {
          return frame.stimulus().kind() == method.stimulus;
        });
    if (shown && (usual == nullptr || method.rank < usual->rank)) usual = &method;
  }
  return std::string((usual == nullptr ? solving_methods().front() : *usual).name);
}

void note_video(const v1::CaptureManifest& manifest, v1::Session& session) {
  session.clear_frame_count();
  session.clear_lost_frames();
  const std::vector<int> video = video_frames(manifest);
  if (video.size() < 2) return;
  session.set_frame_count(static_cast<int>(video.size()));
  for (const int frame : lost_frames(video)) session.add_lost_frames(frame);
}

void note_frames(const v1::CaptureManifest& manifest, v1::Session& session) {
  std::int64_t bytes = 0;
  int by_patch = 0, by_time = 0;
  for (const v1::Frame& frame : manifest.frames()) {
    bytes += frame.size_bytes();
    if (frame.proof() == v1::PROOF_TIME_AND_PATCH) ++by_patch;
    if (frame.proof() == v1::PROOF_TIME) ++by_time;
  }
  session.set_step_count(manifest.frames_size());
  session.set_proven_count(manifest.frames_size());
  session.set_patch_proven_count(by_patch);
  session.set_time_proven_count(by_time);
  session.set_archive_bytes(bytes);
}

}  // namespace glasswing
