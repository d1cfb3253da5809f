#include "server/session_facts.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "core/pattern/plan.h"
#include "core/pattern/video_frames.h"

namespace glasswing {

std::string state_of(const v1::Session& session) {
  std::string name = v1::SessionState_Name(session.state()).substr(std::string("SESSION_STATE_").size());
  std::transform(name.begin(), name.end(), name.begin(),
                 [](char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

absl::Status not_now(const v1::Session& session, const std::string& verb) {
  return absl::FailedPreconditionError(
      fmt::format("session \"{}\" is {}; it cannot be {}", session.name(), state_of(session), verb));
}

std::string usual_method(const v1::CaptureManifest& manifest) {
  if (check_method(manifest.plan().method()).ok()) return manifest.plan().method();
  const bool only_ramp = std::ranges::all_of(manifest.frames(), [](const v1::Frame& frame) {
    const v1::Stimulus& stimulus = frame.stimulus();
    return !frame.object() || stimulus.kind() == "ramp" || stimulus.kind() == "patch" || stimulus.reference();
  });
  if (only_ramp && !video_frames(manifest).empty()) return std::string(kRampMethod);
  const std::pair<std::string_view, std::string_view> methods[] = {
      {"gauss_stripe", "gaussian"}, {"sinusoid", "fringe"}, {"square", "hierarchical"}, {"solid", "alpha"}};
  for (const auto& [kind, method] : methods) {
    const bool shown = std::ranges::any_of(
        manifest.frames(), [&](const v1::Frame& frame) { return frame.stimulus().kind() == kind; });
    if (shown) return std::string(method);
  }
  return "gaussian";
}

void note_video(const v1::CaptureManifest& manifest, v1::Session& session) {
  session.clear_frame_count();
  session.clear_lost_frames();
  const std::vector<int> video = video_frames(manifest);
  if (video.size() < 2) return;
  session.set_frame_count(static_cast<int>(video.size()));
  for (const int frame : lost_frames(video)) session.add_lost_frames(frame);
}

bool is_solved_by_frames(const v1::Session& session) {
  return session.method() == kRampMethod;
}

bool has_frame_files(const v1::Session& session) {
  return session.frame_count() > 0 && is_solved_by_frames(session);
}

bool rests_in_solve(const v1::Session& session) {
  const bool rests =
      session.state() == v1::SESSION_STATE_PAUSED || session.state() == v1::SESSION_STATE_FAILED;
  return rests && session.tile_count() > 0;
}

bool has_number(const google::protobuf::RepeatedField<std::int32_t>& rising, int number) {
  return std::binary_search(rising.begin(), rising.end(), number);
}

void note_archive_bytes(const v1::CaptureManifest& manifest, v1::Session& session) {
  std::int64_t bytes = 0;
  for (const v1::Frame& frame : manifest.frames()) bytes += frame.size_bytes();
  session.set_archive_bytes(bytes);
}

}  // namespace glasswing
