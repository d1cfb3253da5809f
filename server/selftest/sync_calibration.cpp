#include "server/selftest/sync_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/calibration/light_step.h"
#include "core/service/monitor.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
// Each pass restarts the camera, at a different phase of the display's refreshes.
constexpr int kPassesAtOnce = 4, kMaxPasses = 12;
constexpr nanoseconds kGoodEnough = std::chrono::microseconds(50);  // standard error at which the passes end
constexpr nanoseconds kSteady = milliseconds(33);                   // minimum duration of a picture
constexpr double kFramesAPicture = 3.0;
constexpr double kClipping =
    1e-3;  // share of the samples at full scale with the band's light, beyond which it is clipped
constexpr double kShortestExposureMs = 0.2;
constexpr double kOneRow_px = 0.3;  // sigma of a stripe that lights little more than its middle row
constexpr std::array<double, 2> kBandHeights{1.0 / 6.0, 5.0 / 6.0};

struct Target {
  DisplayLink* display = nullptr;
  const v1::DisplayMonitor* monitor = nullptr;

  nanoseconds period() const { return nanoseconds(std::llround(1e9 / monitor->refresh_hz())); }
  // The middle row of a band, and its position in the scan-out.
  int band_row(size_t band) const { return static_cast<int>(kBandHeights[band] * monitor->height_px()); }
  double band_height(size_t band) const {
    return static_cast<double>(band_row(band)) / (monitor->height_px() + monitor->patch_rows());
  }
};

absl::StatusOr<Target> find(const RigLinks& rig, const std::string& name) {
  std::vector<v1::Monitor> monitors;
  for (const auto& display : rig.displays) {
    if (const v1::DisplayMonitor* monitor = display->monitor(name))
      return Target{.display = display.get(), .monitor = monitor};
    for (const v1::DisplayMonitor& each : display->info.monitors()) monitors.push_back(listed_monitor(each));
  }
  return no_monitor(name, monitors);
}

// Bright lines, so narrow that their own scan-out is short compared with the measured times.
v1::Stimulus band_stimulus(const Target& target, size_t band) {
  v1::Stimulus stimulus;
  stimulus.set_kind("gauss_stripe");
  stimulus.set_panel(target.monitor->name());
  stimulus.set_phi_deg(90.0);
  stimulus.set_r_px(target.band_row(band) + 0.5);
  stimulus.set_sigma_px(std::max(kOneRow_px, target.monitor->height_px() / 256.0));
  stimulus.set_peak(1.0);
  return stimulus;
}

absl::StatusOr<v1::MeasureLightResponse> measure_light(RigLinks& rig,
                                                       const std::vector<v1::FrameTaken>& frames,
                                                       const v1::CameraCalibration* calibration,
                                                       std::stop_token stop) {
  constexpr size_t kBatch = 32;
  v1::MeasureLightResponse measured;
  for (size_t first = 0; first < frames.size(); first += kBatch) {
    v1::MeasureLightRequest request;
    if (calibration != nullptr) *request.mutable_calibration() = *calibration;
    for (size_t i = first; i < std::min(first + kBatch, frames.size()); ++i)
      request.add_sequences(frames[i].sequence());
    v1::MeasureLightResponse response;
    GW_RETURN_IF_ERROR(rig.camera->call("measure light", stop, [&](grpc::ClientContext& context) {
      return rig.camera_stub->MeasureLight(&context, request, &response);
    }));
    for (v1::FrameLight& light : *response.mutable_frames()) *measured.add_frames() = std::move(light);
  }
  return measured;
}

// The measurements of one exposure.
struct Measurement {
  LightRecord record;
  double min_clipped = 1.0, max_clipped = 0.0;
  nanoseconds clock_errors{};  // the sum over passes of the clocks' bounds
  int passes = 0;

  nanoseconds clock_error() const { return clock_errors / std::max(passes, 1); }

  bool clips() const { return max_clipped - min_clipped > kClipping; }
};

absl::Status add_pass(RigLinks& rig, const Target& target, double exposure_ms,
                      const v1::CameraCalibration* calibration, std::stop_token stop,
                      Measurement& measurement) {
  const std::vector<std::optional<size_t>> sequence = band_sequence();
  const size_t steps = sequence.size() / kPassesAtOnce;
  const size_t first = static_cast<size_t>(measurement.passes % kPassesAtOnce) * steps;
  TestCapture test{
      .displays = {target.display},
      .steps = {},
      .hold_refreshes = std::max(2, static_cast<int>((kSteady + target.period() / 2) / target.period())),
      .exposure_ms = exposure_ms};
  for (size_t i = first; i < first + steps; ++i) {
    v1::ProgramStep& step = test.steps.emplace_back();
    step.set_step(static_cast<int>(i));
    if (sequence[i]) *step.add_stimuli() = band_stimulus(target, *sequence[i]);
  }
  GW_ASSIGN_OR_RETURN(const TestCaptureRecord seen, run_test_capture(rig, test, stop));
  ++measurement.passes;

  nanoseconds from = nanoseconds::max(), until{};
  nanoseconds display_error{}, camera_error{};
  for (const TestCaptureRecord::Shown& shown : seen.shown) {
    const v1::Presentation& presentation = shown.presentation;
    if (presentation.monitor() != target.monitor->name()) continue;
    const ClockReading start =
        shown.display->link.rig_from_node(nanoseconds(presentation.scanout_start_ns()));
    const nanoseconds replaced =
        start.time + nanoseconds(presentation.replaced_ns() - presentation.scanout_start_ns());
    measurement.record.shown.push_back({.scanout_start = start.time, .lit = sequence[presentation.step()]});
    measurement.record.scanout = nanoseconds(presentation.scanout_end_ns() - presentation.scanout_start_ns());
    from = std::min(from, start.time - milliseconds(100));
    until = std::max(until, replaced);
    display_error = std::max(display_error, start.error);
  }
  if (until > nanoseconds(0))
    measurement.record.shown.push_back({.scanout_start = until, .lit = std::nullopt});

  std::map<std::int64_t, LightFrame> times;  // by sequence
  std::vector<v1::FrameTaken> wanted;
  for (const v1::FrameTaken& frame : seen.frames) {
    const ClockReading start = rig.camera->rig_from_node(nanoseconds(frame.exposure_start_ns()));
    if (start.time < from) continue;
    camera_error = std::max(camera_error, start.error);
    const nanoseconds exposure(std::llround(1e6 * frame.exposure_ms()));
    const nanoseconds all(frame.exposure_end_ns() - frame.exposure_start_ns());
    times[frame.sequence()] = {
        .start = start.time, .exposure = exposure, .readout = all - exposure, .row_mean = {}};
    wanted.push_back(frame);
  }
  measurement.clock_errors += display_error + camera_error;
  GW_ASSIGN_OR_RETURN(const v1::MeasureLightResponse measured, measure_light(rig, wanted, calibration, stop));
  for (const v1::FrameLight& light : measured.frames()) {
    const auto taken = times.find(light.sequence());
    if (taken == times.end()) {
      return absl::InternalError(fmt::format("{} measured the light of frame {}, which was not requested",
                                             rig.camera->title(), light.sequence()));
    }
    LightFrame& frame = measurement.record.frames.emplace_back(taken->second);
    frame.row_mean.assign(light.row_mean().begin(), light.row_mean().end());
    measurement.min_clipped = std::min(measurement.min_clipped, light.clipped_fraction());
    measurement.max_clipped = std::max(measurement.max_clipped, light.clipped_fraction());
  }
  return absl::OkStatus();
}

v1::MonitorSync sync_of(const Target& target, const Measurement& measurement, const LightStep& step) {
  v1::MonitorSync sync;
  sync.set_monitor(target.monitor->name());
  sync.set_measured(utc_now_rfc3339());
  sync.set_clock_error_ns(measurement.clock_error().count());
  nanoseconds lag = step.lag.value, settle = step.settle.value;
  if (step.scanout) {
    sync.set_scanout_ns(step.scanout->value.count());
    const nanoseconds declared = measurement.record.scanout;
    const nanoseconds tolerance = 3 * step.scanout->error + declared / 100;
    if (std::chrono::abs(step.scanout->value - declared) > tolerance) {
      // The first row to light up, and the last one to settle, in any order of rows.
      const nanoseconds last = lag + std::max(step.scanout->value, nanoseconds(0)) + settle;
      lag += std::min(step.scanout->value, nanoseconds(0));
      settle = std::max(last - declared - lag, nanoseconds(0));
    }
  }
  // Light cannot precede the scan-out; the error covers the noise.
  sync.set_lag_ns(std::max(lag, nanoseconds(0)).count());
  sync.set_settle_ns(settle.count());
  sync.set_error_ns(std::llround(std::hypot(static_cast<double>(step.lag.error.count()),
                                            static_cast<double>(step.settle.error.count()))));
  return sync;
}

}  // namespace

absl::StatusOr<v1::MonitorSync> measure_sync(RigLinks& rig, const std::string& monitor, double exposure_ms,
                                             const v1::CameraCalibration* calibration,
                                             const std::function<void(const std::string&)>& progress,
                                             std::stop_token stop) {
  GW_ASSIGN_OR_RETURN(const Target target, find(rig, monitor));
  const v1::GetCameraResponse& camera = rig.camera_info;
  double exposure = exposure_ms;
  if (exposure_ms == 0.0)
    exposure = std::clamp(800.0 / camera.frame_rate_hz(), camera.min_exposure_ms(), camera.max_exposure_ms());
  Measurement measurement;
  while (true) {
    progress(fmt::format("{}: showing bands to the camera, {:.3g} ms exposures, pass {}", monitor, exposure,
                         measurement.passes + 1));
    GW_RETURN_IF_ERROR(add_pass(rig, target, exposure, calibration, stop, measurement));
    if (measurement.clips()) {
      const double shorter = 0.5 * exposure;
      if (exposure_ms != 0.0 || shorter < std::max(camera.min_exposure_ms(), kShortestExposureMs)) {
        return absl::FailedPreconditionError(
            fmt::format("{}: {:.1f} % of the samples are at full scale at {:.3g} ms; choose a shorter "
                        "--exposure-ms, or stop down the lens",
                        monitor, 100.0 * measurement.max_clipped, exposure));
      }
      exposure = shorter;
      measurement = {};
      continue;
    }
    if (measurement.passes % kPassesAtOnce != 0) continue;
    measurement.record.band_height = {target.band_height(0), target.band_height(1)};
    const absl::StatusOr<LightStep> step = find_light_step(measurement.record);
    // A camera with few frames of each picture samples few phases.
    const bool few = camera.frame_rate_hz() * 1e-9 * static_cast<double>(kSteady.count()) < kFramesAPicture;
    if (few && measurement.passes < 2 * kPassesAtOnce) continue;
    const bool more = measurement.passes < kMaxPasses;
    if (!step.ok() && !more) {
      return absl::Status(step.status().code(),
                          fmt::format("{}: {}", monitor, std::string(step.status().message())));
    }
    if (!step.ok() || (step->lag.error > kGoodEnough && more)) continue;
    if (step->lag.value < -3 * step->lag.error - measurement.clock_error() - milliseconds(1)) {
      return absl::FailedPreconditionError(
          fmt::format("{}: its light came {:.2f} ms before its scan-out; the display node or the camera node "
                      "reports wrong times",
                      monitor, -1e-6 * static_cast<double>(step->lag.value.count())));
    }
    return sync_of(target, measurement, *step);
  }
}

}  // namespace glasswing
