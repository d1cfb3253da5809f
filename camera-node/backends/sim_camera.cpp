#include "camera-node/backends/sim_camera.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/base/status.h"
#include "core/image/mosaic.h"

namespace glasswing {
namespace {

constexpr double kMinExposureMs = 0.05;
constexpr nanoseconds kMaxLightDelay = std::chrono::milliseconds(300);  // later light counts as dark
constexpr std::chrono::seconds kMaxTraceWait(5);                        // a stopping daemon waits this long
// For moving monitors: frames at two places may be requested alternately while a third is traced.
constexpr size_t kStagesKept = 3;

std::vector<SceneMonitor> in_scene(const std::vector<EmissionMonitor>& monitors) {
  std::vector<SceneMonitor> in_scene;
  for (const EmissionMonitor& monitor : monitors) {
    in_scene.push_back({.name = monitor.name,
                        .size = {.width_px = monitor.width_px, .height_px = monitor.height_px},
                        .pitch_mm = monitor.pitch_mm,
                        .pose = monitor.pose});
  }
  return in_scene;
}

}  // namespace

absl::StatusOr<std::unique_ptr<SimCamera>> SimCamera::create(const SimCameraOptions& options,
                                                             const EmissionTimeline& timeline) {
  if (!options.mosaic.empty()) GW_RETURN_IF_ERROR(Mosaic::parse(options.mosaic).status());
  if (options.focal_px && !(*options.focal_px >= options.width_px)) {
    return absl::InvalidArgumentError(
        fmt::format("--focal-length is {}; it must be {} px or more, the picture's width: otherwise the "
                    "camera would be inside the scene",
                    *options.focal_px, options.width_px));
  }
  // Fails with a list of the scenes if this one is unknown.
  const std::vector<SceneMonitor> one{{.name = "back", .size = {.width_px = 4, .height_px = 4}}};
  GW_RETURN_IF_ERROR(build_transport(options.scene, true, one, 4, 4).status());
  return std::unique_ptr<SimCamera>(new SimCamera(options, timeline));
}

SimCamera::SimCamera(const SimCameraOptions& options, const EmissionTimeline& timeline)
    : options_(options),
      timeline_(timeline),
      motion_(motion_of(options.scene)),
      table_{.turn_deg = 0.0, .wobble_deg = options.wobble_deg},
      random_(options.sensor.seed),
      preparing_([this](std::stop_token stop) { prepare(stop); }) {}

v1::GetCameraResponse SimCamera::describe() const {
  v1::GetCameraResponse response;
  v1::Camera& camera = *response.mutable_camera();
  camera.set_name(options_.name);
  camera.set_width_px(options_.width_px);
  camera.set_height_px(options_.height_px);
  camera.set_bits(options_.sensor.bits);
  camera.set_mosaic(options_.mosaic);
  // With a nonlinear response only a calibration can find the noise parameters, as for a real camera.
  const bool linear = options_.sensor.curve == SensorCurve() && options_.sensor.black_level == 0.0;
  camera.set_response(linear ? "linear" : "unknown");
  if (linear) camera.set_read_sd(options_.sensor.read_sd);
  if (linear) camera.set_gain(options_.sensor.gain);
  response.set_backend("sim");
  response.set_frame_rate_hz(options_.frame_rate_hz);
  response.set_min_exposure_ms(kMinExposureMs);
  response.set_max_exposure_ms(1000.0 / options_.frame_rate_hz);
  response.set_readout_ns(options_.sensor.readout.count());
  if (std::optional<v1::Preparation> now = preparation()) *response.mutable_preparation() = *std::move(now);
  return response;
}

std::optional<v1::Preparation> SimCamera::preparation() const {
  const Monitors monitors = in_scene(timeline_.monitors());
  v1::Preparation preparation;
  if (monitors.empty()) {
    preparation.set_what("waiting for the monitors' light");
    return options_.awaits_light ? std::optional(preparation) : std::nullopt;
  }
  const Places places{.monitors = monitors, .table = table()};
  const std::lock_guard lock(stages_mutex_);
  if (find(places) != nullptr) return std::nullopt;
  preparation.set_what("simulating the scene");
  preparation.set_done(tracing_ == places ? share_ : 0.0);
  return preparation;
}

Turntable SimCamera::table() const {
  const std::lock_guard lock(mutex_);
  return table_;
}

void SimCamera::turn(double degrees) {
  const std::lock_guard lock(mutex_);
  table_.turn_deg = std::clamp(table_.turn_deg, degrees, degrees + options_.backlash_deg);
}

absl::Status SimCamera::start(double exposure_ms) {
  const double longest_ms = 1000.0 / options_.frame_rate_hz;
  if (!(exposure_ms >= kMinExposureMs && exposure_ms <= longest_ms)) {
    return absl::InvalidArgumentError(fmt::format("exposure_ms is {}; this camera takes {} to {} ms",
                                                  exposure_ms, kMinExposureMs, longest_ms));
  }
  const std::vector<EmissionMonitor> monitors = timeline_.monitors();
  if (monitors.empty() && options_.awaits_light)
    return absl::UnavailableError("the simulated camera is waiting for the monitors' light");
  if (!monitors.empty()) GW_RETURN_IF_ERROR(stage(monitors, table()).status());
  const std::lock_guard lock(mutex_);
  running_ = true;
  exposure_ms_ = exposure_ms;
  next_start_ = monotonic_now();
  if (first_start_ == nanoseconds(0)) first_start_ = next_start_;
  return absl::OkStatus();
}

void SimCamera::stop() {
  const std::lock_guard lock(mutex_);
  running_ = false;
}

bool SimCamera::move(bool present) {
  const std::lock_guard lock(mutex_);
  object_ = present;
  return true;
}

std::optional<CapturedFrame> SimCamera::next(std::chrono::milliseconds timeout) {
  Exposed exposed;
  std::int64_t sequence = 0;
  double exposure_ms = 0.0;
  nanoseconds start{}, late{}, stamp_error = options_.stamp_shift;
  bool dropped = false;
  const nanoseconds period(std::llround(1e9 / options_.frame_rate_hz));
  {
    const std::lock_guard lock(mutex_);
    if (!running_) return std::nullopt;
    const auto up_to = [this](nanoseconds max) {
      return nanoseconds(std::uniform_int_distribution<std::int64_t>(0, max.count())(random_));
    };
    // The camera is free-running: frames that were not taken in time are lost.
    const nanoseconds behind = monotonic_now() - next_start_;
    if (behind > std::chrono::seconds(1)) {
      next_start_ += behind / period * period;
      sequence_ += behind / period;
    }
    const nanoseconds until = next_start_ + timeout;
    do {
      ++sequence_;
      start = next_start_;
      next_start_ += period;
      dropped = std::bernoulli_distribution(options_.drop)(random_);
    } while (dropped && start < until);
    sequence = sequence_;
    exposure_ms = exposure_ms_;
    const bool duplicate = std::bernoulli_distribution(options_.duplicate)(random_);
    if (!duplicate || newest_.sequence == 0) {
      const nanoseconds exposure(std::llround(exposure_ms * 1e6));
      newest_ = {.sequence = sequence_,
                 .window = {.start = start, .exposure = exposure},
                 .object = object_,
                 .table = table_,
                 .at_s = std::chrono::duration<double>(start - first_start_).count()};
    }
    exposed = newest_;
    late = up_to(options_.late);
    stamp_error += up_to(2 * options_.stamp_jitter) - options_.stamp_jitter;
  }
  if (dropped) {
    sleep_until_monotonic(start);
    return std::nullopt;
  }
  const nanoseconds end = start + options_.sensor.readout + nanoseconds(std::llround(exposure_ms * 1e6));
  delivered_ = std::max(delivered_, end + late);
  sleep_until_monotonic(delivered_);
  CapturedFrame frame;
  frame.taken.set_sequence(sequence);
  frame.taken.set_exposure_start_ns(options_.clock.reading_at(start + stamp_error).count());
  frame.taken.set_exposure_end_ns(options_.clock.reading_at(end + stamp_error).count());
  frame.taken.set_uncertainty_ns(1000 + options_.stamp_jitter.count());
  frame.taken.set_exposure_ms(exposure_ms);
  frame.taken.set_gain(1.0);
  frame.taken.set_width_px(options_.width_px);
  frame.taken.set_height_px(options_.height_px);
  frame.image = [this, exposed, exposure_ms] { return expose_frame(exposed, exposure_ms); };
  return frame;
}

absl::StatusOr<Image16> SimCamera::expose_frame(const Exposed& exposed, double exposure_ms) {
  RadianceImage radiance(options_.width_px, options_.height_px);
  if (timeline_.wait_known_until(end_of(exposed.window), kMaxLightDelay)) {
    GW_ASSIGN_OR_RETURN(radiance, radiance_on(exposed));
  }
  const Automatics& automatics = options_.automatics;
  if (automatics.gain || automatics.white_balance)
    GW_RETURN_IF_ERROR(apply_automatics(exposed, exposure_ms, radiance));
  Image16 image = expose(radiance, exposure_ms, options_.sensor, exposed.sequence);
  spoil_pixels(options_.disturbances, image);
  if (options_.mosaic.empty()) return image;
  GW_ASSIGN_OR_RETURN(const Mosaic mosaic, Mosaic::parse(options_.mosaic));
  return sampled(image, mosaic);
}

nanoseconds SimCamera::end_of(const ExposureWindow& window) const {
  return window.start + options_.sensor.readout + window.exposure;
}

absl::StatusOr<RadianceImage> SimCamera::radiance_on(const Exposed& exposed) {
  const ExposureWindow& window = exposed.window;
  const auto emitted = timeline_.between(window.start, end_of(window));
  if (!emitted) {
    return absl::UnavailableError(
        "the light of this exposure is no longer kept: the monitors' pictures change faster than the "
        "simulated camera computes frames");
  }
  const std::vector<MonitorEmission>& emission = *emitted;
  if (emission.empty()) return RadianceImage(options_.width_px, options_.height_px);
  std::vector<EmissionMonitor> monitors;
  for (const MonitorEmission& each : emission) monitors.push_back(each.monitor);
  GW_ASSIGN_OR_RETURN(const StageTransports through, stage(monitors, exposed.table));
  const nanoseconds middle = options_.clock.reading_at((window.start + end_of(window)) / 2);
  const size_t phase = motion_.phase_at(middle);
  RadianceImage radiance = integrate(exposed.object ? *through.phases[phase] : *through.empty, emission,
                                     window, options_.sensor.readout);
  if (blurs()) radiance = through_lens(radiance, options_.blur_sigma_px);
  disturb(options_.disturbances, exposed.at_s, radiance);
  return radiance;
}

// Recomputes the previous frames, so that a frame's gains depend on the light alone and not on which frames
// were requested.
absl::Status SimCamera::apply_automatics(const Exposed& exposed, double exposure_ms,
                                         RadianceImage& radiance) {
  const nanoseconds period(std::llround(1e9 / options_.frame_rate_hz));
  const double scale = exposure_ms / options_.sensor.full_scale_exposure_ms;
  std::vector<Colour> light_before;
  Exposed before = exposed;
  for (int k = 1; k <= kFramesRemembered; ++k) {
    before.window.start -= period;
    before.at_s = exposed.at_s - k * std::chrono::duration<double>(period).count();
    GW_ASSIGN_OR_RETURN(const RadianceImage seen, radiance_on(before));
    std::array<double, 3> sums{};
    for (size_t i = 0; i < seen.samples.size(); ++i) sums[i % 3] += static_cast<double>(seen.samples[i]);
    Colour& light = light_before.emplace_back();
    for (size_t c = 0; c < 3; ++c)
      light[c] = static_cast<float>(3.0 * scale * sums[c] / static_cast<double>(seen.samples.size()));
  }
  const Colour gains = automatic_gains(options_.automatics, light_before);
  for (size_t i = 0; i < radiance.samples.size(); ++i) radiance.samples[i] *= gains[i % 3];
  return absl::OkStatus();
}

const SimCamera::TracedStage* SimCamera::find(const Places& wanted) const {
  const auto found = std::ranges::find(traced_, wanted, &TracedStage::places);
  return found == traced_.end() ? nullptr : &*found;
}

absl::StatusOr<StageTransports> SimCamera::stage(const std::vector<EmissionMonitor>& monitors,
                                                 const Turntable& table) {
  const Places wanted{.monitors = in_scene(monitors), .table = table};
  const TracedStage* found = nullptr;
  std::unique_lock lock(stages_mutex_);
  const bool traced = traced_changed_.wait_for(lock, kMaxTraceWait, [&] {
    found = find(wanted);
    if (found == nullptr && !asked_ && tracing_ != wanted) {
      asked_ = wanted;
      asked_changed_.notify_one();
    }
    return found != nullptr;
  });
  if (traced) return found->transports;
  return absl::UnavailableError("the simulated camera is still tracing its scene");
}

void SimCamera::prepare(std::stop_token stop) {
  constexpr std::chrono::milliseconds kPoll(50);
  Places before;
  std::unique_lock lock(stages_mutex_);
  while (!stop.stop_requested()) {
    asked_changed_.wait_for(lock, stop, kPoll, [&] { return asked_.has_value(); });
    std::optional<Places> wanted = std::exchange(asked_, std::nullopt);
    if (!wanted) {
      // Wait for one poll without a change: monitors are added one by one, and the table turns.
      Places now{.monitors = in_scene(timeline_.monitors()), .table = table()};
      if (now == before && !now.monitors.empty()) wanted = now;
      before = std::move(now);
    }
    if (wanted && find(*wanted) == nullptr && !stop.stop_requested()) trace(*wanted, lock, stop);
  }
}

void SimCamera::trace(const Places& wanted, std::unique_lock<std::mutex>& lock, std::stop_token stop) {
  tracing_ = wanted;
  share_ = 0.0;
  lock.unlock();
  spdlog::info("scene={} is being traced; no frames until then", options_.scene);
  const int finer = blurs() ? kRaysAcross : 1;
  const double focal_widths = options_.focal_px ? *options_.focal_px / options_.width_px : kFocalWidths;
  absl::StatusOr<StageTransports> transports = build_phases(
      options_.scene, wanted.monitors, finer * options_.width_px, finer * options_.height_px,
      kRaysAcross / finer, focal_widths,
      [&](double share) {
        const std::lock_guard guard(stages_mutex_);
        share_ = share;
        return !stop.stop_requested();
      },
      wanted.table, options_.ray_areas);
  if (transports.ok()) spdlog::info("scene={} is traced", options_.scene);
  lock.lock();
  tracing_.reset();
  if (absl::IsCancelled(transports.status())) return;
  traced_.push_front({.places = wanted, .transports = std::move(transports)});
  if (traced_.size() > kStagesKept) traced_.pop_back();
  traced_changed_.notify_all();
}

}  // namespace glasswing
