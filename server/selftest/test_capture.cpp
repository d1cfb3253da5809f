#include "server/selftest/test_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <thread>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/service/service.h"
#include "server/rig/exposure_triggers.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
constexpr std::chrono::seconds kStarted(20);  // how long a camera may take to start
constexpr milliseconds kStartLead(300);       // from the command to the first step
constexpr milliseconds kTail(100);
constexpr milliseconds kLastFrame(1500);  // how late a frame may arrive after the last step was replaced
constexpr milliseconds kPoll(10);
constexpr int kNoStep = -1;

absl::Status load(const RigLinks& rig, DisplayLink& display, const std::string& program,
                  const TestCapture& test, std::stop_token stop) {
  v1::LoadProgramRequest request;
  request.set_program(program);
  request.set_hold_refreshes(test.hold_refreshes);
  if (test.triggered) {
    GW_ASSIGN_OR_RETURN(const std::optional<v1::LinePulse> pulse,
                        line_pulse(rig, display, test.hold_refreshes, test.exposure_ms));
    if (pulse) *request.mutable_line() = *pulse;
  }
  // Its report determines when the next one can be exposed.
  if (test.triggered) request.add_steps()->set_step(kNoStep);
  for (const v1::ProgramStep& step : test.steps) {
    v1::ProgramStep& own = *request.add_steps();
    own.set_step(step.step());
    for (const v1::Stimulus& stimulus : step.stimuli()) {
      if (display.monitor(stimulus.panel()) != nullptr) *own.add_stimuli() = stimulus;
    }
  }
  request.set_request_id(random_token());
  v1::LoadProgramResponse response;
  return display.link.call("draw a program", std::move(stop), [&](grpc::ClientContext& context) {
    return display.stub->LoadProgram(&context, request, &response);
  });
}

}  // namespace

absl::StatusOr<TestCaptureRecord> run_test_capture(RigLinks& rig, const TestCapture& test,
                                                   std::stop_token stop) {
  if (rig.camera_info.on_demand()) {
    return absl::FailedPreconditionError(fmt::format(
        "{} takes pictures only on request, so no times can be measured with it", rig.camera->title()));
  }
  CaptureStream camera(*rig.camera, *rig.camera_stub, test.exposure_ms, random_token(), test.triggered);
  GW_RETURN_IF_ERROR(camera.wait_running(stop, kStarted));
  GW_RETURN_IF_ERROR(rig.exchange_clocks(8));
  const std::string program = fmt::format("trial-{}", monotonic_now().count());
  for (DisplayLink* display : test.displays) GW_RETURN_IF_ERROR(load(rig, *display, program, test, stop));
  const nanoseconds start_at = monotonic_now() + kStartLead;
  const std::vector<const DisplayLink*> displays(test.displays.begin(), test.displays.end());
  const nanoseconds step = common_step(displays, test.hold_refreshes);
  std::optional<ExposureTriggers> triggers;
  if (test.triggered && ExposureTriggers::are_wanted(rig)) {
    int monitors = 0;
    for (const DisplayLink* display : displays) monitors += display->info.monitors_size();
    triggers.emplace(rig, static_cast<int>(test.steps.size()) + 1, monitors,
                     step_time(displays, test.hold_refreshes), test.exposure_ms);
  }
  std::vector<std::unique_ptr<PresentationStream>> streams;
  for (const DisplayLink* display : displays) {
    streams.push_back(std::make_unique<PresentationStream>(
        *display, program, start_at, step, [&triggers, display](const v1::Presentation& replaced) {
          if (triggers) triggers->note(replaced, *display);
        }));
  }

  TestCaptureRecord record;
  nanoseconds wanted_until{}, seen_until{}, played_at{}, clocks_at = monotonic_now();
  while (!stop.stop_requested()) {
    bool playing = false;
    for (size_t i = 0; i < streams.size(); ++i) {
      // Read the end first: then everything pushed before it is taken.
      const std::optional<absl::Status> end = streams[i]->inbox.end();
      for (v1::Presentation& shown : streams[i]->inbox.take()) {
        wanted_until = std::max(wanted_until, rig_time_of(shown, *test.displays[i]).replaced + kTail);
        if (shown.step() == kNoStep) continue;
        if (std::ranges::find(test.steps, shown.step(), &v1::ProgramStep::step) == test.steps.end()) {
          return absl::InternalError(fmt::format("{} reports step {}, which it was not given",
                                                 test.displays[i]->link.title(), shown.step()));
        }
        record.shown.push_back({.display = test.displays[i], .presentation = std::move(shown)});
      }
      if (end && !end->ok()) return *end;
      playing = playing || !end;
    }
    if (const auto end = camera.inbox.end()) return *end;
    for (v1::FrameTaken& frame : camera.inbox.take()) {
      seen_until = std::max(seen_until, rig_time_of(frame, *rig.camera).end);
      record.frames.push_back(std::move(frame));
    }
    const nanoseconds now = monotonic_now();
    if (playing) played_at = now;
    if (!playing && (seen_until > wanted_until || now - played_at > kLastFrame)) return record;
    if (now - clocks_at > std::chrono::seconds(1)) {
      clocks_at = now;
      GW_RETURN_IF_ERROR(rig.exchange_clocks(1));
    }
    std::this_thread::sleep_for(kPoll);
  }
  return absl::CancelledError("stopped");
}

}  // namespace glasswing
