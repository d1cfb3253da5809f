#include "server/selftest/rig_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/base/status.h"
#include "core/pattern/id_patch.h"
#include "core/pattern/plan.h"
#include "core/pattern/plan_fit.h"
#include "core/pattern/stimulus_kind.h"
#include "core/service/preparation.h"
#include "core/service/service.h"
#include "server/selftest/rig_findings.h"

namespace glasswing {
namespace {

constexpr int kMaxSteps = 60, kFewestSteps = 8;
constexpr nanoseconds kTestCaptureTime = std::chrono::seconds(2);

class RigCheck {
 public:
  RigCheck(const NodeRegistry& rig, const CalibrationStore& calibrations, const v1::Plan& plan,
           const std::function<void(const v1::Finding&)>& report)
      : rig_(rig), calibrations_(calibrations), plan_(plan), report_(report) {}

  absl::Status run(std::stop_token stop) {
    if (!check_nodes()) return absl::OkStatus();
    absl::StatusOr<RigLinks> links = connect(rig_, calibrations_, plan_.camera(), monitors_of(plan_));
    if (links.ok()) links->exchange_clocks(16).IgnoreError();  // the test capture reports an error of this
    if (!links.ok()) return tell_status("nodes", links.status());
    tell_preparation(links->camera_info);
    if (!check_monitors(*links) || !check_exposures(*links)) return absl::OkStatus();
    if (plan_.method().empty()) hold_as_made_for(*links);
    GW_RETURN_IF_ERROR(check_fit(*links));
    check_clocks(*links);
    if (links->camera_info.on_demand()) {
      tell_due(links->camera_info);
    } else {
      GW_RETURN_IF_ERROR(try_out(*links, stop));
    }
    const v1::Camera& camera = links->camera_info.camera();
    const double longest_ms = *std::max_element(exposures_ms_.begin(), exposures_ms_.end());
    report_(judge_camera_light(camera, calibrations_.camera(camera.name()),
                               nanoseconds(std::llround(1e6 * longest_ms))));
    for (const v1::DisplayMonitor& monitor : monitors_)
      report_(judge_monitor_light(monitor, calibrations_.display(monitor.name())));
    if (links->camera_info.on_demand()) return absl::OkStatus();  // times prove nothing
    for (const v1::DisplayMonitor& monitor : monitors_)
      report_(judge_sync(monitor, calibrations_.sync(monitor.name())));
    return absl::OkStatus();
  }

 private:
  void tell(v1::FindingLevel level, const std::string& subject, const std::string& text,
            const std::string& advice = "") {
    report_(make_finding(level, subject, text, advice));
  }
  // Turns a node's error into a finding.
  absl::Status tell_status(const std::string& subject, const absl::Status& status) {
    if (absl::IsCancelled(status)) return status;
    tell(v1::FINDING_LEVEL_PROBLEM, subject, std::string(status.message()), "look at that node's log");
    return absl::OkStatus();
  }

  // The test capture waits for it.
  void tell_preparation(const v1::GetCameraResponse& camera) {
    if (!camera.has_preparation()) return;
    tell(v1::FINDING_LEVEL_WARNING, "camera",
         fmt::format("{} is not ready: {}", camera.camera().name(), preparation_text(camera.preparation())),
         "the check continues by itself when it is; so would a capture");
  }

  // No times are measured for a camera that takes pictures on demand.
  void tell_due(const v1::GetCameraResponse& camera) {
    const std::string& name = camera.camera().name();
    if (!camera.has_due()) {
      return tell(v1::FINDING_LEVEL_OK, "camera",
                  name + " takes a picture when a capture requests one; not tried");
    }
    const double waited_s = 1e-9 * static_cast<double>(camera.due().waited_ns());
    tell(v1::FINDING_LEVEL_WARNING, "camera",
         fmt::format("{}: the folder has waited {:.0f} s for {}{}", name, waited_s, camera.due().what(),
                     camera.due().problem().empty() ? "" : " (" + camera.due().problem() + ")"),
         camera.due().by_hand() ? "press the camera's button" : "is the camera switched on and awake?");
  }

  // False: a node is missing, so the rest cannot be checked.
  bool check_nodes() {
    std::string away;
    for (const v1::Node& node : rig_.nodes()) {
      if (!node.up()) away += (away.empty() ? "" : ", ") + node.name();
    }
    const size_t displays = rig_.up(v1::NODE_KIND_DISPLAY).size(),
                 cameras = rig_.up(v1::NODE_KIND_CAMERA).size(),
                 solvers = rig_.up(v1::NODE_KIND_SOLVER).size();
    const std::string text = fmt::format("up: {} display, {} camera and {} solver nodes{}", displays, cameras,
                                         solvers, away.empty() ? "" : "; away: " + away);
    if (displays == 0 || cameras == 0) {
      tell(v1::FINDING_LEVEL_PROBLEM, "nodes", text,
           fmt::format("start {}, with --server", displays == 0 ? "glasswing-display" : "glasswing-camera"));
      return false;
    }
    if (solvers == 0) {
      tell(v1::FINDING_LEVEL_WARNING, "nodes", text, "start glasswing-solver before you want to solve");
    } else if (!away.empty()) {
      tell(v1::FINDING_LEVEL_WARNING, "nodes", text, "start what should be running, or leave it");
    } else {
      tell(v1::FINDING_LEVEL_OK, "nodes", text);
    }
    return true;
  }

  bool check_monitors(const RigLinks& links) {
    std::set<std::string> wanted;
    for (const v1::PlanMonitor& monitor : plan_.monitors()) wanted.insert(monitor.name());
    std::string text;
    double slowest = 0.0, fastest = 0.0;
    for (const auto& display : links.displays) {
      for (const v1::DisplayMonitor& monitor : display->info.monitors()) {
        text += fmt::format("{}{} {}x{} at {:.2f} Hz", text.empty() ? "" : ", ", monitor.name(),
                            monitor.width_px(), monitor.height_px(), monitor.refresh_hz());
        slowest = slowest == 0.0 ? monitor.refresh_hz() : std::min(slowest, monitor.refresh_hz());
        fastest = std::max(fastest, monitor.refresh_hz());
        if (plan_.monitors().empty() || wanted.erase(monitor.name()) > 0) monitors_.push_back(monitor);
      }
    }
    if (!wanted.empty()) {
      tell(v1::FINDING_LEVEL_PROBLEM, "monitors",
           fmt::format("the plan's monitor \"{}\" is not in the rig; there are: {}", *wanted.begin(), text),
           "start its display node, or change the plan");
      return false;
    }
    if (fastest > 1.01 * slowest) {
      tell(v1::FINDING_LEVEL_WARNING, "monitors", text + "; every step waits for the slowest",
           "give all monitors the same refresh rate");
    } else {
      tell(v1::FINDING_LEVEL_OK, "monitors", text);
    }
    return true;
  }

  bool check_exposures(const RigLinks& links) {
    exposures_ms_.assign(plan_.exposure_ms().begin(), plan_.exposure_ms().end());
    const double least = links.camera_info.min_exposure_ms(), most = links.camera_info.max_exposure_ms();
    // A camera that takes pictures on demand has the exposure that is set on it.
    const bool set = links.camera_info.on_demand();
    if (exposures_ms_.empty())
      exposures_ms_.push_back(set ? std::clamp(kDefaultExposureMs, least, most) : kDefaultExposureMs);
    for (const double exposure_ms : exposures_ms_) {
      if (exposure_ms >= least && exposure_ms <= most) continue;
      tell(v1::FINDING_LEVEL_PROBLEM, "camera",
           fmt::format("exposure_ms is {}; the camera takes {:.3g} to {:.3g} ms at its {:.1f} frames per "
                       "second",
                       exposure_ms, least, most, links.camera_info.frame_rate_hz()),
           "change the plan's exposure_ms, or the camera's frame rate");
      return false;
    }
    return true;
  }

  // Pictures are shown as long as in a plan that is made for this rig.
  void hold_as_made_for(const RigLinks& links) {
    const absl::StatusOr<std::vector<v1::Monitor>> monitors = links.monitors();
    v1::Plan made;
    if (monitors.ok() && fit_to_camera({.monitors = *monitors, .camera = links.camera_info}, made).ok())
      plan_.set_hold_refreshes(made.hold_refreshes());
  }

  // What started the exposures, and what was lost; of a camera with a trigger, a thermometer or packets.
  void tell_camera(const RigLinks& links) {
    v1::GetCameraResponse camera = links.camera_info;
    grpc::ClientContext context;
    set_deadline(context, kNodeCall);
    if (!links.camera_stub->GetCamera(&context, v1::GetCameraRequest(), &camera).ok()) return;
    const std::int64_t dropped = camera.dropped_frames() - links.camera_info.dropped_frames();
    if (camera.trigger().empty() && !camera.has_temperature_c() && dropped == 0) return;
    const auto line = std::ranges::find_if(links.displays,
                                           [](const auto& display) { return !display->info.line().empty(); });
    std::string text = camera.trigger().empty()         ? "runs freely"
                       : camera.trigger() == "software" ? "triggered by software"
                                                        : "triggered by " + camera.trigger();
    if (camera.line_delay_ns() > 0)
      text += fmt::format(" after {:.4g} ms", static_cast<double>(camera.line_delay_ns()) / 1e6);
    if (!camera.trigger().empty() && camera.trigger() != "software")
      text += line == links.displays.end()
                  ? ", which no display raises"
                  : fmt::format(", which {} raises by {}", (*line)->info.name(), (*line)->info.line());
    if (camera.has_temperature_c()) text += fmt::format("; {:.1f} C", camera.temperature_c());
    if (dropped > 0) {
      tell(v1::FINDING_LEVEL_WARNING, "camera",
           fmt::format("{}; {} frames were dropped during the check, {} packets are missing since its node "
                       "began",
                       text, dropped, camera.missing_packets()),
           "see the camera node's log; for a GigE camera raise net.core.rmem_max, or lower --packet-size");
    } else {
      tell(v1::FINDING_LEVEL_OK, "camera", text);
    }
  }

  // For the camera, judge_window() reports what was measured.
  absl::Status check_fit(const RigLinks& links) {
    GW_ASSIGN_OR_RETURN(std::vector<v1::Monitor> monitors, links.monitors());
    const RigLimits limits{.monitors = std::move(monitors), .camera = {}, .blur_px = 0.0};
    for (const std::string& misfit : misfits(plan_, limits))
      tell(v1::FINDING_LEVEL_WARNING, "plan", misfit, "glasswing plan make --for-rig makes a plan that fits");
    return absl::OkStatus();
  }

  void check_clocks(const RigLinks& links) {
    std::vector<std::pair<std::string, nanoseconds>> errors;
    const nanoseconds now = monotonic_now();
    errors.emplace_back(links.camera_info.camera().name(), links.camera->node_from_rig(now).error);
    for (const auto& display : links.displays)
      errors.emplace_back(display->info.name(), display->link.node_from_rig(now).error);
    report_(judge_clocks(errors));
  }

  // White on one monitor after another, as a plan would light them.
  TestCapture test_capture_of(const RigLinks& links) const {
    TestCapture test{.displays = {},
                     .steps = {},
                     .hold_refreshes = hold_refreshes_of(plan_),
                     .exposure_ms = *std::max_element(exposures_ms_.begin(), exposures_ms_.end()),
                     .triggered = !links.camera_info.trigger().empty()};
    nanoseconds period{};
    for (const auto& display : links.displays) {
      test.displays.push_back(display.get());
      for (const v1::DisplayMonitor& monitor : display->info.monitors())
        period = std::max(period, nanoseconds(std::llround(1e9 / monitor.refresh_hz())));
    }
    const auto fitting = kTestCaptureTime / (test.hold_refreshes * period);
    const auto count = static_cast<int>(std::clamp<std::int64_t>(fitting, kFewestSteps, kMaxSteps));
    for (int i = 0; i < count; ++i) {
      v1::ProgramStep& step = test.steps.emplace_back();
      step.set_step(i);
      v1::Stimulus& white = *step.add_stimuli();
      white.set_kind("solid");
      white.set_panel(monitors_[static_cast<size_t>(i) % monitors_.size()].name());
    }
    // Id patches come last, so that the camera still has their frames afterwards; twice, as in a capture.
    for (int showing = 0; showing < 2; ++showing) {
      for (const v1::DisplayMonitor& monitor : monitors_) {
        if (monitor.patch_rows() == 0) continue;
        for (const std::uint16_t id : patch_learning_ids()) {
          v1::ProgramStep& step = test.steps.emplace_back();
          step.set_step(static_cast<int>(test.steps.size()) - 1);
          v1::Stimulus& patch = *step.add_stimuli();
          patch.set_kind("patch");
          patch.set_panel(monitor.name());
          patch.set_patch_id(id);
        }
      }
    }
    return test;
  }

  TestCaptureTimes times_of(const RigLinks& links, const TestCapture& test,
                            const TestCaptureRecord& record) const {
    TestCaptureTimes times;
    times.hold_refreshes = test.hold_refreshes;
    times.triggered = test.triggered;
    times.exposure = nanoseconds(std::llround(1e6 * test.exposure_ms));
    times.frame_period = nanoseconds(std::llround(1e9 / links.camera_info.frame_rate_hz()));
    times.readout = nanoseconds(links.camera_info.readout_ns());
    std::map<int, std::vector<MonitorWindow>> windows;  // by step
    size_t monitor_count = 0;
    for (const auto& display : links.displays)
      monitor_count += static_cast<size_t>(display->info.monitors_size());
    for (const TestCaptureRecord::Shown& shown : record.shown) {
      const v1::Presentation& presentation = shown.presentation;
      const v1::DisplayMonitor* monitor = shown.display->monitor(presentation.monitor());
      if (monitor == nullptr) continue;
      times.shown.push_back(
          {.monitor = presentation.monitor(),
           .step = presentation.step(),
           .held = nanoseconds(presentation.replaced_ns() - presentation.scanout_start_ns()),
           .period = nanoseconds(std::llround(1e9 / monitor->refresh_hz()))});
      windows[presentation.step()].push_back(rig_time_of(presentation, *shown.display));
    }
    for (const auto& [step, parts] : windows) {
      if (parts.size() == monitor_count) times.windows.push_back(stable_window(parts));
    }
    for (const v1::FrameTaken& frame : record.frames)
      times.frames.push_back(rig_time_of(frame, *links.camera));
    return times;
  }

  absl::Status try_out(RigLinks& links, std::stop_token stop) {
    const TestCapture test = test_capture_of(links);
    const absl::StatusOr<TestCaptureRecord> record = run_test_capture(links, test, stop);
    if (!record.ok()) return tell_status("trial", record.status());
    const TestCaptureTimes times = times_of(links, test, *record);
    for (const v1::FrameTaken& frame : record->frames) {
      if (std::abs(frame.exposure_ms() - test.exposure_ms) <= 0.01 * test.exposure_ms) continue;
      tell(v1::FINDING_LEVEL_PROBLEM, "camera",
           fmt::format("{:.3g} ms exposures were requested; it made {:.3g} ms", test.exposure_ms,
                       frame.exposure_ms()),
           "switch its automatic exposure off, or request a supported exposure");
      break;
    }
    tell_camera(links);
    report_(judge_flips(times));
    report_(judge_frames(times));
    const nanoseconds shortest(std::llround(1e6 * links.camera_info.min_exposure_ms()));
    for (const double exposure_ms : exposures_ms_)
      report_(judge_window(times, nanoseconds(std::llround(1e6 * exposure_ms)), shortest));
    report_(judge_proof(times));
    return check_patches(links, test, times, *record);
  }

  // Judges the monitors' id patches from the test capture's patch-learning steps.
  absl::Status check_patches(const RigLinks& links, const TestCapture& test, const TestCaptureTimes& times,
                             const TestCaptureRecord& record) {
    v1::LookForPatchesRequest look;
    std::set<std::pair<std::string, std::uint32_t>> learnt;  // monitor and id
    for (const StableWindow& window : times.windows) {
      const v1::ProgramStep& step = test.steps.at(static_cast<size_t>(window.step));
      const auto frame = std::find_if(times.frames.begin(), times.frames.end(),
                                      [&](const FrameTime& each) { return proves(each, window); });
      const v1::Stimulus& shown = step.stimuli(0);
      if (kind_of(shown) != StimulusKind::kPatch || frame == times.frames.end()) continue;
      if (!learnt.emplace(shown.panel(), shown.patch_id()).second) continue;
      v1::Frame& shown_frame = *look.add_frames();
      shown_frame.set_sequence(frame->sequence);
      shown_frame.set_exposure_ms(record.frames.front().exposure_ms());
      *shown_frame.mutable_stimulus() = shown;
    }
    v1::LookForPatchesResponse found;
    const absl::Status looked =
        links.camera->call("look for id patches", {}, [&](grpc::ClientContext& context) {
          return links.camera_stub->LookForPatches(&context, look, &found);
        });
    if (!looked.ok()) return tell_status("id patch", looked);
    std::map<std::string, int> learned;
    for (const v1::Frame& frame : look.frames()) ++learned[frame.stimulus().panel()];
    for (const v1::DisplayMonitor& monitor : monitors_) {
      const auto unseen =
          std::find_if(found.unseen_patches().begin(), found.unseen_patches().end(),
                       [&](const v1::UnseenPatch& patch) { return patch.monitor() == monitor.name(); });
      report_(judge_patch(monitor, learned[monitor.name()],
                          unseen == found.unseen_patches().end() ? v1::UnseenPatch() : *unseen));
    }
    return absl::OkStatus();
  }

  const NodeRegistry& rig_;
  const CalibrationStore& calibrations_;
  v1::Plan plan_;
  const std::function<void(const v1::Finding&)>& report_;
  std::vector<v1::DisplayMonitor> monitors_;  // that a plan would light
  std::vector<double> exposures_ms_;
};

}  // namespace

absl::Status check_rig(const NodeRegistry& rig, const CalibrationStore& calibrations, const v1::Plan& plan,
                       const std::function<void(const v1::Finding&)>& report, std::stop_token stop) {
  if (!plan.method().empty()) GW_RETURN_IF_ERROR(check_plan(plan));
  return RigCheck(rig, calibrations, plan, report).run(stop);
}

}  // namespace glasswing
