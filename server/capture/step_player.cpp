#include "server/capture/step_player.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <future>
#include <list>
#include <memory>
#include <thread>
#include <utility>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/pattern/id_patch.h"
#include "core/process/pause.h"
#include "core/service/service.h"
#include "server/capture/patch_learning.h"
#include "server/capture/rig_watch.h"
#include "server/rig/exposure_triggers.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
constexpr nanoseconds kMaxStartLead = std::chrono::seconds(10);
constexpr milliseconds kPoll(10);
constexpr int kNoStep = -1;
constexpr milliseconds kLastFrameWait(1500);  // for frames, after the last step has been replaced
constexpr std::chrono::seconds kClockInterval(1);

constexpr milliseconds kAskDelay(20);  // from a step's light to its picture
constexpr int kAsked = 3;              // how often one picture is requested in a showing
constexpr std::chrono::seconds kSaidEvery(5);

// Returns the time at which the newest frame has certainly ended, which may be slightly ahead by its camera's
// clock.
nanoseconds wait_past(const Recording& recording, const std::stop_token& stop) {
  const std::vector<FrameTime> frames = recording.recent_frames();
  nanoseconds end{};
  for (const FrameTime& frame : frames) end = std::max(end, frame.end + frame.uncertainty);
  while (monotonic_now() < end && pause(stop, kPoll)) {
  }
  return monotonic_now();
}

double seconds_of(nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

}  // namespace

// One program as it plays on all displays.
class ProgramFeeds {
 public:
  // `pictures`: of the program. Triggered cameras expose for `exposure_ms`.
  ProgramFeeds(const CameraViews& views, const std::string& program, int pictures, int monitor_count,
               nanoseconds start_at, int hold_refreshes, double exposure_ms, bool hold_last = false)
      : monitor_count_(monitor_count) {
    for (const auto& display : views.front()->setup.links.displays) displays_.push_back(display.get());
    const nanoseconds step = common_step(displays_, hold_refreshes);
    for (const auto& view : views) {
      const RigLinks& links = view->setup.links;
      if (!view->failure.ok() || !ExposureTriggers::are_wanted(links)) continue;
      triggers_.emplace_back(links, pictures, monitor_count, step_time(displays_, hold_refreshes),
                             exposure_ms);
    }
    for (const DisplayLink* display : displays_) {
      feeds_.push_back(std::make_unique<PresentationStream>(
          *display, program, start_at, step,
          [this, display](const v1::Presentation& replaced) {
            for (ExposureTriggers& camera : triggers_) camera.note(replaced, *display);
          },
          hold_last));
    }
  }

  // Calls `shown` for each step that the last monitor has reported since the previous call. Returns false
  // when all displays have finished. DEADLINE_EXCEEDED: a display received the command after `start_at` and
  // rejected it.
  absl::StatusOr<bool> poll(const std::function<void(const StableWindow&)>& shown) {
    bool playing = false;
    for (size_t i = 0; i < feeds_.size(); ++i) {
      // Read the end first: everything pushed before it is then certain to be taken.
      const std::optional<absl::Status> end = feeds_[i]->inbox.end();
      for (const v1::Presentation& presentation : feeds_[i]->inbox.take())
        add(rig_time_of(presentation, *displays_[i]), shown);
      if (end && !end->ok()) return *end;
      playing = playing || !end;
    }
    return playing;
  }

  // When the latest reported picture was replaced; none before the first report.
  std::optional<nanoseconds> last_replaced() const { return last_replaced_; }

 private:
  void add(const MonitorWindow& window, const std::function<void(const StableWindow&)>& shown) {
    last_replaced_ = std::max(last_replaced_.value_or(window.replaced), window.replaced);
    if (window.step == kNoStep) return;
    std::vector<MonitorWindow>& reported = incomplete_[window.step];
    reported.push_back(window);
    if (static_cast<int>(reported.size()) < monitor_count_) return;
    shown(stable_window(reported));
    incomplete_.erase(window.step);
  }

  const int monitor_count_;
  std::vector<const DisplayLink*> displays_;
  std::deque<ExposureTriggers> triggers_;                   // of triggered cameras
  std::vector<std::unique_ptr<PresentationStream>> feeds_;  // they use the triggers
  std::map<int, std::vector<MonitorWindow>> incomplete_;    // by step, until every monitor has reported it
  std::optional<nanoseconds> last_replaced_;
};

// The picture of a held step, as requested from a camera.
class PictureDemand {
 public:
  PictureDemand(const Step& step, Watching& camera)
      : camera_(camera),
        links_(camera.view.setup.links),
        progress_(camera.view.progress),
        what_(fmt::format("picture {} of {}", step.number + 1, camera.view.setup.steps.size())) {}

  Watching& camera() const { return camera_; }

  absl::Status ask(std::stop_token stop) {
    ++asked_;
    asked_at_ = monotonic_now();
    if (asked_ == 1) first_asked_at_ = said_at_ = asked_at_;
    v1::TakePictureRequest request;
    request.set_what(what_);
    request.set_request_id(random_token());
    v1::TakePictureResponse response;
    GW_RETURN_IF_ERROR(
        links_.camera->call("take a picture", std::move(stop), [&](grpc::ClientContext& context) {
          return links_.camera_stub->TakePicture(&context, request, &response);
        }));
    due_ = response.due();
    if (due_.by_hand() && asked_ == 1) say();
    return absl::OkStatus();
  }

  // So many pictures have arrived. Returns whether they are the first.
  bool note_came(int count) { return std::exchange(came_, came_ + count) == 0; }
  // To be called repeatedly: reports how long it takes, and requests it again. False: pictures arrived, but
  // not of this step. FAILED_PRECONDITION: none arrived, despite repeated requests.
  absl::StatusOr<bool> look(std::stop_token stop) {
    const nanoseconds now = monotonic_now();
    if (now - said_at_ >= kSaidEvery || came_ != said_came_) {
      said_came_ = came_;
      GW_RETURN_IF_ERROR(find_problem(stop));
      say();
    }
    const nanoseconds patience(due_.patience_ns());
    if (patience == nanoseconds(0) || now - asked_at_ < patience) return true;
    if (asked_ < kAsked) {
      GW_RETURN_IF_ERROR(ask(std::move(stop)));
      return true;
    }
    GW_RETURN_IF_ERROR(find_problem(std::move(stop)));
    if (came_ > 0) return false;
    return absl::FailedPreconditionError(fmt::format(
        "{}; is the camera switched on and awake, and does its command work by hand? Then: glasswing "
        "resume {}",
        text(), progress_.session().name()));
  }
  // The step is over.
  void end() {
    if (progress_.session().reason().starts_with(kWaitsForPicture)) progress_.note_waiting("");
  }

 private:
  absl::Status find_problem(std::stop_token stop) {
    v1::GetCameraResponse camera;
    GW_RETURN_IF_ERROR(
        links_.camera->call("tell what it does", std::move(stop), [&](grpc::ClientContext& context) {
          return links_.camera_stub->GetCamera(&context, v1::GetCameraRequest(), &camera);
        }));
    due_.set_problem(camera.due().problem());
    return absl::OkStatus();
  }
  std::string text() const {
    const double waited_s = seconds_of(monotonic_now() - first_asked_at_);
    std::string text = due_.by_hand() && waited_s < 1.0
                           ? fmt::format("press the camera's button: {} is due", what_)
                           : fmt::format("the folder has waited {:.0f} s for {}", waited_s, what_);
    if (came_ > 0) text += fmt::format("; {} arrived that do not show it", came_ == 1 ? "a file" : "files");
    if (!due_.problem().empty()) text += " (" + due_.problem() + ")";
    return text;
  }
  void say() {
    said_at_ = monotonic_now();
    progress_.note_waiting(fmt::format("{}: {}", kWaitsForPicture, text()));
  }

  Watching& camera_;
  const RigLinks& links_;
  CaptureProgress& progress_;
  const std::string what_;
  v1::PictureDue due_;
  int asked_ = 0, came_ = 0, said_came_ = 0;
  nanoseconds asked_at_{}, first_asked_at_{}, said_at_{};
};

RigLinks& StepPlayer::links() const {
  const auto view = std::ranges::find_if(views_, [](const auto& each) { return each->failure.ok(); });
  return (view == views_.end() ? views_.front() : *view)->setup.links;
}

absl::Status StepPlayer::measure_clocks(int count, const std::stop_token& stop) {
  clocks_measured_at_ = monotonic_now();
  GW_RETURN_IF_ERROR(links().exchange_clocks(count, stop));
  for (const auto& view : views_) {
    if (&view->setup.links == &links() || !view->failure.ok()) continue;
    GW_RETURN_IF_ERROR(view->setup.links.camera->exchange_clocks(count, kNodeCall, stop));
  }
  return absl::OkStatus();
}

absl::StatusOr<int> StepPlayer::load(const std::string& program, const std::vector<Step>& steps,
                                     double exposure_ms, std::stop_token stop) {
  // Ids of successive showings differ in many bits.
  constexpr std::uint32_t kSpread = 40503, kIds = 1u << IdPatch::kBits;
  loaded_.clear();
  for (const Step& step : steps) {
    loaded_[step.number] = step;
    patch_ids_[step.number] = ++showings_ * kSpread % kIds;
  }
  int monitor_count = 0;
  for (const auto& display : links().displays) {
    GW_RETURN_IF_ERROR(load(*display, program, steps, exposure_ms, stop));
    monitor_count += display->info.monitors_size();
  }
  return monitor_count;
}

absl::Status StepPlayer::load(DisplayLink& display, const std::string& program,
                              const std::vector<Step>& steps, double exposure_ms, std::stop_token stop) {
  v1::LoadProgramRequest load;
  load.set_program(program);
  load.set_request_id(random_token());
  load.set_hold_refreshes(hold_refreshes());
  for (const auto& view : views_) {
    GW_ASSIGN_OR_RETURN(const std::optional<v1::LinePulse> pulse,
                        line_pulse(view->setup.links, display, load.hold_refreshes(), exposure_ms));
    if (!pulse) continue;
    *load.mutable_line() = *pulse;
    raises_line_ = true;
  }
  for (const v1::DisplayCalibration& calibration : views_.front()->setup.header.display_calibrations()) {
    if (display.monitor(calibration.monitor()) != nullptr) *load.add_calibrations() = calibration;
  }
  // The report of a picture determines when the next one can be exposed, so a triggered camera needs a
  // picture before the first.
  const bool triggered = std::ranges::any_of(
      views_, [](const auto& view) { return !view->setup.links.camera_info.trigger().empty(); });
  if (triggered) load.add_steps()->set_step(kNoStep);
  for (const Step& step : steps) {
    v1::ProgramStep shown;
    shown.set_step(step.number);
    if (shows_id(step)) shown.set_patch_id(patch_ids_.at(step.number));
    if (display.monitor(step.stimulus.panel()) != nullptr) *shown.add_stimuli() = step.stimulus;
    // A patch-learning step is shown twice and recorded the second time. By then it is visible even if a
    // display or camera is slower than it reports. A patch learned from the wrong frame could not reject
    // anything.
    if (is_patch_learning_step(step)) {
      *load.add_steps() = shown;
      load.mutable_steps()->rbegin()->set_step(kNoStep);
    }
    *load.add_steps() = std::move(shown);
  }
  pictures_ = load.steps_size();
  v1::LoadProgramResponse loaded;
  return display.link.call("draw a program", std::move(stop), [&](grpc::ClientContext& context) {
    return display.stub->LoadProgram(&context, load, &loaded);
  });
}

absl::StatusOr<std::vector<v1::Frame>> StepPlayer::records_of(const std::vector<FrameMatcher::Match>& matches,
                                                              const Watching& camera) const {
  const CaptureSetup& setup = camera.view.setup;
  const double calibrated_gain = setup.header.camera_calibration().gain();
  std::vector<v1::Frame> records;
  for (const FrameMatcher::Match& match : matches) {
    const v1::FrameTaken* const found = camera.recording.taken(match);
    if (found == nullptr) continue;  // the camera does not hold it any more either: the step is shown again
    const v1::FrameTaken& taken = *found;
    if (calibrated_gain != 0.0 && std::abs(taken.gain() - calibrated_gain) > 0.01 * calibrated_gain) {
      return absl::FailedPreconditionError(fmt::format(
          "{} runs at gain {}, its calibration is for gain {}: set it back, or measure it again with "
          "glasswing calibrate camera",
          views_.size() == 1 ? "the camera" : setup.links.camera->title(), taken.gain(), calibrated_gain));
    }
    const Step& step = loaded_.at(match.step);
    v1::Frame& frame = records.emplace_back();
    frame.set_object(step.object);
    *frame.mutable_stimulus() = step.stimulus;
    frame.set_step(step.number);
    frame.set_exposure_ms(taken.exposure_ms());
    frame.set_gain(taken.gain());
    frame.set_exposure_start_ns(match.frame.start.count());
    frame.set_exposure_end_ns(match.frame.end.count());
    frame.set_sequence(match.frame.sequence);
    if (setup.has_patches() && shows_id(step)) frame.set_patch_id(patch_ids_.at(step.number));
  }
  return records;
}

std::string StepPlayer::next_program() {
  return fmt::format("{}-{}", views_.front()->progress.session().name(), ++program_number_);
}

absl::Status StepPlayer::play(const std::vector<Step>& steps, std::span<Watching> cameras,
                              std::stop_token stop) {
  for (const Watching& camera : cameras) camera.recording.begin_showing();
  if (cameras.front().view.setup.links.camera_info.on_demand()) {
    for (const Step& step : steps) {
      std::vector<Watching*> needing;
      for (Watching& camera : cameras) {
        if (!camera.is_over && camera.steps.contains(step.number)) needing.push_back(&camera);
      }
      if (!needing.empty()) GW_RETURN_IF_ERROR(play_held(step, needing, stop));
    }
    return absl::OkStatus();
  }
  const std::string program = next_program();
  GW_ASSIGN_OR_RETURN(const int monitor_count,
                      load(program, steps, cameras.front().recording.exposure_ms(), stop));
  while (true) {
    GW_ASSIGN_OR_RETURN(const bool in_time, play_loaded(program, monitor_count, cameras, stop));
    if (in_time) return absl::OkStatus();
    start_lead_ *= 2;
  }
}

absl::Status StepPlayer::judge(std::span<Watching> cameras) const {
  std::vector<std::future<absl::Status>> judging;
  for (Watching& camera : cameras) {
    if (const auto end = camera.recording.end()) return *end;
    camera.view.progress.note_frames_taken(camera.recording.take_frames());
    if (camera.is_over) continue;
    GW_ASSIGN_OR_RETURN(std::vector<v1::Frame> frames, records_of(camera.recording.take_matches(), camera));
    // With frames it calls the camera's node.
    const bool calls = !frames.empty() && cameras.size() > 1;
    judging.push_back(std::async(calls ? std::launch::async : std::launch::deferred,
                                 [&camera, frames = std::move(frames)]() mutable -> absl::Status {
                                   GW_ASSIGN_OR_RETURN(const bool go_on, camera.judge(std::move(frames)));
                                   camera.is_over = !go_on;
                                   return absl::OkStatus();
                                 }));
  }
  absl::Status judged;
  for (std::future<absl::Status>& each : judging) judged.Update(each.get());
  return judged;
}

absl::StatusOr<bool> StepPlayer::play_loaded(const std::string& program, int monitor_count,
                                             std::span<Watching> cameras, std::stop_token stop) {
  ProgramFeeds feeds(views_, program, pictures_, monitor_count, monotonic_now() + start_lead_,
                     hold_refreshes(), cameras.front().recording.exposure_ms());
  const auto note_shown = [&](const StableWindow& window) {
    for (const Watching& camera : cameras) {
      if (camera.is_over || !camera.steps.contains(window.step)) continue;
      const bool first = camera.recording.add_window(window);
      if (!RigWatch::is_repeat(window.step)) camera.view.progress.note_shown(window.step, !first);
    }
  };
  nanoseconds played_at{};
  while (!stop.stop_requested()) {
    const absl::StatusOr<bool> playing = feeds.poll(note_shown);
    if (absl::IsDeadlineExceeded(playing.status()) && start_lead_ < kMaxStartLead) return false;
    GW_RETURN_IF_ERROR(playing.status());
    GW_RETURN_IF_ERROR(judge(cameras));
    if (std::ranges::all_of(cameras, &Watching::is_over)) return true;
    const nanoseconds now = monotonic_now();
    if (*playing) {
      played_at = now;
    } else {
      const std::optional<nanoseconds> replaced = feeds.last_replaced();
      // The line rises in the black picture that follows, too: its frame is the last.
      const auto all_frames = [&](const Watching& camera) {
        const bool on_line = raises_line_ && !camera.view.setup.links.camera_info.trigger().empty();
        const nanoseconds tail = on_line ? nanoseconds(0) : milliseconds(50);
        return camera.recording.frames_seen_until().value_or(nanoseconds(0)) > *replaced + tail;
      };
      const bool all_seen = !replaced || std::ranges::all_of(cameras, [&](const Watching& camera) {
        return camera.is_over || all_frames(camera);
      });
      if (all_seen || now - played_at > kLastFrameWait) return true;
    }
    if (now - clocks_measured_at_ > kClockInterval) GW_RETURN_IF_ERROR(measure_clocks(1, stop));
    std::this_thread::sleep_for(kPoll);
  }
  return true;
}

absl::StatusOr<std::optional<StableWindow>> StepPlayer::wait_shown(ProgramFeeds& feeds,
                                                                   std::span<Watching* const> cameras,
                                                                   std::stop_token stop) {
  std::optional<StableWindow> shown;
  while (!shown) {
    GW_ASSIGN_OR_RETURN(const bool playing, feeds.poll([&](const StableWindow& window) { shown = window; }));
    if (!playing) return absl::AbortedError("a display has ended a step that it should hold");
    if (!pause(stop, kPoll)) return std::nullopt;
  }
  nanoseconds error{};
  for (const Watching* camera : cameras)
    error = std::max(error, camera->view.setup.links.camera->node_from_rig(monotonic_now()).error);
  const nanoseconds lit = shown->from + error + kAskDelay;
  while (monotonic_now() < lit) {
    if (!pause(stop, kPoll)) return std::nullopt;
  }
  return shown;
}

absl::StatusOr<bool> StepPlayer::judge_held(const Step& step, const StableWindow& shown,
                                            PictureDemand& demand, std::stop_token stop) const {
  Watching& camera = demand.camera();
  CaptureProgress& progress = camera.view.progress;
  Recording& recording = camera.recording;
  if (const auto end = recording.end()) return *end;
  std::vector<v1::Frame> frames;
  if (const int count = recording.take_frames(); count > 0) {
    progress.note_frames_taken(count);
    // The step is shown until now, and was certainly shown when the frame arrived.
    StableWindow window = shown;
    window.until = window.patch_until = wait_past(recording, stop);
    const bool first = recording.add_window(window);
    if (demand.note_came(count)) progress.note_shown(step.number, !first);
    GW_ASSIGN_OR_RETURN(frames, records_of(recording.take_matches(), camera));
  }
  GW_ASSIGN_OR_RETURN(const bool go_on, camera.judge(std::move(frames)));
  camera.is_over = !go_on;
  const bool learns = is_patch_learning_step(step) && recording.was_matched_now(step.number);
  if (!go_on || learns || progress.is_proven(step.number)) return true;
  GW_ASSIGN_OR_RETURN(const bool waits, demand.look(std::move(stop)));
  return !waits;
}

absl::Status StepPlayer::play_held(const Step& step, std::span<Watching* const> cameras,
                                   std::stop_token stop) {
  const double exposure_ms = cameras.front()->recording.exposure_ms();
  const std::string program = next_program();
  GW_ASSIGN_OR_RETURN(const int monitor_count, load(program, {step}, exposure_ms, stop));
  if (monotonic_now() - clocks_measured_at_ > kClockInterval) GW_RETURN_IF_ERROR(measure_clocks(1, stop));
  ProgramFeeds feeds(views_, program, pictures_, monitor_count, monotonic_now() + start_lead_,
                     hold_refreshes(), exposure_ms, true);
  const absl::StatusOr<std::optional<StableWindow>> shown = wait_shown(feeds, cameras, stop);
  if (absl::IsDeadlineExceeded(shown.status()) && start_lead_ < kMaxStartLead) {
    start_lead_ *= 2;
    return play_held(step, cameras, stop);
  }
  GW_RETURN_IF_ERROR(shown.status());
  if (!*shown) return absl::OkStatus();
  std::list<PictureDemand> due;
  for (Watching* camera : cameras) GW_RETURN_IF_ERROR(due.emplace_back(step, *camera).ask(stop));
  while (!stop.stop_requested()) {
    GW_ASSIGN_OR_RETURN(const bool playing, feeds.poll([](const StableWindow&) {}));
    if (!playing) return absl::AbortedError("a display has ended a step that it should hold");
    for (auto demand = due.begin(); demand != due.end();) {
      const absl::StatusOr<bool> over = judge_held(step, **shown, *demand, stop);
      if (over.ok() && !*over) {
        ++demand;
        continue;
      }
      if (!over.ok()) {
        if (!absl::IsFailedPrecondition(over.status())) return over.status();
        demand->camera().failure = over.status();
        demand->camera().is_over = true;
      }
      demand->end();
      demand = due.erase(demand);
    }
    if (due.empty()) break;
    (void)pause(stop, kPoll);
  }
  return absl::OkStatus();
}

}  // namespace glasswing
