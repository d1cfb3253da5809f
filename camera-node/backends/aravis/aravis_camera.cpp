#include "camera-node/backends/aravis/aravis_camera.h"

#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "camera-node/backends/aravis/aravis_run.h"
#include "camera-node/camera_metrics.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kNoFrames(5000);  // the camera is considered dead after this
constexpr int kRateFrames = 12;
constexpr int kMinTriggered = 8;               // frames that relate the timestamps
constexpr int kMaxTriggers = 60;               // for this many; with lost packets some fail
constexpr milliseconds kTriggerPatience(300);  // in addition to exposure and readout
constexpr std::chrono::seconds kTemperatureInterval(10);

bool same_setting(double is, double asked) {
  return std::abs(is - asked) <= 0.01 * asked;
}

nanoseconds of_ms(double ms) {
  return nanoseconds(std::llround(ms * 1e6));
}

bool is_in_decibels(const AravisDevice& device) {
  ArvGcNode* const node = arv_device_get_feature(arv_camera_get_device(device.get()), "Gain");
  const char* const unit =
      node != nullptr && ARV_IS_GC_FLOAT(node) ? arv_gc_float_get_unit(ARV_GC_FLOAT(node)) : nullptr;
  return unit != nullptr && std::string_view(unit) == "dB";
}

double linear_gain(bool decibels, double gain) {
  if (decibels) return std::pow(10.0, gain / 20.0);
  return gain > 0.0 ? gain : 1.0;
}

// CLOCK_REALTIME - CLOCK_MONOTONIC.
nanoseconds realtime_offset() {
  const nanoseconds before = monotonic_now();
  timespec real{};
  ::clock_gettime(CLOCK_REALTIME, &real);
  return std::chrono::seconds(real.tv_sec) + nanoseconds(real.tv_nsec) - (before + monotonic_now()) / 2;
}

}  // namespace

AravisCamera::AravisCamera(const Options& options) : options_(options) {}

AravisCamera::~AravisCamera() = default;

absl::StatusOr<std::unique_ptr<AravisCamera>> AravisCamera::open(const Options& options) {
  std::unique_ptr<AravisCamera> camera(new AravisCamera(options));
  GW_RETURN_IF_ERROR(camera->connect());
  GW_RETURN_IF_ERROR(camera->learn_rate());
  camera->warn_of_small_socket();
  camera->read_temperature();
  return camera;
}

absl::Status AravisCamera::connect() {
  device_.reset();  // before it is opened again
  GW_ASSIGN_OR_RETURN(device_, AravisDevice::open(options_.device));
  ArvCamera* const camera = device_->get();
  if (arv_camera_is_gv_device(camera)) {
    // Packet sockets need a capability, and lose packets from this machine.
    arv_camera_gv_set_stream_options(camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    GW_RETURN_IF_ERROR(arv_call("set its packet size", [&](GError** error) {
      arv_camera_gv_set_packet_size(camera, options_.packet_bytes, error);
    }));
  }
  GW_RETURN_IF_ERROR(set_format());
  GW_RETURN_IF_ERROR(set_region());
  GW_RETURN_IF_ERROR(set_light());
  GW_RETURN_IF_ERROR(check_trigger());
  GW_RETURN_IF_ERROR(device_->enable_chunks());
  if (!options_.ptp.empty()) GW_RETURN_IF_ERROR(device_->enable_ptp());
  return learn_exposures();
}

absl::Status AravisCamera::set_format() {
  ArvCamera* const camera = device_->get();
  std::string name = options_.format;
  if (name.empty()) {
    GW_ASSIGN_OR_RETURN(const char* own, arv_call("tell its pixel format", [&](GError** error) {
                          return arv_camera_get_pixel_format_as_string(camera, error);
                        }));
    name = own == nullptr ? "" : own;
  }
  const std::vector<std::string> offered = device_->pixel_formats();
  format_ = find_pixel_format(name);
  if (format_ == nullptr || std::ranges::find(offered, name) == offered.end()) {
    std::vector<std::string> supported;
    for (const std::string& each : offered) {
      if (find_pixel_format(each) != nullptr) supported.push_back(each);
    }
    return absl::InvalidArgumentError(fmt::format(
        "--format is {}; camera \"{}\" has {}", options_.format.empty() ? "not given" : name, device_->id(),
        supported.empty() ? "none" : fmt::format("{}", fmt::join(supported, ", "))));
  }
  return arv_call("set its pixel format", [&](GError** error) {
    arv_camera_set_pixel_format_from_string(camera, name.c_str(), error);
  });
}

absl::Status AravisCamera::set_region() {
  ArvCamera* const camera = device_->get();
  gint sensor_width = 0, sensor_height = 0;
  GW_RETURN_IF_ERROR(arv_call("tell its sensor's size", [&](GError** error) {
    arv_camera_get_sensor_size(camera, &sensor_width, &sensor_height, error);
  }));
  size_ = options_.size.value_or(PictureSize{sensor_width, sensor_height});
  const Offset at = options_.offset.value_or(
      Offset{(sensor_width - size_.width_px) / 4 * 2, (sensor_height - size_.height_px) / 4 * 2});
  if (at.x_px + size_.width_px > sensor_width || at.y_px + size_.height_px > sensor_height) {
    return absl::InvalidArgumentError(
        fmt::format("--size is {}x{} at {},{}; the sensor of camera \"{}\" has {}x{} px", size_.width_px,
                    size_.height_px, at.x_px, at.y_px, device_->id(), sensor_width, sensor_height));
  }
  if (size_.width_px % format_->group_px() != 0) {
    return absl::InvalidArgumentError(
        fmt::format("--size is {}x{}; with {} the width must be a multiple of {}", size_.width_px,
                    size_.height_px, format_->name, format_->group_px()));
  }
  GW_RETURN_IF_ERROR(arv_call("set its region", [&](GError** error) {
    arv_camera_set_region(camera, at.x_px, at.y_px, size_.width_px, size_.height_px, error);
  }));
  gint x = 0, y = 0, width = 0, height = 0;
  GW_RETURN_IF_ERROR(arv_call("tell its region", [&](GError** error) {
    arv_camera_get_region(camera, &x, &y, &width, &height, error);
  }));
  if (PictureSize{width, height} == size_ && x == at.x_px && y == at.y_px) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("--size is {}x{} at {},{}; camera \"{}\" makes it {}x{} at {},{}", size_.width_px,
                  size_.height_px, at.x_px, at.y_px, device_->id(), width, height, x, y));
}

absl::Status AravisCamera::set_light() {
  ArvCamera* const camera = device_->get();
  for (const char* automatic : {"ExposureAuto", "GainAuto", "BlackLevelAuto", "BalanceWhiteAuto"})
    GW_RETURN_IF_ERROR(device_->set_if_there(automatic, "Off"));
  GW_RETURN_IF_ERROR(device_->set_if_there("GammaEnable", "false"));
  const auto set = [&](const char* option, std::optional<double> value, bool there, auto bounds,
                       auto setter) -> absl::Status {
    if (!value) return absl::OkStatus();
    double min = 0.0, max = 0.0;
    if (there) {
      GW_RETURN_IF_ERROR(arv_call(fmt::format("tell the range of {}", option),
                                  [&](GError** error) { bounds(camera, &min, &max, error); }));
    }
    if (!there || !(*value >= min && *value <= max)) {
      return absl::InvalidArgumentError(
          fmt::format("{} is {}; camera \"{}\" {}", option, *value, device_->id(),
                      there ? fmt::format("takes {:.6g} to {:.6g}", min, max) : "has no such setting"));
    }
    return arv_call(fmt::format("take {} {}", option, *value),
                    [&](GError** error) { setter(camera, *value, error); });
  };
  const bool has_gain = arv_camera_is_gain_available(camera, nullptr);
  GW_RETURN_IF_ERROR(set("--gain", options_.gain, has_gain, arv_camera_get_gain_bounds, arv_camera_set_gain));
  GW_RETURN_IF_ERROR(set("--black-level", options_.black_level,
                         arv_camera_is_black_level_available(camera, nullptr),
                         arv_camera_get_black_level_bounds, arv_camera_set_black_level));
  GW_RETURN_IF_ERROR(set("--fps", options_.frame_rate_hz, arv_camera_is_frame_rate_available(camera, nullptr),
                         arv_camera_get_frame_rate_bounds, arv_camera_set_frame_rate));
  if (has_gain) {
    GW_ASSIGN_OR_RETURN(const double gain, arv_call("tell its gain", [&](GError** error) {
                          return arv_camera_get_gain(camera, error);
                        }));
    gain_is_db_ = is_in_decibels(*device_);
    gain_ = linear_gain(gain_is_db_, gain);
  }
  return absl::OkStatus();
}

absl::Status AravisCamera::check_trigger() {
  ArvCamera* const camera = device_->get();
  software_trigger_ = arv_camera_is_software_trigger_supported(camera, nullptr);
  std::vector<std::string> sources;
  if (software_trigger_) sources.push_back("software");
  for (const std::string& source : device_->trigger_sources()) {
    if (source.starts_with("Line")) sources.push_back(source);
  }
  if (!options_.trigger.empty() && std::ranges::find(sources, options_.trigger) == sources.end()) {
    return absl::InvalidArgumentError(
        fmt::format("--trigger is {}; camera \"{}\" has {}", options_.trigger, device_->id(),
                    sources.empty() ? "none" : fmt::format("{}", fmt::join(sources, ", "))));
  }
  const bool has_delay = device_->has("TriggerDelay");
  if (options_.line_delay && !has_delay) {
    return absl::InvalidArgumentError(
        fmt::format("--line-delay-ms is given; camera \"{}\" has no TriggerDelay", device_->id()));
  }
  if (!options_.trigger.starts_with("Line") || !has_delay) return absl::OkStatus();
  if (options_.line_delay) {
    GW_RETURN_IF_ERROR(arv_call("set its trigger delay", [&](GError** error) {
      arv_camera_set_float(camera, "TriggerDelay", static_cast<double>(options_.line_delay->count()) / 1e3,
                           error);
    }));
  }
  GW_ASSIGN_OR_RETURN(const double delay_us, arv_call("tell its trigger delay", [&](GError** error) {
                        return arv_camera_get_float(camera, "TriggerDelay", error);
                      }));
  line_delay_ = of_ms(delay_us / 1e3);
  return absl::OkStatus();
}

absl::Status AravisCamera::learn_exposures() {
  double min_us = 0.0, max_us = 0.0;
  GW_RETURN_IF_ERROR(arv_call("tell its range of exposures", [&](GError** error) {
    arv_camera_get_exposure_time_bounds(device_->get(), &min_us, &max_us, error);
  }));
  min_exposure_ms_ = std::max(min_us, 1.0) / 1e3;
  max_exposure_ms_ = max_us / 1e3;
  // A longer exposure would lower the frame rate.
  if (period_.count() > 0)
    max_exposure_ms_ = std::min(max_exposure_ms_, static_cast<double>(period_.count()) / 1e6);
  return absl::OkStatus();
}

absl::Status AravisCamera::learn_rate() {
  GW_RETURN_IF_ERROR(set_exposure(std::clamp(1.0, min_exposure_ms_, max_exposure_ms_)));
  GW_RETURN_IF_ERROR(begin(""));
  std::vector<nanoseconds> intervals;
  std::optional<AravisRun::Frame> before;
  const nanoseconds deadline = monotonic_now() + 2 * kNoFrames;
  while (intervals.size() < kRateFrames && monotonic_now() < deadline) {
    std::optional<AravisRun::Frame> frame = run_->next(kNoFrames);
    if (!frame) break;
    if (frame->fault != nullptr) continue;
    if (before && frame->id > before->id)
      intervals.push_back((frame->stamp - before->stamp) / static_cast<std::int64_t>(frame->id - before->id));
    before = std::move(frame);
  }
  stop();
  if (intervals.empty()) {
    return absl::UnavailableError(
        fmt::format("camera \"{}\" delivers no complete frames; does the network support packets of {} bytes "
                    "(--packet-size)?",
                    device_->id(), options_.packet_bytes));
  }
  const auto middle = intervals.begin() + intervals.size() / 2;
  std::nth_element(intervals.begin(), middle, intervals.end());
  if (middle->count() <= 0) {
    return absl::UnavailableError(
        fmt::format("the time stamps of camera \"{}\" do not increase from frame to frame", device_->id()));
  }
  period_ = *middle;
  return learn_exposures();
}

void AravisCamera::warn_of_small_socket() const {
  size_t allowed_bytes = 0;
  if (!arv_camera_is_gv_device(device_->get()) ||
      !(std::ifstream("/proc/sys/net/core/rmem_max") >> allowed_bytes))
    return;
  const size_t frame_bytes = row_bytes(*format_, size_.width_px) * static_cast<size_t>(size_.height_px);
  const size_t wanted_bytes = wanted_socket_bytes(frame_bytes, static_cast<size_t>(options_.packet_bytes));
  if (allowed_bytes >= wanted_bytes / 2) return;
  spdlog::warn(
      "net.core.rmem_max is {}: a socket holds {:.2g} frames of {:.3g} MB in packets of {} bytes, and loses "
      "packets while this machine is busy; sysctl -w net.core.rmem_max={} gives room for {}",
      allowed_bytes, kSocketFrames * static_cast<double>(allowed_bytes) / static_cast<double>(wanted_bytes),
      1e-6 * static_cast<double>(frame_bytes), options_.packet_bytes, wanted_bytes, kSocketFrames);
}

v1::GetCameraResponse AravisCamera::describe() const {
  v1::GetCameraResponse response;
  v1::Camera& camera = *response.mutable_camera();
  camera.set_name(options_.name);
  camera.set_width_px(size_.width_px);
  camera.set_height_px(size_.height_px);
  camera.set_bits(format_->bits);
  if (format_->kind == PixelFormat::Kind::kBayer) camera.set_mosaic(std::string(format_->order));
  camera.set_response("linear");  // gamma is switched off
  response.set_backend("aravis");
  response.set_frame_rate_hz(1e9 / static_cast<double>(period_.count()));
  response.set_min_exposure_ms(min_exposure_ms_);
  response.set_max_exposure_ms(max_exposure_ms_);
  response.set_readout_ns(options_.readout.count());
  response.set_trigger(options_.trigger);
  response.set_line_delay_ns(line_delay_.count());
  response.set_dropped_frames(dropped_frames_);
  response.set_missing_packets(dropped_packets_);
  const std::lock_guard lock(mutex_);
  if (temperature_c_) response.set_temperature_c(*temperature_c_);
  return response;
}

absl::Status AravisCamera::begin(const std::string& trigger) {
  stop();
  const RawPicture blank{.format = format_,
                         .width_px = size_.width_px,
                         .height_px = size_.height_px,
                         .stride_bytes = row_bytes(*format_, size_.width_px),
                         .colour = {.transfer = ColourCode::Transfer::kLinear},
                         .black = 0.0,
                         .planes = {}};
  GW_ASSIGN_OR_RETURN(std::unique_ptr<AravisRun> run,
                      AravisRun::begin(device_, blank, trigger == "software" ? "Software" : trigger));
  counted_packets_ = last_id_ = 0;
  const std::lock_guard lock(mutex_);
  run_ = std::move(run);
  return absl::OkStatus();
}

absl::Status AravisCamera::set_exposure(double exposure_ms) {
  ArvCamera* const camera = device_->get();
  GW_RETURN_IF_ERROR(arv_call("set its exposure", [&](GError** error) {
    arv_camera_set_exposure_time(camera, 1e3 * exposure_ms, error);
  }));
  GW_ASSIGN_OR_RETURN(const double is_us, arv_call("tell its exposure", [&](GError** error) {
                        return arv_camera_get_exposure_time(camera, error);
                      }));
  if (!same_setting(is_us / 1e3, exposure_ms)) {
    return absl::FailedPreconditionError(
        fmt::format("camera \"{}\" was told to expose {} ms; it reports {:.6g} ms", device_->id(),
                    exposure_ms, is_us / 1e3));
  }
  exposure_ms_ = is_us / 1e3;
  return absl::OkStatus();
}

absl::Status AravisCamera::start(double exposure_ms, const std::string& trigger) {
  if (!(exposure_ms >= min_exposure_ms_ && exposure_ms <= max_exposure_ms_)) {
    return absl::InvalidArgumentError(fmt::format("exposure_ms is {}; this camera takes {:.6g} to {:.6g} ms",
                                                  exposure_ms, min_exposure_ms_, max_exposure_ms_));
  }
  stop();
  if (device_ == nullptr || device_->lost()) {
    const absl::Status status = connect();
    if (absl::IsNotFound(status)) return absl::UnavailableError(status.message());
    GW_RETURN_IF_ERROR(status);
  }
  GW_RETURN_IF_ERROR(set_exposure(exposure_ms));
  if (software_trigger_) {
    GW_RETURN_IF_ERROR(learn_stamps());
  } else {
    clock_ = StampClock::of_arrivals(options_.delay.value_or(period_));
  }
  ptp_holds_ = true;
  read_temperature();
  if (software_trigger_ && trigger == "software") return absl::OkStatus();
  return begin(trigger);
}

Sighting AravisCamera::sighting_of(nanoseconds stamp, nanoseconds first, nanoseconds complete) const {
  return {.stamp = stamp,
          .begun_by = std::min(first, complete - of_ms(exposure_ms_) - options_.readout),
          .triggered = {}};
}

absl::Status AravisCamera::learn_stamps() {
  GW_RETURN_IF_ERROR(begin("software"));
  const auto patience =
      kTriggerPatience + std::chrono::duration_cast<milliseconds>(of_ms(exposure_ms_) + options_.readout);
  // A camera that was free-running may still send a frame.
  const auto frame_time = std::chrono::ceil<milliseconds>(period_ + of_ms(exposure_ms_));
  const nanoseconds rested = monotonic_now() + std::chrono::seconds(1);
  while (run_->next(frame_time) && monotonic_now() < rested) {
  }
  std::vector<Sighting> seen;
  for (int i = 0; i < kMaxTriggers && seen.size() < kMinTriggered; ++i) {
    while (run_->next(milliseconds(0))) {
    }
    const nanoseconds triggered = monotonic_now();
    GW_RETURN_IF_ERROR(run_->trigger());
    const std::optional<AravisRun::Frame> frame = run_->next(patience);
    // A late frame of an earlier trigger would show less than this one.
    if (!frame || frame->fault != nullptr || frame->first < triggered) continue;
    seen.push_back(sighting_of(frame->stamp, frame->first, frame->complete));
    seen.back().triggered = triggered;
  }
  if (seen.empty())
    return absl::UnavailableError(
        fmt::format("camera \"{}\" delivers no frame when it is triggered", device_->id()));
  clock_ = StampClock::of_triggers(seen, options_.trigger_delay);
  return absl::OkStatus();
}

absl::Status AravisCamera::trigger(nanoseconds at) {
  sleep_until_monotonic(at);
  const std::lock_guard lock(mutex_);
  if (run_ == nullptr || !run_->waits_for("Software"))
    return absl::FailedPreconditionError("the camera does not wait for triggers");
  return run_->trigger();
}

void AravisCamera::count_packets() {
  const std::uint64_t missing = run_->missing_packets();
  if (missing > counted_packets_) {
    camera_metrics().missing_packets.Increment(static_cast<double>(missing - counted_packets_));
    dropped_packets_ += static_cast<std::int64_t>(missing - counted_packets_);
  }
  counted_packets_ = std::max(missing, counted_packets_);
}

void AravisCamera::read_temperature() {
  if (monotonic_now() - temperature_at_ < kTemperatureInterval || !device_->has("DeviceTemperature")) return;
  temperature_at_ = monotonic_now();
  const absl::StatusOr<double> is = arv_call("tell its temperature", [&](GError** error) {
    return arv_camera_get_float(device_->get(), "DeviceTemperature", error);
  });
  const std::lock_guard lock(mutex_);
  temperature_c_ = is.ok() ? std::optional(*is) : std::nullopt;
}

void AravisCamera::drop(const std::string& why) {
  camera_metrics().incomplete.Increment();
  ++dropped_frames_;
  spdlog::warn("frame dropped, {}: sequence={} missing_packets={}", why, sequence_, counted_packets_);
}

ClockReading AravisCamera::start_of(nanoseconds stamp) {
  const ClockReading known = clock_.start_of(stamp);
  if (options_.ptp.empty() || !ptp_holds_) return known;
  const nanoseconds as_start = options_.ptp == "end" ? stamp - of_ms(exposure_ms_) : stamp;
  const std::optional<ClockReading> start = ptp_start(as_start, realtime_offset(), known, options_.ptp_error);
  if (start) return *start;
  spdlog::warn(
      "the camera's timestamps contradict --ptp {}: they are not used as this machine's time in this run",
      options_.ptp);
  ptp_holds_ = false;
  return known;
}

std::optional<CapturedFrame> AravisCamera::next(std::chrono::milliseconds timeout) {
  if (run_ == nullptr) return std::nullopt;
  const nanoseconds deadline = monotonic_now() + timeout;
  std::optional<AravisRun::Frame> frame;
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(std::max(deadline - monotonic_now(), nanoseconds(0)));
    frame = run_->next(left);
    if (!frame) return std::nullopt;
    // Their numbers have 16 bits in GigE Vision 1, without 0.
    const auto passed = static_cast<std::uint16_t>(frame->id - last_id_);
    sequence_ += last_id_ == 0 || passed == 0 || passed > 1000 ? 1 : passed;
    last_id_ = frame->id;
    count_packets();
    for (int overrun = run_->take_overrun(); overrun > 0; --overrun) drop("this machine did not keep up");
    const double is_ms = frame->exposure_us ? *frame->exposure_us / 1e3 : exposure_ms_;
    if (frame->fault != nullptr)
      drop(frame->fault);
    else if (!same_setting(is_ms, exposure_ms_))
      drop(fmt::format("it was exposed for {:.6g} ms instead of {:.6g}", is_ms, exposure_ms_));
    else
      break;
  }
  clock_.add(sighting_of(frame->stamp, frame->first, frame->complete));
  const ClockReading start = start_of(frame->stamp);
  const nanoseconds length = of_ms(exposure_ms_) + options_.readout;
  const nanoseconds began = std::min(start.time, frame->complete - length);
  CapturedFrame captured;
  captured.taken.set_sequence(sequence_);
  captured.taken.set_exposure_start_ns(began.count());
  captured.taken.set_exposure_end_ns((began + length).count());
  captured.taken.set_uncertainty_ns(start.error.count());
  captured.taken.set_exposure_ms(exposure_ms_);
  captured.taken.set_gain(frame->gain ? linear_gain(gain_is_db_, *frame->gain) : gain_);
  captured.taken.set_width_px(size_.width_px);
  captured.taken.set_height_px(size_.height_px);
  captured.image = [picture = frame->picture] { return image_of(*picture); };
  captured.held_bytes = frame->picture->planes.front().size();
  return captured;
}

void AravisCamera::stop() {
  const std::lock_guard lock(mutex_);
  run_.reset();
}

}  // namespace glasswing
