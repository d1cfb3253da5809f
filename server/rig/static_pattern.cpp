#include "server/rig/static_pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr std::chrono::milliseconds kCheckInterval(10);
constexpr std::chrono::milliseconds kPictureLead(200);  // from the command to the picture
// The longest step that displays accept, and the number of steps that last a day at 60 Hz.
constexpr int kHoldRefreshes = 600, kSteps = 8640;
constexpr int kBars = 8, kLines = 24;
constexpr double kGray = 0.2;

}  // namespace

absl::StatusOr<std::unique_ptr<StaticPattern>> StaticPattern::start(
    const RigLinks& rig, const std::vector<v1::Stimulus>& stimuli,
    const google::protobuf::RepeatedPtrField<v1::DisplayCalibration>& calibrations, std::stop_token stop) {
  std::unique_ptr<StaticPattern> show(new StaticPattern);
  const std::string program = fmt::format("still-{}", monotonic_now().count());
  std::vector<const DisplayLink*> lit;
  for (const auto& display : rig.displays) {
    v1::LoadProgramRequest request;
    request.set_program(program);
    request.set_hold_refreshes(kHoldRefreshes);
    v1::ProgramStep step;
    for (const v1::Stimulus& stimulus : stimuli) {
      if (display->monitor(stimulus.panel()) != nullptr) *step.add_stimuli() = stimulus;
    }
    if (step.stimuli().empty()) continue;
    lit.push_back(display.get());
    for (int i = 0; i < kSteps; ++i) {
      step.set_step(i);
      *request.add_steps() = step;
    }
    for (const v1::DisplayCalibration& calibration : calibrations) {
      if (display->monitor(calibration.monitor()) != nullptr) *request.add_calibrations() = calibration;
    }
    GW_RETURN_IF_ERROR(display->link.exchange_clocks(8));
    request.set_request_id(random_token());
    v1::LoadProgramResponse response;
    GW_RETURN_IF_ERROR(display->link.call("draw a program", stop, [&](grpc::ClientContext& context) {
      return display->stub->LoadProgram(&context, request, &response);
    }));
  }
  const nanoseconds start = monotonic_now() + kPictureLead;
  nanoseconds there = start;
  for (const DisplayLink* display : lit) {
    show->playing_.push_back(std::make_unique<PresentationStream>(*display, program, start));
    there = std::max(there, there_at(*display, start));
  }
  while (monotonic_now() < there) {
    if (stop.stop_requested()) return absl::CancelledError("stopped");
    GW_RETURN_IF_ERROR(show->check());
    std::this_thread::sleep_for(kCheckInterval);
  }
  return show;
}

nanoseconds StaticPattern::there_at(const DisplayLink& display, nanoseconds start) {
  nanoseconds latest = start;
  for (const v1::DisplayMonitor& monitor : display.info.monitors()) {
    // Up to one refresh until the scan-out begins, and another until its last row.
    latest = std::max(latest, start + nanoseconds(static_cast<std::int64_t>(2e9 / monitor.refresh_hz())) +
                                  nanoseconds(monitor.optical_lag_ns() + monitor.settle_ns()));
  }
  return latest;
}

absl::Status StaticPattern::check() const {
  for (const auto& playing : playing_) {
    const std::optional<absl::Status> end = playing->inbox.end();
    if (!end) continue;
    if (!end->ok()) return *end;
    return absl::DeadlineExceededError(
        "the pattern reached the longest time that a display can show it; show "
        "it again");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<v1::Stimulus>> test_pattern(const std::string& name,
                                                       const std::vector<v1::Monitor>& monitors) {
  std::vector<v1::Stimulus> stimuli;
  for (const v1::Monitor& monitor : monitors) {
    v1::Stimulus& stimulus = stimuli.emplace_back();
    stimulus.set_panel(monitor.name());
    if (name == "white" || name == "gray" || name == "black") {
      stimulus.set_kind("solid");
      for (int c = 0; c < 3; ++c) stimulus.add_colour(name == "white" ? 1.0 : name == "gray" ? kGray : 0.0);
    } else if (name == "bars" || name == "lines") {
      stimulus.set_kind("square");
      stimulus.set_orient("vertical_bars");
      stimulus.set_level(1);
      stimulus.set_bar_width_px(static_cast<double>(monitor.width_px()) / (name == "bars" ? kBars : kLines));
    } else if (name == "ramp") {
      stimulus.set_kind("ramp");
    } else {
      return absl::InvalidArgumentError(
          fmt::format("the pattern is \"{}\"; it must be white, gray, bars, lines, ramp or black", name));
    }
  }
  return stimuli;
}

}  // namespace glasswing
