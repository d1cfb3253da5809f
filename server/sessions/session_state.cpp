#include "server/sessions/session_state.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>

#include "core/pattern/method_options.h"
#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
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
    return !frame.object() || kind_of(stimulus) == StimulusKind::kRamp ||
           kind_of(stimulus) == StimulusKind::kPatch || stimulus.reference();
  });
  if (only_ramp && !video_frames(manifest).empty()) return std::string(kRampMethod);
  const std::pair<StimulusKind, std::string_view> methods[] = {{StimulusKind::kStripe, "gaussian"},
                                                               {StimulusKind::kSinusoid, "fringe"},
                                                               {StimulusKind::kSquare, "hierarchical"},
                                                               {StimulusKind::kSolid, "alpha"}};
  for (const auto& [kind, method] : methods) {
    const bool shown = std::ranges::any_of(
        manifest.frames(), [&](const v1::Frame& frame) { return kind_of(frame.stimulus()) == kind; });
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
  return rests && session.job() != 0;
}

void count_tiles(const JobCounts& counts, v1::Session& session) {
  session.set_tile_count(counts.tiles);
  session.set_tiles_done(counts.done);
  session.set_object_pixel_count(counts.object_pixels);
  session.set_flagged_pixel_count(counts.flagged_pixels);
}

std::string computes(const std::string& method) {
  const std::map<std::string, int>& versions = method_versions();
  return fmt::format("{}/{} matte/{}", method, versions.at(method), versions.at("matte"));
}

TileAttempt attempt_of(const v1::TileLease& lease) {
  return {.job = lease.job(), .tile = lease.tile(), .attempt = lease.attempt()};
}

bool has_number(const google::protobuf::RepeatedField<std::int32_t>& rising, int number) {
  return std::binary_search(rising.begin(), rising.end(), number);
}

// A frame that is solved once more, in a tile of its own, is in two.
void note_solved_frames(const std::vector<TileState>& tiles, v1::Session& session) {
  std::set<int> solved;
  for (const bool done : {true, false}) {
    for (const TileState& tile : tiles) {
      if (tile.is_done() != done) continue;
      for (int frame = tile.range.first; frame < tile.range.first + tile.range.count; ++frame) {
        if (done) solved.insert(frame);
        if (!done) solved.erase(frame);
      }
    }
  }
  session.clear_solved_frames();
  for (const int frame : solved) {
    if (!has_number(session.lost_frames(), frame) && !has_number(session.refused_frames(), frame))
      session.add_solved_frames(frame);
  }
}

void note_frames(const v1::CaptureManifest& manifest, v1::Session& session) {
  std::int64_t bytes = 0;
  int by_patch = 0;
  for (const v1::Frame& frame : manifest.frames()) {
    bytes += frame.size_bytes();
    if (frame.proof() == v1::PROOF_TIME_AND_PATCH) ++by_patch;
  }
  session.set_step_count(manifest.frames_size());
  session.set_proven_count(manifest.frames_size());
  session.set_patch_proven_count(by_patch);
  session.set_archive_bytes(bytes);
}

}  // namespace glasswing
