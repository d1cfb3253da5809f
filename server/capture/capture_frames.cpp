// What a capture does with the camera's frames.
#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/service/service.h"
#include "server/capture/capture.h"
#include "server/metrics/server_metrics.h"

namespace glasswing {
namespace {

constexpr size_t kRecentFrames = 4096;
constexpr int kLessons = 8;      // how often a patch is looked for that is there but cannot be read
constexpr int kDarkLessons = 2;  // how often one that the camera does not seem to look at

}  // namespace

absl::Status Capture::stored(const grpc::Status& status) {
  no_room_ = no_room_ || status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED;
  return from_grpc(status, links_.camera->title());
}

// For all that is still to come, so that a session that waits does not go on by a few frames at a time.
absl::Status Capture::check_room() {
  const bool has_run = video_has_run();
  const auto left = std::ranges::count_if(
      steps_, [&](const Step& step) { return !proven_.contains(step.number) && !(step.object && has_run); });
  const v1::Camera& camera = links_.camera_info.camera();
  const std::int64_t needed_bytes =
      left * static_cast<std::int64_t>(tiff_size_bytes(camera.width_px(), camera.height_px()));
  v1::GetSpaceResponse space;
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  GW_RETURN_IF_ERROR(from_grpc(archive_stub_->GetSpace(&context, {}, &space), links_.camera->title()));
  if (needed_bytes <= space.free_bytes()) return absl::OkStatus();
  no_room_ = true;
  return absl::ResourceExhaustedError(fmt::format(
      "{:.1f} MB of disk are missing at the {}: {} frames are still to come, {:.1f} MB, and {:.1f} "
      "MB are free for frames; delete sessions there",
      1e-6 * static_cast<double>(needed_bytes - space.free_bytes()), links_.camera->title(), left,
      1e-6 * static_cast<double>(needed_bytes), 1e-6 * static_cast<double>(space.free_bytes())));
}

void Capture::take_frames(Recording& frames) {
  for (v1::FrameTaken& frame : frames.camera.inbox.take()) {
    session_.set_frames_taken(session_.frames_taken() + 1);
    const double asked_ms = frames.camera.exposure_ms();
    const bool as_asked = std::abs(frame.exposure_ms() - asked_ms) <= 0.01 * asked_ms &&
                          frame.width_px() == links_.camera_info.camera().width_px() &&
                          frame.height_px() == links_.camera_info.camera().height_px();
    if (!as_asked) continue;
    frames.matcher.add_frame(rig_time_of(frame, *links_.camera));
    frames.recent.emplace(frame.sequence(), std::move(frame));
    if (frames.recent.size() > kRecentFrames) frames.recent.erase(frames.recent.begin());
  }
}

absl::StatusOr<bool> Capture::judge(const std::vector<FrameMatcher::Match>& matches,
                                    std::set<int>& lessons_due, Recording& frames) {
  std::vector<FrameMatcher::Match> lessons;
  for (const FrameMatcher::Match& match : matches)
    (lessons_due.contains(match.step) ? lessons : frames.waiting).push_back(match);
  if (!lessons.empty()) GW_RETURN_IF_ERROR(keep_lessons(lessons, frames));
  std::erase_if(lessons_due, [this](int step) { return proven_.contains(step); });
  // Steps are proven in order: one that follows the lessons says that a lesson was missed.
  if (!lessons_due.empty()) return frames.waiting.empty();
  const std::vector<FrameMatcher::Match> ready = std::exchange(frames.waiting, {});
  GW_RETURN_IF_ERROR(keep(ready, frames).status());
  return true;
}

absl::Status Capture::keep_lessons(const std::vector<FrameMatcher::Match>& lessons, Recording& frames) {
  const std::vector<std::string> given_up = patches_given_up(frames);
  GW_ASSIGN_OR_RETURN(const v1::KeepFramesResponse kept, keep(lessons, frames));
  for (const int step : kept.waiting_steps()) frames.lessons.insert(step);
  if (!kept.unseen_patches().empty()) ++frames.vain_lessons;
  for (const v1::UnseenPatch& unseen : kept.unseen_patches()) {
    const std::string& monitor = unseen.monitor();
    std::erase_if(frames.lessons,
                  [&](int step) { return steps_.at(static_cast<size_t>(step)).stimulus.panel() == monitor; });
    ++frames.unseen[monitor].count;
    frames.unseen[monitor].dark = unseen.dark();
    const bool accepted = std::find(given_up.begin(), given_up.end(), monitor) != given_up.end();
    if (!accepted || !unseen_patches_.insert(monitor).second) continue;
    warn(fmt::format("monitor \"{}\": {}; its steps are proven by time alone", monitor, unseen.reason()));
  }
  return absl::OkStatus();
}

// Monitors that go on without if their patch is not found this time.
std::vector<std::string> Capture::patches_given_up(const Recording& frames) const {
  std::vector<std::string> monitors(unseen_patches_.begin(), unseen_patches_.end());
  for (const auto& [monitor, unseen] : frames.unseen) {
    if (unseen.count + 1 >= (unseen.dark ? kDarkLessons : kLessons)) monitors.push_back(monitor);
  }
  return monitors;
}

absl::StatusOr<v1::KeepFramesResponse> Capture::keep(const std::vector<FrameMatcher::Match>& matches,
                                                     Recording& frames) {
  v1::KeepFramesResponse response;
  if (matches.empty()) return response;
  v1::KeepFramesRequest request;
  request.set_session(session_.name());
  for (std::string& monitor : patches_given_up(frames)) request.add_accept_unseen_patches(std::move(monitor));
  const bool has_patches = std::any_of(monitors_.begin(), monitors_.end(),
                                       [](const v1::Monitor& monitor) { return monitor.patch_rows() > 0; });
  for (const FrameMatcher::Match& match : matches) {
    const v1::FrameTaken& taken = frames.recent.at(match.frame.sequence);
    const double gain = embedded_.camera_calibration().gain();
    if (gain != 0.0 && std::abs(taken.gain() - gain) > 0.01 * gain) {
      return absl::FailedPreconditionError(fmt::format(
          "the camera runs at gain {}, its calibration is of gain {}: set it back, or measure it again with "
          "glasswing calibrate camera",
          taken.gain(), gain));
    }
    const Step& step = steps_.at(static_cast<size_t>(match.step));
    v1::Frame& frame = *request.add_frames();
    frame.set_object(step.object);
    *frame.mutable_stimulus() = step.stimulus;
    frame.set_step(step.number);
    frame.set_exposure_ms(taken.exposure_ms());
    frame.set_gain(taken.gain());
    frame.set_exposure_start_ns(match.frame.start.count());
    frame.set_exposure_end_ns(match.frame.end.count());
    frame.set_sequence(match.frame.sequence);
    if (has_patches && shows_id(step)) frame.set_patch_id(patch_ids_.at(step.number));
  }
  grpc::ClientContext context;
  set_deadline(context, std::chrono::minutes(1));
  GW_RETURN_IF_ERROR(stored(links_.camera_stub->KeepFrames(&context, request, &response)));
  for (const v1::Frame& frame : response.frames()) {
    note_proven(frame);
    log_.add(session_.name(), proof_of(frame, seconds()));
  }
  session_.set_refused_count(session_.refused_count() + response.refused());
  session_.set_capture_seconds(seconds());
  report_(session_);
  return response;
}

void Capture::note_proven(const v1::Frame& frame) {
  if (!proven_.insert(frame.step()).second) return;
  server_metrics().steps_proven.Increment();
  session_.set_archive_bytes(session_.archive_bytes() + frame.size_bytes());
  session_.set_proven_count(static_cast<int>(proven_.size()));
  if (frame.proof() == v1::PROOF_TIME_AND_PATCH)
    session_.set_patch_proven_count(session_.patch_proven_count() + 1);
}

void Capture::warn(const std::string& what) {
  session_.set_warning(session_.warning().empty() ? what : session_.warning() + "; " + what);
  report_(session_);
}

}  // namespace glasswing
