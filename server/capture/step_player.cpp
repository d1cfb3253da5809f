#include "server/capture/step_player.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <thread>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/pattern/id_patch.h"
#include "core/service/service.h"
#include "server/capture/patch_learning.h"
#include "server/capture/rig_watch.h"
#include "server/rig/exposure_triggers.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
constexpr nanoseconds kMaxStartLead = std::chrono::seconds(10);
constexpr milliseconds kPoll(10);
constexpr int kNoStep = -1;
constexpr milliseconds kLastFrameWait(1500);  // for frames, after the last step has been replaced
constexpr std::chrono::seconds kClockInterval(1);

// One program as it plays on all displays.
class ProgramFeeds {
 public:
  // `pictures`: of the program. The camera exposes for `exposure_ms` where it is triggered.
  ProgramFeeds(const RigLinks& links, const std::string& program, int pictures, int monitor_count,
               nanoseconds start_at, int hold_refreshes, double exposure_ms)
      : monitor_count_(monitor_count) {
    for (const auto& display : links.displays) displays_.push_back(display.get());
    const nanoseconds step = common_step(displays_, hold_refreshes);
    if (ExposureTriggers::are_wanted(links)) {
      triggers_.emplace(links, pictures, monitor_count, step_time(displays_, hold_refreshes), exposure_ms);
    }
    for (const DisplayLink* display : displays_) {
      feeds_.push_back(std::make_unique<PresentationStream>(
          *display, program, start_at, step, [this, display](const v1::Presentation& replaced) {
            if (triggers_) triggers_->note(replaced, *display);
          }));
    }
  }

  // Calls `shown` for each step that the last monitor has reported since the previous call. Returns false
  // when all displays have finished. DEADLINE_EXCEEDED: a display got the command after `start_at` and
  // refused it.
  absl::StatusOr<bool> poll(const std::function<void(const StableWindow&)>& shown) {
    bool playing = false;
    for (size_t i = 0; i < feeds_.size(); ++i) {
      // Read the end first: everything pushed before it is then sure to be taken.
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
  std::optional<ExposureTriggers> triggers_;
  std::vector<std::unique_ptr<PresentationStream>> feeds_;  // they use the triggers
  std::map<int, std::vector<MonitorWindow>> incomplete_;    // by step, until every monitor has reported it
  std::optional<nanoseconds> last_replaced_;
};

}  // namespace

absl::Status StepPlayer::measure_clocks(int count, const std::stop_token& stop) {
  clocks_measured_at_ = monotonic_now();
  return setup_.links.exchange_clocks(count, stop);
}

absl::StatusOr<int> StepPlayer::load(const std::string& program, const std::vector<Step>& steps,
                                     std::stop_token stop) {
  // Ids of successive showings differ in many bits.
  constexpr std::uint32_t kSpread = 40503, kIds = 1u << IdPatch::kBits;
  loaded_.clear();
  for (const Step& step : steps) {
    loaded_[step.number] = step;
    patch_ids_[step.number] = ++showings_ * kSpread % kIds;
  }
  int monitor_count = 0;
  for (const auto& display : setup_.links.displays) {
    GW_RETURN_IF_ERROR(load(*display, program, steps, stop));
    monitor_count += display->info.monitors_size();
  }
  return monitor_count;
}

absl::Status StepPlayer::load(DisplayLink& display, const std::string& program,
                              const std::vector<Step>& steps, std::stop_token stop) {
  v1::LoadProgramRequest load;
  load.set_program(program);
  load.set_request_id(random_token());
  load.set_hold_refreshes(hold_refreshes_of(progress_.session().plan()));
  for (const v1::DisplayCalibration& calibration : setup_.header.display_calibrations()) {
    if (display.monitor(calibration.monitor()) != nullptr) *load.add_calibrations() = calibration;
  }
  // The report of a picture tells when the next one can be exposed, so a triggered camera needs one before.
  if (!setup_.links.camera_info.trigger().empty()) load.add_steps()->set_step(kNoStep);
  for (const Step& step : steps) {
    v1::ProgramStep shown;
    shown.set_step(step.number);
    if (shows_id(step)) shown.set_patch_id(patch_ids_.at(step.number));
    if (display.monitor(step.stimulus.panel()) != nullptr) *shown.add_stimuli() = step.stimulus;
    // A patch learning step is shown twice and recorded the second time. By then it is visible even if a
    // display or camera is slower than it reports. A patch learned from the wrong frame could not refuse
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
                                                              const Recording& recording) const {
  const double calibrated_gain = setup_.header.camera_calibration().gain();
  std::vector<v1::Frame> records;
  for (const FrameMatcher::Match& match : matches) {
    const v1::FrameTaken* const found = recording.taken(match);
    if (found == nullptr) continue;  // the camera does not hold it any more either: the step is shown again
    const v1::FrameTaken& taken = *found;
    if (calibrated_gain != 0.0 && std::abs(taken.gain() - calibrated_gain) > 0.01 * calibrated_gain) {
      return absl::FailedPreconditionError(fmt::format(
          "the camera runs at gain {}, its calibration is of gain {}: set it back, or measure it again with "
          "glasswing calibrate camera",
          taken.gain(), calibrated_gain));
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
    if (setup_.has_patches() && shows_id(step)) frame.set_patch_id(patch_ids_.at(step.number));
  }
  return records;
}

absl::Status StepPlayer::play(const std::vector<Step>& steps, Recording& recording, const Judge& judge,
                              std::stop_token stop) {
  recording.begin_showing();
  const std::string program = fmt::format("{}-{}", progress_.session().name(), ++program_number_);
  GW_ASSIGN_OR_RETURN(const int monitor_count, load(program, steps, stop));
  while (true) {
    GW_ASSIGN_OR_RETURN(const bool in_time, play_loaded(program, monitor_count, recording, judge, stop));
    if (in_time) return absl::OkStatus();
    start_lead_ *= 2;
  }
}

absl::StatusOr<bool> StepPlayer::play_loaded(const std::string& program, int monitor_count,
                                             Recording& recording, const Judge& judge, std::stop_token stop) {
  ProgramFeeds feeds(setup_.links, program, pictures_, monitor_count, monotonic_now() + start_lead_,
                     hold_refreshes_of(progress_.session().plan()), recording.exposure_ms());
  const auto note_shown = [&](const StableWindow& window) {
    const bool first = recording.add_window(window);
    if (!RigWatch::is_repeat(window.step)) progress_.note_shown(window.step, !first);
  };
  nanoseconds played_at{};
  while (!stop.stop_requested()) {
    const absl::StatusOr<bool> playing = feeds.poll(note_shown);
    if (absl::IsDeadlineExceeded(playing.status()) && start_lead_ < kMaxStartLead) return false;
    GW_RETURN_IF_ERROR(playing.status());
    if (const auto end = recording.end()) return *end;
    progress_.note_frames_taken(recording.take_frames());
    GW_ASSIGN_OR_RETURN(std::vector<v1::Frame> frames, records_of(recording.take_matches(), recording));
    GW_ASSIGN_OR_RETURN(const bool go_on, judge(std::move(frames)));
    if (!go_on) return true;
    const nanoseconds now = monotonic_now();
    if (*playing) {
      played_at = now;
    } else {
      const std::optional<nanoseconds> replaced = feeds.last_replaced();
      const bool all_seen =
          !replaced || recording.frames_seen_until().value_or(nanoseconds(0)) > *replaced + milliseconds(50);
      if (all_seen || now - played_at > kLastFrameWait) return true;
    }
    if (now - clocks_measured_at_ > kClockInterval) GW_RETURN_IF_ERROR(measure_clocks(1, stop));
    std::this_thread::sleep_for(kPoll);
  }
  return true;
}

}  // namespace glasswing
