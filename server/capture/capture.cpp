#include "server/capture/capture.h"

#include <absl/cleanup/cleanup.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <thread>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/base/version.h"
#include "core/pattern/describe_step.h"
#include "core/pattern/id_patch.h"
#include "core/service/service.h"
#include "core/storage/image_name.h"
#include "server/metrics/server_metrics.h"
#include "server/rig/embed_calibrations.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
constexpr nanoseconds kMaxStartLead = std::chrono::seconds(2);
constexpr milliseconds kPoll(10);
constexpr int kNoStep = -1;
constexpr int kMaxUnproven = 1000;        // told of; a session is one message
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

}  // namespace

Capture::Capture(const NodeRegistry& rig, const CalibrationStore& calibrations, std::filesystem::path images,
                 v1::Session session, std::optional<bool> object_confirmed, StepLog& log,
                 std::function<void(const v1::Session&)> report)
    : rig_(rig),
      calibrations_(calibrations),
      images_(std::move(images)),
      session_(std::move(session)),
      object_confirmed_(object_confirmed),
      log_(log),
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
  if (no_room_) return {Kind::kNoRoom, std::string(status.message())};
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
  GW_RETURN_IF_ERROR(stored(archive_stub_->CreateArchive(&create_context, create, &created)));
  v1::GetManifestRequest get;
  get.set_session(session_.name());
  v1::GetManifestResponse manifest;
  grpc::ClientContext get_context;
  set_deadline(get_context, kNodeCall);
  GW_RETURN_IF_ERROR(
      from_grpc(archive_stub_->GetManifest(&get_context, get, &manifest), links_.camera->title()));
  session_.set_patch_proven_count(0);
  session_.set_archive_bytes(0);
  // A session that goes on keeps to what its archive was begun with.
  embedded_ = manifest.manifest();
  embedded_.clear_frames();
  session_.set_warning(uncalibrated_warning(embedded_));
  for (const v1::Frame& frame : manifest.manifest().frames()) note_proven(frame);
  for (v1::StepEvent& event : proven_steps(manifest.manifest())) log_.add(session_.name(), std::move(event));
  session_.set_step_count(static_cast<int>(steps_.size()));
  session_.set_proven_count(static_cast<int>(proven_.size()));
  GW_RETURN_IF_ERROR(check_room());
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
    if (image_name(bytes) != image) {
      return absl::DataLossError(fmt::format("{} is damaged: upload the photo again, with a new session",
                                             (images_ / image).string()));
    }
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
  group_began_ = monotonic_now();
  seconds_before_ = session_.capture_seconds();
  const absl::Cleanup end = [this] { group_began_.reset(); };
  Recording frames(*links_.camera, *links_.camera_stub, group.exposure_ms);
  GW_RETURN_IF_ERROR(frames.camera.wait_running(stop));
  GW_RETURN_IF_ERROR(links_.exchange_clocks(8));
  const int refused_before = session_.refused_count();
  std::vector<Step> pending, video;
  for (const Step& step : group.steps) (runs_once(step) ? video : pending).push_back(step);
  for (int shown = 0; !pending.empty(); ++shown) {
    if (shown - frames.vain_lessons > retries_of(session_.plan())) {
      note_unproven(pending);
      return unproven(fmt::format("{} steps had no proof after {} retries: {}", pending.size(),
                                  retries_of(session_.plan()), listed(pending)),
                      group, static_cast<int>(pending.size()), session_.refused_count() - refused_before);
    }
    GW_RETURN_IF_ERROR(play(pending, frames, stop));
    if (stop.stop_requested()) return absl::CancelledError("stopped");
    std::erase_if(pending, [this](const Step& step) { return proven_.contains(step.number); });
    session_.set_capture_seconds(seconds());
    tell_retaken(pending, frames);
    report_(session_);
  }
  if (video.empty()) return absl::OkStatus();
  GW_RETURN_IF_ERROR(take_video(group, video, frames, stop));
  session_.set_capture_seconds(seconds());
  return absl::OkStatus();
}

double Capture::seconds() const {
  if (!group_began_) return session_.capture_seconds();
  return seconds_before_ + std::chrono::duration<double>(monotonic_now() - *group_began_).count();
}

void Capture::tell(int step, v1::StepOutcome outcome, const std::string& why) {
  v1::StepEvent event;
  event.set_step(step);
  event.set_outcome(outcome);
  event.set_why(why);
  event.set_seconds(seconds());
  log_.add(session_.name(), std::move(event));
}

void Capture::tell_retaken(const std::vector<Step>& steps, const Recording& frames) {
  for (const Step& step : steps) {
    const char* why = frames.lessons.contains(step.number) ? nullptr  // it waits with the camera for others
                      : !frames.shown_now.contains(step.number) ? "it was not shown on all monitors"
                      : !frames.matched.contains(step.number)
                          ? "no exposure lay in the time in which it surely was on screen"
                      : is_lesson(step)
                          ? "its id patch was not seen"
                          : "its frame's pixels showed another id, or it came too late to be kept";
    if (why != nullptr) tell(step.number, v1::STEP_OUTCOME_RETAKEN, why);
  }
}

void Capture::note_unproven(const std::vector<Step>& steps) {
  for (const Step& step : steps) {
    if (session_.unproven_size() == kMaxUnproven) break;
    v1::UnprovenStep& unproven = *session_.add_unproven();
    unproven.set_step(step.number);
    unproven.set_what(describe(step));
  }
  report_(session_);
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
  frames.shown_now.clear();
  frames.matched.clear();
  const std::string program = fmt::format("{}-{}", session_.name(), ++program_number_);
  GW_ASSIGN_OR_RETURN(const int monitor_count, load(program, steps));
  const nanoseconds start_at = monotonic_now() + start_lead_;
  std::vector<const DisplayLink*> displays;
  for (const auto& display : links_.displays) displays.push_back(display.get());
  const nanoseconds step = common_step(displays, hold_refreshes_of(session_.plan()));
  std::vector<std::unique_ptr<DisplayStream>> feeds;
  for (const DisplayLink* display : displays)
    feeds.push_back(std::make_unique<DisplayStream>(*display, program, start_at, step));

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
        frames.shown_now.insert(window.step);
        tell(window.step, v1::STEP_OUTCOME_SHOWN);
        if (!frames.shown.insert(window.step).second) {
          session_.set_retaken_count(session_.retaken_count() + 1);
          server_metrics().steps_retaken.Increment();
        }
        incomplete.erase(window.step);
      }
      if (end && absl::IsDeadlineExceeded(*end) && start_lead_ < kMaxStartLead) {
        start_lead_ *= 2;  // the command came too late and was refused
        return absl::OkStatus();
      }
      if (end && !end->ok()) return *end;
      playing = playing || !end;
    }
    if (const auto end = frames.camera.inbox.end()) return *end;
    take_frames(frames);
    const std::vector<FrameMatcher::Match> matches = frames.matcher.take();
    for (const FrameMatcher::Match& match : matches) frames.matched.insert(match.step);
    GW_ASSIGN_OR_RETURN(const bool judged, judge(matches, lessons_due, frames));
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

absl::Status Capture::seal() {
  v1::SealArchiveRequest request;
  request.set_session(session_.name());
  v1::SealArchiveResponse response;
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  return stored(archive_stub_->SealArchive(&context, request, &response));
}

}  // namespace glasswing
