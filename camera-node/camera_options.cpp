#include "camera-node/camera_options.h"

#include <cmath>

#include "core/base/scanner.h"
#include "core/base/status.h"
#include "core/daemon/daemon_options.h"

namespace glasswing {
namespace {

nanoseconds of_ms(double ms) {
  return nanoseconds(std::llround(ms * 1e6));
}

// Developed pictures have more contrast than a gamma curve alone gives.
constexpr SensorCurve kSCurve{.exponent = 1.0f / 2.2f, .contrast = 0.5f};

absl::StatusOr<SensorCurve> parse_response(const std::string& text) {
  if (text == "linear") return SensorCurve();
  if (text == "s-curve") return kSCurve;
  double gamma = 0.0;
  if (!Scanner(text).then("gamma:").number(gamma).done() || !(gamma >= 0.2 && gamma <= 5.0)) {
    return absl::InvalidArgumentError("--response is " + text +
                                      "; it must be linear, s-curve, or gamma:G with G 0.2 to 5");
  }
  return SensorCurve{.exponent = static_cast<float>(1.0 / gamma)};
}

absl::StatusOr<PictureSize> parse_size(const std::string& text) {
  PictureSize size{};
  if (!Scanner(text).number(size.width_px).then("x").number(size.height_px).done() || size.width_px < 1 ||
      size.height_px < 1 || size.width_px > 16384 || size.height_px > 16384)
    return absl::InvalidArgumentError("--size is " + text + "; it must be WIDTHxHEIGHT, each 1 to 16384");
  return size;
}

StampMeaning meaning_of(const std::string& stamp) {
  if (stamp == "start") return StampMeaning::kStart;
  if (stamp == "readout") return StampMeaning::kReadout;
  if (stamp == "arrival") return StampMeaning::kArrival;
  return StampMeaning::kUnknown;
}

void add_camera_choice(CLI::App& app, CameraOptions& camera) {
  app.add_option("--server", camera.server, "host:port of glasswing-server, to register with");
  app.add_option("--name", camera.sim.name, "this node's name in the rig")->capture_default_str();
  app.add_option("--data", camera.data, "directory for the archives")->required();
  app.add_option(
         "--reserve", camera.reserve_mb,
         "MB of the disk that frames leave free: a capture that would need them waits for room. 2 % of "
         "the disk, but at least 1000, or a tenth of a small disk, if left out")
      ->check(CLI::Range(0.0, 1e9));
  app.add_option("--backend", camera.backend, "which kind of camera")
      ->check(CLI::IsMember({"sim", "libcamera", "replay"}))
      ->capture_default_str();
  app.add_option("--size", camera.size,
                 "WIDTHxHEIGHT of its pictures; libcamera: the camera's own if left out")
      ->capture_default_str();
  app.add_option("--fps", camera.sim.frame_rate_hz, "frames a second; libcamera, replay: its own if left out")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  app.add_option(
         "--scene", camera.sim.scene,
         "sim: crystal, glass, brushed, wobble (a drop of water that moves), wobble-lit (with a lamp's "
         "highlight) or none")
      ->capture_default_str();
  app.add_option("--tap", camera.taps,
                 "sim: host:port of a display node whose light it sees; repeat for more");
}

void add_sensor_options(CLI::App& app, CameraOptions& camera) {
  app.add_option("--seed", camera.sim.sensor.seed, "sim: seed of noise and faults")->capture_default_str();
  app.add_option("--noise-sd", camera.sim.sensor.read_sd,
                 "sim: standard deviation of the read noise, as a part of full scale")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  app.add_option("--blur", camera.sim.blur_sigma_px, "sim: sigma of the lens's blur, px of the camera")
      ->check(CLI::Range(0.0, 20.0))
      ->capture_default_str();
  app.add_option(
         "--focal-length", camera.sim.focal_px,
         "sim: focal length of its lens, px of its picture; 4 times the picture's width if left out. "
         "Monitor \"back\" fills the picture at its own place with any; a shorter one stands nearer and "
         "sees more perspective")
      ->check(CLI::Range(1.0, 1e6));
  app.add_option("--vignetting", camera.sim.sensor.vignetting,
                 "sim: part of the light in the picture's middle that its corners lack; grows with the "
                 "distance squared")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app.add_option("--black-level", camera.sim.sensor.black_level,
                 "sim: sample without light, as a part of full scale, before the response")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  app.add_option("--response", camera.response,
                 "sim: how samples are coded after the noise: linear; gamma:G, as gamma:2.2: to the power "
                 "1/G; s-curve: gamma:2.2 and then half way to 3u^2 - 2u^3")
      ->capture_default_str();
  app.add_option("--bits", camera.sim.sensor.bits, "sim: bits a sample")
      ->check(CLI::Range(8, 16))
      ->capture_default_str();
  app.add_option("--mosaic", camera.sim.mosaic,
                 "sim: the sensor's colours, each photosite having one; frames are of one channel then")
      ->check(CLI::IsMember({"RGGB", "GRBG", "GBRG", "BGGR"}));
}

void add_fault_options(CLI::App& app, CameraOptions& camera) {
  app.add_flag("--true-auto-gain", camera.sim.automatics.gain,
               "sim: its gain follows the last frames' light, and is reported as constant");
  app.add_flag("--true-auto-white-balance", camera.sim.automatics.white_balance,
               "sim: its channels' gains follow the last frames' colour");
  app.add_option("--fault-drop", camera.sim.drop, "sim: probability that a frame is lost")
      ->check(CLI::Range(0.0, 0.99));
  app.add_option("--fault-duplicate", camera.sim.duplicate,
                 "sim: probability that a frame repeats the last one's pixels")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--fault-late-ms", camera.late_ms, "sim: frames are delivered up to this late, in order")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--fault-stamp-jitter-ms", camera.stamp_jitter_ms,
                 "sim: frames' times are off by up to this, and are said to be")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--fault-stamp-shift-ms", camera.stamp_shift_ms,
                 "sim: frames' times are off by this, and are not said to be: a camera that lies")
      ->check(CLI::Range(-1000.0, 1000.0));
  app.add_option("--clock-offset-ms", camera.clock_offset_ms, "sim: how far this node's clock is ahead")
      ->check(CLI::Range(-1e9, 1e9));
  app.add_option("--clock-drift-ppm", camera.clock_drift_ppm, "sim: how much too fast this node's clock runs")
      ->check(CLI::Range(-1000.0, 1000.0));
}

// What happens to the camera and its room; seconds count from its first start.
void add_disturbance_options(CLI::App& app, CameraOptions& camera) {
  Disturbances& d = camera.sim.disturbances;
  const CLI::Range seconds(0.0, 1e6);
  app.add_option("--true-knock", d.knock_dx_px, "sim: a knock moves its picture by this to the right, px")
      ->check(CLI::Range(-50.0, 50.0));
  app.add_option("--true-knock-down", d.knock_dy_px, "sim: and by this down, px")
      ->check(CLI::Range(-50.0, 50.0));
  app.add_option("--true-knock-at", d.knock_s, "sim: so many seconds after it was first started")
      ->check(seconds);
  app.add_option("--true-knock-lasts", d.knock_lasts_s, "sim: for so many seconds; 0: for good")
      ->check(seconds);
  app.add_option("--true-creep", d.creep_px_per_minute, "sim: it sinks by so many px a minute")
      ->check(CLI::Range(-1000.0, 1000.0));
  app.add_option("--true-vibration", d.vibration_px, "sim: it trembles by so many px, with 11 and 7 Hz")
      ->check(CLI::Range(0.0, 50.0));
  app.add_option("--true-lamp", d.lamp, "sim: a lamp adds this part of white everywhere")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--true-lamp-at", d.lamp_s, "sim: so many seconds after its first start")->check(seconds);
  app.add_option("--true-lamp-lasts", d.lamp_lasts_s, "sim: for so many seconds; 0: for good")
      ->check(seconds);
  app.add_option("--true-gain", d.gain, "sim: its gain, undeclared")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--true-gain-at", d.gain_s, "sim: from so many seconds after its first start on")
      ->check(seconds);
  app.add_option("--true-warm-up", d.warm_up,
                 "sim: part of the light that is lost as the monitors warm up, with a time constant of 2 min")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--true-flare", d.flare, "sim: part of each picture's light that its lens spreads evenly")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--true-bad-pixels", d.bad_pixels,
                 "sim: part of its samples that are dead or stuck, by --seed")
      ->check(CLI::Range(0.0, 1.0));
}

void add_real_camera_options(CLI::App& app, CameraOptions& camera) {
  app.add_option("--archive", camera.archive, "replay: directory of the session archive to show again");
  app.add_option("--camera", camera.real.camera, "libcamera: the camera's id or model, or a part of it");
  app.add_option("--format", camera.real.format,
                 "libcamera: pixel format, such as SRGGB10 or YUYV; the best there is if left out");
  app.add_option("--gain", camera.real.gain,
                 "libcamera: gain that frames must report: analogue, times digital in processed formats")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  app.add_option("--fixed-exposure-ms", camera.fixed_exposure_ms,
                 "libcamera: exposure of a camera that has no control for it")
      ->check(CLI::Range(0.01, 10000.0));
  app.add_option(
         "--stamp", camera.stamp,
         "libcamera: meaning of the driver's time stamps: start of the first row's exposure or of its "
         "readout, or arrival of its data here")
      ->check(CLI::IsMember({"unknown", "start", "readout", "arrival"}))
      ->capture_default_str();
  app.add_option(
         "--stamp-delay-ms", camera.delay_ms,
         "libcamera: maximum time from a frame's readout to its data's arrival; one frame if left out")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option(
         "--readout-ms", camera.readout_ms,
         "libcamera: time from the first row's start to the last row's, 0 with a global shutter; as the "
         "camera reports it, or one frame, if left out")
      ->check(CLI::Range(0.0, 1000.0));
}

}  // namespace

absl::Status CameraOptions::resolve(const CLI::App& app) {
  const auto given = [&app](const char* option) { return app.count(option) > 0; };
  GW_ASSIGN_OR_RETURN(const PictureSize picture, parse_size(size));
  sim.width_px = picture.width_px;
  sim.height_px = picture.height_px;
  GW_ASSIGN_OR_RETURN(sim.sensor.curve, parse_response(response));
  sim.disturbances.seed = sim.sensor.seed;
  sim.late = of_ms(late_ms);
  sim.stamp_jitter = of_ms(stamp_jitter_ms);
  sim.stamp_shift = of_ms(stamp_shift_ms);
  sim.clock = NodeClock(of_ms(clock_offset_ms), clock_drift_ppm);
  sim.awaits_light = !taps.empty();
  real.name = sim.name;
  if (given("--fps")) real.frame_rate_hz = sim.frame_rate_hz;
  if (given("--size")) real.size = picture;
  if (given("--fixed-exposure-ms")) real.fixed_exposure_ms = fixed_exposure_ms;
  if (given("--stamp-delay-ms")) real.delay = of_ms(delay_ms);
  if (given("--readout-ms")) real.readout = of_ms(readout_ms);
  real.stamp = meaning_of(stamp);
  return absl::OkStatus();
}

// In the order of --help.
void add_camera_options(CLI::App& app, DaemonOptions& daemon, CameraOptions& camera) {
  daemon.listen.address = "127.0.0.1:7442";
  add_listen_options(app, daemon.listen);
  add_camera_choice(app, camera);
  add_sensor_options(app, camera);
  add_fault_options(app, camera);
  add_disturbance_options(app, camera);
  add_real_camera_options(app, camera);
  app.add_option("--stage", camera.stage, "who moves the object; manual without --backend sim")
      ->check(CLI::IsMember({"sim", "manual"}))
      ->capture_default_str();
  add_tls_options(app, daemon.tls);
}

}  // namespace glasswing
