#include "server/capture.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <thread>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/pattern/id_patch.h"
#include "core/service/service.h"
#include "server/embed_calibrations.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
constexpr nanoseconds kMostStartLead = std::chrono::seconds(2);
constexpr milliseconds kPoll(10);
constexpr int kNoStep = -1;
constexpr size_t kRecentFrames = 4096;
constexpr int kLessons = 8;               // how often a patch is looked for that is there but cannot be read
constexpr int kDarkLessons = 2;           // how often one that the camera does not seem to look at
constexpr milliseconds kLastFrame(1500);  // how long a frame may come after the last step was replaced

std::string listed(const std::vector<Step>& steps) {
  std::string text;
  int count = 0;
  for (const Step& step : steps) {
    if (++count > 10) return text + ", ...";
    text += fmt::format("{}{}", text.empty() ? "" : ", ", step.number);
  }
  return text;
}

// A lesson shows its own, and a calibration's exposures suit none.
bool shows_id(const Step& step) {
  return !is_lesson(step) && !step.stimulus.codes();
}

}  // namespace

Capture::Capture(const Rig& rig, const CalibrationStore& calibrations, std::filesystem::path images,
                 v1::Session session, std::optional<bool> object_confirmed,
                 std::function<void(const v1::Session&)> report)
    : rig_(rig),
      calibrations_(calibrations),
      images_(std::move(images)),
      session_(std::move(session)),
      object_confirmed_(object_confirmed),
      report_(std::move(report)) {}

Capture::~Capture() = default;

CaptureOutcome Capture::run(std::stop_token stop) {
  using Kind = CaptureOutcome::Kind;
  bool needs_operator = false;
  bool object_wanted = false;
  const auto work = [&]() -> absl::Status {
    GW_RETURN_IF_ERROR(find_rig());
    GW_RETURN_IF_ERROR(open_archive());
    GW_RETURN_IF_ERROR(send_images());
    const bool has_run = video_has_run();
    std::vector<Group> groups;
    for (const Step& step : steps_) {
      if (proven_.contains(step.number) || (step.object && has_run)) continue;
      if (groups.empty() || groups.back().object != step.object ||
          groups.back().exposure_ms != step.exposure_ms) {
        groups.push_back({.object = step.object, .exposure_ms = step.exposure_ms, .steps = {}});
      }
      groups.back().steps.push_back(step);
    }
    std::optional<bool> object_at = object_confirmed_;
    for (const Group& group : groups) {
      if (object_at != group.object) {
        GW_ASSIGN_OR_RETURN(const bool moved, move_object(group.object));
        if (!moved) {
          needs_operator = true;
          object_wanted = group.object;
          return absl::OkStatus();
        }
        object_at = group.object;
      }
      GW_RETURN_IF_ERROR(take(group, stop));
    }
    if (is_video(session_.plan())) note_lost(has_run);
    return seal();
  };
  const absl::Status status = work();
  if (stop.stop_requested()) {
    return {Kind::kStopped, video_has_run() ? "the video is over, what was recorded of it stays" : ""};
  }
  if (needs_operator) {
    const char* what = !object_wanted              ? "take the object off the stage, then"
                       : is_video(session_.plan()) ? "place the object on the stage; to start the video"
                                                   : "place the object on the stage, then";
    return {Kind::kNeedsOperator, fmt::format("{}: glasswing resume {}", what, session_.name())};
  }
  if (status.ok()) return {Kind::kCaptured, ""};
  // ABORTED: another program took the screens, as after a display was started again.
  const bool lost =
      absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status) || absl::IsAborted(status);
  return {lost ? Kind::kNodeLost : Kind::kFailed, std::string(status.message())};
}

absl::Status Capture::find_rig() {
  GW_ASSIGN_OR_RETURN(links_, connect(rig_, calibrations_));
  GW_ASSIGN_OR_RETURN(monitors_, links_.monitors());
  session_.set_archive_address(links_.camera->address());
  archive_stub_ = v1::ArchiveService::NewStub(links_.camera->channel());
  stage_stub_ = v1::StageService::NewStub(links_.camera->channel());
  GW_ASSIGN_OR_RETURN(steps_, expand(session_.plan(), monitors_));
  return absl::OkStatus();
}

absl::Status Capture::open_archive() {
  v1::CreateArchiveRequest create;
  v1::CaptureManifest& header = *create.mutable_manifest();
  header.set_format_version(1);
  header.set_session(session_.name());
  header.set_created(session_.created());
  header.set_generator(fmt::format("glasswing-server {}", kVersion));
  for (const v1::Monitor& monitor : monitors_) *header.add_monitors() = monitor;
  *header.mutable_camera() = links_.camera_info.camera();
  *header.mutable_plan() = session_.plan();
  GW_RETURN_IF_ERROR(embed_calibrations(calibrations_, header));
  v1::CreateArchiveResponse created;
  grpc::ClientContext create_context;
  set_deadline(create_context, kNodeCall);
  GW_RETURN_IF_ERROR(
      from_grpc(archive_stub_->CreateArchive(&create_context, create, &created), links_.camera->title()));
  v1::GetManifestRequest get;
  get.set_session(session_.name());
  v1::GetManifestResponse manifest;
  grpc::ClientContext get_context;
  set_deadline(get_context, kNodeCall);
  GW_RETURN_IF_ERROR(
      from_grpc(archive_stub_->GetManifest(&get_context, get, &manifest), links_.camera->title()));
  session_.set_patch_proven_count(0);
  // A session that goes on keeps to what its archive was begun with.
  embedded_ = manifest.manifest();
  embedded_.clear_frames();
  session_.set_warning(uncalibrated_warning(embedded_));
  for (const v1::Frame& frame : manifest.manifest().frames()) note_proven(frame);
  session_.set_step_count(static_cast<int>(steps_.size()));
  session_.set_proven_count(static_cast<int>(proven_.size()));
  report_(session_);
  return absl::OkStatus();
}

absl::Status Capture::send_images() {
  std::set<std::string> images;
  for (const Step& step : steps_) {
    if (!step.stimulus.image().empty()) images.insert(step.stimulus.image());
  }
  for (const std::string& image : images) {
    GW_RETURN_IF_ERROR(check_name("image", image));
    GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(images_ / image));
    for (const auto& display : links_.displays) {
      grpc::ClientContext context;
      set_deadline(context, kNodeCall);
      v1::PutImageResponse response;
      const auto writer = display->stub->PutImage(&context, &response);
      for (size_t at = 0; at < bytes.size(); at += kChunkBytes) {
        v1::PutImageRequest chunk;
        chunk.set_chunk(bytes.substr(at, kChunkBytes));
        if (!writer->Write(chunk)) break;
      }
      writer->WritesDone();
      GW_RETURN_IF_ERROR(from_grpc(writer->Finish(), display->link.title()));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> Capture::move_object(bool present) {
  v1::MoveObjectRequest request;
  request.set_present(present);
  v1::MoveObjectResponse response;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::minutes(2));
  GW_RETURN_IF_ERROR(
      from_grpc(stage_stub_->MoveObject(&context, request, &response), links_.camera->title()));
  return !response.needs_operator();
}

absl::Status Capture::take(const Group& group, std::stop_token stop) {
  const nanoseconds began = monotonic_now();
  const double before_s = session_.capture_seconds();
  Recording frames(*links_.camera, *links_.camera_stub, group.exposure_ms);
  GW_RETURN_IF_ERROR(frames.camera.wait_running(stop));
  GW_RETURN_IF_ERROR(links_.exchange_clocks(8));
  const int refused_before = session_.refused_count();
  std::vector<Step> pending, video;
  for (const Step& step : group.steps) (runs_once(step) ? video : pending).push_back(step);
  for (int shown = 0; !pending.empty(); ++shown) {
    if (shown - frames.vain_lessons > retries_of(session_.plan()))
      return unproven(fmt::format("{} steps had no proof after {} retries: {}", pending.size(),
                                  retries_of(session_.plan()), listed(pending)),
                      group, static_cast<int>(pending.size()), session_.refused_count() - refused_before);
    GW_RETURN_IF_ERROR(play(pending, frames, stop));
    if (stop.stop_requested()) return absl::CancelledError("stopped");
    std::erase_if(pending, [this](const Step& step) { return proven_.contains(step.number); });
    session_.set_capture_seconds(before_s + std::chrono::duration<double>(monotonic_now() - began).count());
    report_(session_);
  }
  if (video.empty()) return absl::OkStatus();
  GW_RETURN_IF_ERROR(take_video(group, video, frames, stop));
  session_.set_capture_seconds(before_s + std::chrono::duration<double>(monotonic_now() - began).count());
  return absl::OkStatus();
}

absl::Status Capture::unproven(const std::string& what, const Group& group, int step_count,
                               int refused) const {
  if (refused > step_count) {
    return absl::FailedPreconditionError(fmt::format(
        "{}; {} frames were right by their times, but their pixels showed another id: the times that "
        "a display or the camera reports are wrong, try glasswing calibrate sync",
        what, refused));
  }
  return absl::FailedPreconditionError(fmt::format(
      "{}; the camera's exposures ({} ms at {} fps) must fit between a picture's settling and the "
      "next one: try a shorter exposure_ms or a larger hold_refreshes",
      what, group.exposure_ms, links_.camera_info.frame_rate_hz()));
}

// Loads into every display what it shows; returns how many monitors will report each step.
absl::StatusOr<int> Capture::load(const std::string& program, const std::vector<Step>& steps) {
  // An id is never near the one before, in time or in bits.
  constexpr std::uint32_t kSpread = 40503, kIds = 1u << IdPatch::kBits;
  for (const Step& step : steps) patch_ids_[step.number] = ++showings_ * kSpread % kIds;
  int monitor_count = 0;
  for (const auto& display : links_.displays) {
    v1::LoadProgramRequest load;
    load.set_program(program);
    load.set_hold_refreshes(hold_refreshes_of(session_.plan()));
    for (const v1::DisplayCalibration& calibration : embedded_.display_calibrations()) {
      if (display->monitor(calibration.monitor()) != nullptr) *load.add_calibrations() = calibration;
    }
    for (const Step& step : steps) {
      v1::ProgramStep shown;
      shown.set_step(step.number);
      if (shows_id(step)) shown.set_patch_id(patch_ids_.at(step.number));
      if (display->monitor(step.stimulus.panel()) != nullptr) *shown.add_stimuli() = step.stimulus;
      // A lesson is shown twice and taken from the second time, when even a display or camera whose pictures
      // are older than it says shows it: what was learned wrong could not refuse anything.
      if (is_lesson(step)) {
        *load.add_steps() = shown;
        load.mutable_steps()->rbegin()->set_step(kNoStep);
      }
      *load.add_steps() = std::move(shown);
    }
    v1::LoadProgramResponse loaded;
    grpc::ClientContext context;
    set_deadline(context, std::chrono::minutes(2));
    GW_RETURN_IF_ERROR(from_grpc(display->stub->LoadProgram(&context, load, &loaded), display->link.title()));
    monitor_count += display->info.monitors_size();
  }
  return monitor_count;
}

absl::Status Capture::play(const std::vector<Step>& pending, Recording& frames, std::stop_token stop) {
  std::set<int> lessons_due;
  std::vector<Step> steps;
  for (const Step& step : pending) {
    if (is_lesson(step)) lessons_due.insert(step.number);
    if (!frames.lessons.contains(step.number)) steps.push_back(step);
  }
  frames.waiting.clear();
  const std::string program = fmt::format("{}-{}", session_.name(), ++program_number_);
  GW_ASSIGN_OR_RETURN(const int monitor_count, load(program, steps));
  const nanoseconds start_at = monotonic_now() + start_lead_;
  std::vector<const DisplayLink*> displays;
  for (const auto& display : links_.displays) displays.push_back(display.get());
  const nanoseconds step = common_step(displays, hold_refreshes_of(session_.plan()));
  std::vector<std::unique_ptr<DisplayFeed>> feeds;
  for (const DisplayLink* display : displays)
    feeds.push_back(std::make_unique<DisplayFeed>(*display, program, start_at, step));

  std::map<int, std::vector<MonitorWindow>> incomplete;  // by step, until every monitor has reported
  std::optional<nanoseconds> last_replaced;
  nanoseconds played_at{};
  while (!stop.stop_requested()) {
    bool playing = false;
    for (size_t i = 0; i < feeds.size(); ++i) {
      // The end is looked at first: what was pushed before it is then surely taken.
      const std::optional<absl::Status> end = feeds[i]->inbox.end();
      for (const v1::Presentation& shown : feeds[i]->inbox.take()) {
        const MonitorWindow window = rig_time_of(shown, *links_.displays[i]);
        last_replaced = std::max(last_replaced.value_or(window.replaced), window.replaced);
        if (window.step == kNoStep) continue;
        std::vector<MonitorWindow>& reported = incomplete[window.step];
        reported.push_back(window);
        if (static_cast<int>(reported.size()) < monitor_count) continue;
        frames.matcher.add_window(stable_window(reported));
        if (!frames.shown.insert(window.step).second)
          session_.set_retaken_count(session_.retaken_count() + 1);
        incomplete.erase(window.step);
      }
      if (end && absl::IsDeadlineExceeded(*end) && start_lead_ < kMostStartLead) {
        start_lead_ *= 2;  // the command came too late and was refused
        return absl::OkStatus();
      }
      if (end && !end->ok()) return *end;
      playing = playing || !end;
    }
    if (const auto end = frames.camera.inbox.end()) return *end;
    take_frames(frames);
    GW_ASSIGN_OR_RETURN(const bool judged, judge(frames.matcher.take(), lessons_due, frames));
    if (!judged) return absl::OkStatus();
    const nanoseconds now = monotonic_now();
    if (playing) {
      played_at = now;
    } else {
      const bool all_seen = !last_replaced || frames.matcher.frames_seen_until().value_or(nanoseconds(0)) >
                                                  *last_replaced + milliseconds(50);
      if (all_seen || now - played_at > kLastFrame) return absl::OkStatus();
    }
    if (now - frames.clocks_at > std::chrono::seconds(1)) {
      frames.clocks_at = now;
      GW_RETURN_IF_ERROR(links_.exchange_clocks(1));
    }
    std::this_thread::sleep_for(kPoll);
  }
  return absl::OkStatus();
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
  GW_RETURN_IF_ERROR(
      from_grpc(links_.camera_stub->KeepFrames(&context, request, &response), links_.camera->title()));
  for (const v1::Frame& frame : response.frames()) note_proven(frame);
  session_.set_refused_count(session_.refused_count() + response.refused());
  report_(session_);
  return response;
}

void Capture::note_proven(const v1::Frame& frame) {
  if (!proven_.insert(frame.step()).second) return;
  session_.set_proven_count(static_cast<int>(proven_.size()));
  if (frame.proof() == v1::PROOF_TIME_AND_PATCH)
    session_.set_patch_proven_count(session_.patch_proven_count() + 1);
}

void Capture::warn(const std::string& what) {
  session_.set_warning(session_.warning().empty() ? what : session_.warning() + "; " + what);
  report_(session_);
}

absl::Status Capture::seal() {
  v1::SealArchiveRequest request;
  request.set_session(session_.name());
  v1::SealArchiveResponse response;
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  return from_grpc(archive_stub_->SealArchive(&context, request, &response), links_.camera->title());
}

}  // namespace glasswing
