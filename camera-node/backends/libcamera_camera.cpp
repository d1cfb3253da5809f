#include "camera-node/backends/libcamera_camera.h"

#include <absl/strings/ascii.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "camera-node/backends/libcamera_run.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

namespace controls = libcamera::controls;
using std::chrono::milliseconds;

constexpr milliseconds kNoFrames(5000);  // the camera is considered dead after this
constexpr int kSettleWithin = 60;        // frames, if their metadata report the exposure
constexpr int kSettledAfter = 10;        // frames, if they do not
constexpr int kRateFrames = 12;

template <typename Range, typename Name>
std::string listed(const Range& range, const Name& name) {
  std::string list;
  for (const auto& each : range) list += fmt::format("{}{}", list.empty() ? "" : ", ", name(each));
  return list.empty() ? "none" : list;
}

std::string model_of(const libcamera::Camera& camera) {
  return camera.properties().get(libcamera::properties::Model).value_or("");
}

std::string listed(const std::vector<std::shared_ptr<libcamera::Camera>>& cameras) {
  return listed(cameras, [](const auto& camera) {
    return fmt::format("\"{}\" ({})", camera->id(), model_of(*camera));
  });
}

const libcamera::ControlInfo* find_control(const libcamera::Camera& camera, const libcamera::ControlId& id) {
  const auto found = camera.controls().find(id.id());
  return found == camera.controls().end() ? nullptr : &found->second;
}

// Only the ids of USB cameras end with vendor and product: "-046d:0825".
bool is_usb(const std::string& id) {
  if (id.size() < 10) return false;
  const std::string end = id.substr(id.size() - 10);
  return end[0] == '-' && end[5] == ':' && std::all_of(end.begin() + 1, end.end(), [](char c) {
           return c == ':' || absl::ascii_isxdigit(static_cast<unsigned char>(c));
         });
}

bool same_setting(double is, double asked) {
  return std::abs(is - asked) <= 0.01 * asked;
}

}  // namespace

LibcameraCamera::LibcameraCamera(const Options& options)
    : options_(options), manager_(std::make_unique<libcamera::CameraManager>()) {}

LibcameraCamera::~LibcameraCamera() {
  run_.reset();
  manager_->stop();
}

absl::StatusOr<std::unique_ptr<LibcameraCamera>> LibcameraCamera::open(const Options& options) {
  ::setenv("LIBCAMERA_LOG_LEVELS", "ERROR", 0);  // unless the user has set it
  std::unique_ptr<LibcameraCamera> camera(new LibcameraCamera(options));
  if (const int error = camera->manager_->start(); error < 0)
    return absl::UnavailableError(fmt::format("libcamera does not start: {}", std::strerror(-error)));
  GW_RETURN_IF_ERROR(camera->find_camera());
  GW_RETURN_IF_ERROR(camera->learn_format());
  GW_RETURN_IF_ERROR(camera->learn_controls());
  GW_RETURN_IF_ERROR(camera->learn_rate());
  return camera;
}

absl::Status LibcameraCamera::find_camera() {
  const std::vector<std::shared_ptr<libcamera::Camera>> all = manager_->cameras();
  std::vector<std::shared_ptr<libcamera::Camera>> matching;
  for (const auto& camera : all) {
    if (camera->id() == options_.camera) matching = {camera};
    if (camera->id() == options_.camera) break;
    if ((camera->id() + "\n" + model_of(*camera)).find(options_.camera) != std::string::npos)
      matching.push_back(camera);
  }
  if (matching.size() == 1) {
    id_ = matching.front()->id();
    usb_ = is_usb(id_);
    return absl::OkStatus();
  }
  const std::string what =
      options_.camera.empty() ? "no --camera is named" : fmt::format("--camera is \"{}\"", options_.camera);
  return absl::NotFoundError(
      fmt::format("{}, which fits {} cameras; libcamera sees {}", what, matching.size(), listed(all)));
}

std::unique_ptr<libcamera::CameraConfiguration> LibcameraCamera::configuration(
    libcamera::Camera& camera) const {
  for (const auto role : {libcamera::StreamRole::Raw, libcamera::StreamRole::VideoRecording,
                          libcamera::StreamRole::StillCapture}) {
    std::unique_ptr<libcamera::CameraConfiguration> each = camera.generateConfiguration({role});
    if (each == nullptr || each->empty()) continue;
    libcamera::StreamConfiguration& stream = each->at(0);
    for (const libcamera::PixelFormat& format : stream.formats().pixelformats()) {
      if (format.toString() != format_->name) continue;
      stream.pixelFormat = format;
      if (options_.size) {
        stream.size = {static_cast<unsigned>(options_.size->width_px),
                       static_cast<unsigned>(options_.size->height_px)};
      }
      if (each->validate() != libcamera::CameraConfiguration::Invalid && stream.pixelFormat == format)
        return each;
    }
  }
  return nullptr;
}

absl::Status LibcameraCamera::learn_format() {
  const std::shared_ptr<libcamera::Camera> camera = manager_->get(id_);
  std::vector<std::string> offered;
  for (const auto role : {libcamera::StreamRole::Raw, libcamera::StreamRole::VideoRecording,
                          libcamera::StreamRole::StillCapture}) {
    const std::unique_ptr<libcamera::CameraConfiguration> each = camera->generateConfiguration({role});
    if (each == nullptr || each->empty()) continue;
    for (const libcamera::PixelFormat& format : each->at(0).formats().pixelformats()) {
      if (std::find(offered.begin(), offered.end(), format.toString()) == offered.end())
        offered.push_back(format.toString());
    }
  }
  const auto list = [&offered] {
    return listed(offered, [](const std::string& name) {
      return name + (find_pixel_format(name) == nullptr ? " (not supported)" : "");
    });
  };
  for (const PixelFormat& format : pixel_formats()) {
    const bool wanted = options_.format.empty() || options_.format == format.name;
    if (wanted && std::find(offered.begin(), offered.end(), format.name) != offered.end()) {
      format_ = &format;
      break;
    }
  }
  if (format_ == nullptr) {
    return absl::InvalidArgumentError(fmt::format("--format is {}; camera \"{}\" has {}",
                                                  options_.format.empty() ? "not given" : options_.format,
                                                  id_, list()));
  }
  const std::unique_ptr<libcamera::CameraConfiguration> chosen = configuration(*camera);
  if (chosen == nullptr) {
    return absl::InvalidArgumentError(
        fmt::format("camera \"{}\" does not take its own format {}; it has {}", id_, format_->name, list()));
  }
  const libcamera::StreamConfiguration& stream = chosen->at(0);
  size_ = {static_cast<int>(stream.size.width), static_cast<int>(stream.size.height)};
  if (options_.size && *options_.size != size_) {
    return absl::InvalidArgumentError(fmt::format(
        "--size is {}x{}; camera \"{}\" would make it {} in {}, and has {}", options_.size->width_px,
        options_.size->height_px, id_, stream.size.toString(), format_->name,
        listed(stream.formats().sizes(stream.pixelFormat),
               [](const auto& size) { return size.toString(); })));
  }
  return absl::OkStatus();
}

absl::Status LibcameraCamera::learn_controls() {
  const std::shared_ptr<libcamera::Camera> camera = manager_->get(id_);
  const libcamera::ControlInfo* exposure = find_control(*camera, controls::ExposureTime);
  if (exposure == nullptr && !options_.fixed_exposure_ms) {
    return absl::FailedPreconditionError(
        fmt::format("camera \"{}\" has no exposure time control; if its exposure is constant, give it "
                    "with --fixed-exposure-ms",
                    id_));
  }
  if (exposure != nullptr && options_.fixed_exposure_ms) {
    return absl::InvalidArgumentError(fmt::format(
        "--fixed-exposure-ms is given, but the exposure of camera \"{}\" can be set; leave it out", id_));
  }
  if (exposure == nullptr) {
    min_exposure_ms_ = max_exposure_ms_ = *options_.fixed_exposure_ms;
  } else {
    min_exposure_ms_ = std::max(exposure->min().get<std::int32_t>(), 1) / 1e3;
    max_exposure_ms_ = exposure->max().get<std::int32_t>() / 1e3;
  }
  const libcamera::ControlInfo* gain = find_control(*camera, controls::AnalogueGain);
  const double min = gain == nullptr ? 1.0 : gain->min().get<float>();
  const double max = gain == nullptr ? 1.0 : gain->max().get<float>();
  if (!(options_.gain >= min && options_.gain <= max)) {
    return absl::InvalidArgumentError(
        fmt::format("--gain is {}; camera \"{}\" has {:.4g} to {:.4g}", options_.gain, id_, min, max));
  }
  if (options_.frame_rate_hz && find_control(*camera, controls::FrameDurationLimits) == nullptr) {
    return absl::InvalidArgumentError(
        fmt::format("--fps is given, but camera \"{}\" sets its frame rate itself; leave it out", id_));
  }
  return absl::OkStatus();
}

absl::Status LibcameraCamera::learn_rate() {
  GW_RETURN_IF_ERROR(begin(std::min(std::max(min_exposure_ms_, 1.0), max_exposure_ms_)));
  std::vector<nanoseconds> intervals;
  std::optional<LibcameraRun::Frame> before;
  for (int seen = 0; seen < kSettledAfter + kRateFrames; ++seen) {
    std::optional<LibcameraRun::Frame> frame = run_->next(kNoFrames);
    if (!frame) return why_no_frames();
    if (seen > kSettledAfter && frame->sequence > before->sequence)
      intervals.push_back((frame->stamp - before->stamp) / (frame->sequence - before->sequence));
    readout_ = frame->readout;
    before = std::move(frame);
  }
  run_.reset();
  const auto middle = intervals.begin() + intervals.size() / 2;
  std::nth_element(intervals.begin(), middle, intervals.end());
  if (intervals.empty() || middle->count() <= 0) {
    return absl::UnavailableError(
        fmt::format("the time stamps of camera \"{}\" do not increase from frame to frame", id_));
  }
  period_ = *middle;
  // A longer exposure would lower the frame rate, or be shortened without notice.
  if (!options_.fixed_exposure_ms)
    max_exposure_ms_ = std::min(max_exposure_ms_, static_cast<double>(period_.count()) / 1e6);
  return absl::OkStatus();
}

v1::GetCameraResponse LibcameraCamera::describe() const {
  v1::GetCameraResponse response;
  v1::Camera& camera = *response.mutable_camera();
  camera.set_name(options_.name);
  camera.set_width_px(size_.width_px);
  camera.set_height_px(size_.height_px);
  camera.set_bits(format_->bits);
  if (format_->kind == PixelFormat::Kind::kBayer) camera.set_mosaic(std::string(format_->order));
  camera.set_response("linear");  // image_of() decodes other transfer functions
  response.set_backend("libcamera");
  response.set_frame_rate_hz(1e9 / static_cast<double>(period_.count()));
  response.set_min_exposure_ms(min_exposure_ms_);
  response.set_max_exposure_ms(max_exposure_ms_);
  response.set_readout_ns(options_.readout.value_or(readout_.value_or(period_)).count());
  return response;
}

absl::Status LibcameraCamera::begin(double exposure_ms) {
  run_.reset();
  const std::shared_ptr<libcamera::Camera> camera = manager_->get(id_);
  if (camera == nullptr) {
    return absl::UnavailableError(
        fmt::format("camera \"{}\" is gone; libcamera sees {}", id_, listed(manager_->cameras())));
  }
  std::unique_ptr<libcamera::CameraConfiguration> chosen = configuration(*camera);
  if (chosen == nullptr || chosen->at(0).size != libcamera::Size(static_cast<unsigned>(size_.width_px),
                                                                 static_cast<unsigned>(size_.height_px))) {
    return absl::UnavailableError(
        fmt::format("camera \"{}\" has been replaced by another one, which has no {} of {}x{}", id_,
                    format_->name, size_.width_px, size_.height_px));
  }
  libcamera::ControlList modes(controls::controls), settings(controls::controls);
  if (find_control(*camera, controls::AeEnable) != nullptr) modes.set(controls::AeEnable, false);
  if (find_control(*camera, controls::AwbEnable) != nullptr) modes.set(controls::AwbEnable, false);
  if (!options_.fixed_exposure_ms)
    settings.set(controls::ExposureTime, static_cast<std::int32_t>(std::lround(exposure_ms * 1e3)));
  if (find_control(*camera, controls::AnalogueGain) != nullptr)
    settings.set(controls::AnalogueGain, static_cast<float>(options_.gain));
  if (options_.frame_rate_hz) {
    const std::int64_t duration_us = std::llround(1e6 / *options_.frame_rate_hz);
    const std::array<std::int64_t, 2> limits{duration_us, duration_us};
    settings.set(controls::FrameDurationLimits, libcamera::Span<const std::int64_t, 2>(limits));
  }
  GW_ASSIGN_OR_RETURN(run_, LibcameraRun::begin(camera, std::move(chosen), usb_, modes, settings));
  exposure_ms_ = exposure_ms;
  first_sequence_ = last_sequence_ + 1;
  return absl::OkStatus();
}

absl::Status LibcameraCamera::why_no_frames() const {
  if (run_->gone()) return absl::UnavailableError(fmt::format("camera \"{}\" is gone", id_));
  if (run_->refused())
    return absl::FailedPreconditionError(fmt::format("camera \"{}\" refused its settings", id_));
  return absl::UnavailableError(
      fmt::format("camera \"{}\" has delivered no frame for {} s", id_, kNoFrames / std::chrono::seconds(1)));
}

absl::Status LibcameraCamera::start(double exposure_ms) {
  if (!(exposure_ms >= min_exposure_ms_ && exposure_ms <= max_exposure_ms_)) {
    return absl::InvalidArgumentError(fmt::format("exposure_ms is {}; this camera takes {:.6g} to {:.6g} ms",
                                                  exposure_ms, min_exposure_ms_, max_exposure_ms_));
  }
  if (usb_ && !options_.fixed_exposure_ms) {
    const double possible_ms = std::max(std::round(exposure_ms * 10.0), 1.0) / 10.0;
    if (!same_setting(possible_ms, exposure_ms)) {
      return absl::InvalidArgumentError(
          fmt::format("exposure_ms is {}; this camera takes whole tenths of a millisecond, such as {:.1f}",
                      exposure_ms, possible_ms));
    }
    exposure_ms = possible_ms;
  }
  GW_RETURN_IF_ERROR(begin(exposure_ms));
  if (const absl::Status status = wait_for_settings(); !status.ok()) {
    run_.reset();
    return status;
  }
  return absl::OkStatus();
}

absl::Status LibcameraCamera::wait_for_settings() {
  std::optional<LibcameraRun::Frame> frame;
  for (int seen = 1; seen <= kSettleWithin; ++seen) {
    frame = run_->next(kNoFrames);
    if (!frame) return why_no_frames();
    if (!frame->exposure_ms && seen >= kSettledAfter) {
      if (!options_.fixed_exposure_ms) {
        spdlog::warn("camera does not report its exposure: assumed exposure_ms={} after frames={}",
                     exposure_ms_, seen);
      }
      return absl::OkStatus();
    }
    const bool exposed = frame->exposure_ms && same_setting(*frame->exposure_ms, exposure_ms_);
    if (exposed && same_setting(frame->gain.value_or(options_.gain), options_.gain)) return absl::OkStatus();
  }
  return absl::FailedPreconditionError(fmt::format(
      "camera \"{}\" was told to expose {} ms at gain {}; after {} frames it reports {} ms at {}", id_,
      exposure_ms_, options_.gain, kSettleWithin, *frame->exposure_ms, frame->gain.value_or(options_.gain)));
}

std::optional<CapturedFrame> LibcameraCamera::next(std::chrono::milliseconds timeout) {
  if (run_ == nullptr) return std::nullopt;
  const nanoseconds deadline = monotonic_now() + timeout;
  const std::optional<LibcameraRun::Frame> frame = run_->next(timeout);
  if (!frame) {
    sleep_until_monotonic(deadline);  // a run that has ended returns at once
    return std::nullopt;
  }
  const std::optional<Stamp> stamp = monotonic_stamp(frame->stamp, frame->complete);
  if (!stamp) {
    spdlog::warn(
        "frame dropped, its time stamp is implausible: sequence={} stamp_ns={} monotonic_ns={} "
        "boottime_ns={}",
        frame->sequence, frame->stamp.count(), frame->complete.after.count(), frame->complete.boot.count());
    return std::nullopt;
  }
  const double exposure_ms = frame->exposure_ms.value_or(exposure_ms_);
  const SensorTiming timing{.stamp = options_.stamp,
                            .readout = options_.readout.value_or(frame->readout.value_or(period_)),
                            .delay = options_.delay.value_or(period_)};
  const ExposureTime exposed =
      exposure_time(*stamp, nanoseconds(std::llround(exposure_ms * 1e6)), timing, frame->complete.before);
  last_sequence_ = first_sequence_ + frame->sequence;
  CapturedFrame captured;
  captured.taken.set_sequence(last_sequence_);
  captured.taken.set_exposure_start_ns(exposed.start.count());
  captured.taken.set_exposure_end_ns(exposed.end.count());
  captured.taken.set_uncertainty_ns(exposed.uncertainty.count());
  captured.taken.set_exposure_ms(exposure_ms);
  captured.taken.set_gain(frame->gain.value_or(options_.gain));
  captured.taken.set_width_px(size_.width_px);
  captured.taken.set_height_px(size_.height_px);
  captured.image = [picture = frame->picture] { return image_of(*picture); };
  for (const auto& plane : frame->picture->planes) captured.held_bytes += plane.size();
  return captured;
}

void LibcameraCamera::stop() {
  run_.reset();
}

}  // namespace glasswing
