#include "camera-node/backends/sim_backend.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <vector>

#include "camera-node/backends/emission_client.h"
#include "camera-node/backends/sim_camera.h"
#include "core/base/scanner.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

// The simulated camera's own options; the resolved ones are in `sim`.
struct SimOptions {
  SimCameraOptions sim;
  std::string response = "linear";
  std::vector<std::string> taps;
  double late_ms = 0.0, stamp_jitter_ms = 0.0, stamp_shift_ms = 0.0;
  double clock_offset_ms = 0.0, clock_drift_ppm = 0.0;
};

// A camera with the light that it sees.
struct Simulation {
  EmissionTimeline timeline;
  std::unique_ptr<SimCamera> camera;
  std::vector<std::unique_ptr<EmissionClient>> clients;
};

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

void add_scene_options(CLI::App& app, SimOptions& camera) {
  app.add_option(
         "--scene", camera.sim.scene,
         "sim: crystal, glass, brushed, still-life (frosted glass, a bubble, a brushed coin), wobble (a "
         "moving drop of water), wobble-lit (with a lamp's highlight), board (a column with ChArUco "
         "boards) or none")
      ->capture_default_str();
  app.add_option("--tap", camera.taps,
                 "sim: host:port of a display node whose light it sees; repeat for more");
}

void add_sensor_options(CLI::App& app, SimOptions& camera) {
  app.add_option("--seed", camera.sim.sensor.seed, "sim: seed of noise and faults")->capture_default_str();
  app.add_option("--noise-sd", camera.sim.sensor.read_sd,
                 "sim: standard deviation of the read noise, as a fraction of full scale")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  app.add_option("--blur", camera.sim.blur_sigma_px, "sim: sigma of the lens's blur, camera px")
      ->check(CLI::Range(0.0, 20.0))
      ->capture_default_str();
  app.add_flag("--ray-areas", camera.sim.ray_areas,
               "sim: each ray sees what its part of a pixel covers of a monitor, not a point");
  app.add_option(
         "--focal-length", camera.sim.focal_px,
         "sim: focal length of its lens, px of its picture; default: 4 times the picture's width. "
         "Monitor \"back\" fills the picture at its normal place with any; a camera with a shorter one is "
         "closer and sees more perspective")
      ->check(CLI::Range(1.0, 1e6));
  app.add_option("--vignetting", camera.sim.sensor.vignetting,
                 "sim: fraction of the centre's light missing in the picture's corners; grows with the "
                 "distance squared")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app.add_option("--response", camera.response,
                 "sim: how samples are encoded after the noise: linear; gamma:G, such as gamma:2.2: to the "
                 "power 1/G; s-curve: gamma:2.2 and then half way to 3u^2 - 2u^3")
      ->capture_default_str();
  app.add_option("--bits", camera.sim.sensor.bits, "sim: bits a sample")
      ->check(CLI::Range(8, 16))
      ->capture_default_str();
  app.add_option("--mosaic", camera.sim.mosaic,
                 "sim: the sensor's colours, one per photosite; frames then have one channel")
      ->check(CLI::IsMember({"RGGB", "GRBG", "GBRG", "BGGR"}));
}

void add_fault_options(CLI::App& app, SimOptions& camera) {
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
                 "sim: frames' times are off by up to this, and reported as such")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--fault-stamp-shift-ms", camera.stamp_shift_ms,
                 "sim: frames' times are off by this, and not reported as such: a lying camera")
      ->check(CLI::Range(-1000.0, 1000.0));
  app.add_option("--clock-offset-ms", camera.clock_offset_ms, "sim: how far this node's clock is ahead")
      ->check(CLI::Range(-1e9, 1e9));
  app.add_option("--clock-drift-ppm", camera.clock_drift_ppm, "sim: how much too fast this node's clock runs")
      ->check(CLI::Range(-1000.0, 1000.0));
}

// Disturbances of the camera and its room; seconds count from its first start.
void add_disturbance_options(CLI::App& app, SimOptions& camera) {
  Disturbances& d = camera.sim.disturbances;
  const CLI::Range seconds(0.0, 1e6);
  app.add_option("--true-wobble", camera.sim.wobble_deg,
                 "sim: the axis of the object's table tips by so many degrees as it turns")
      ->check(CLI::Range(0.0, 20.0));
  app.add_option("--true-backlash", camera.sim.backlash_deg,
                 "sim: the play of the table's gear, degrees: coming from above it stands so much too far")
      ->check(CLI::Range(0.0, 20.0));
  app.add_option("--true-knock", d.knock_dx_px, "sim: a knock moves its picture to the right by this, px")
      ->check(CLI::Range(-50.0, 50.0));
  app.add_option("--true-knock-down", d.knock_dy_px, "sim: and down by this, px")
      ->check(CLI::Range(-50.0, 50.0));
  app.add_option("--true-knock-at", d.knock_s, "sim: this many seconds after its first start")
      ->check(seconds);
  app.add_option("--true-knock-lasts", d.knock_lasts_s, "sim: for this many seconds; 0: permanently")
      ->check(seconds);
  app.add_option("--true-creep", d.creep_px_per_minute, "sim: it sinks by this many px per minute")
      ->check(CLI::Range(-1000.0, 1000.0));
  app.add_option("--true-vibration", d.vibration_px, "sim: it vibrates by this many px, at 11 and 7 Hz")
      ->check(CLI::Range(0.0, 50.0));
  app.add_option("--true-lamp", d.lamp, "sim: a lamp adds this fraction of white everywhere")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--true-lamp-at", d.lamp_s, "sim: this many seconds after its first start")->check(seconds);
  app.add_option("--true-lamp-lasts", d.lamp_lasts_s, "sim: for this many seconds; 0: permanently")
      ->check(seconds);
  app.add_option("--true-gain", d.gain, "sim: its gain, undeclared")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--true-gain-at", d.gain_s, "sim: from this many seconds after its first start on")
      ->check(seconds);
  app.add_option("--true-warm-up", d.warm_up,
                 "sim: fraction of the light that is lost as the monitors warm up, with a time constant of 2 "
                 "min")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--true-flare", d.flare,
                 "sim: fraction of each picture's light that its lens spreads "
                 "evenly")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--true-bad-pixels", d.bad_pixels,
                 "sim: fraction of its samples that are dead or stuck, chosen by --seed")
      ->check(CLI::Range(0.0, 1.0));
}

absl::StatusOr<OpenedCamera> open_sim(SimOptions options, const CameraSettings& settings) {
  SimCameraOptions& sim = options.sim;
  sim.name = settings.name;
  if (settings.size) {
    sim.width_px = settings.size->width_px;
    sim.height_px = settings.size->height_px;
  }
  sim.frame_rate_hz = settings.frame_rate_hz.value_or(sim.frame_rate_hz);
  sim.sensor.black_level = settings.black_level.value_or(0.0);
  if (!(sim.sensor.black_level >= 0.0 && sim.sensor.black_level <= 0.5)) {
    return absl::InvalidArgumentError(
        fmt::format("--black-level is {}; with --backend sim it must be 0 to 0.5", *settings.black_level));
  }
  GW_ASSIGN_OR_RETURN(sim.sensor.curve, parse_response(options.response));
  sim.disturbances.seed = sim.sensor.seed;
  sim.late = of_ms(options.late_ms);
  sim.stamp_jitter = of_ms(options.stamp_jitter_ms);
  sim.stamp_shift = of_ms(options.stamp_shift_ms);
  sim.clock = NodeClock(of_ms(options.clock_offset_ms), options.clock_drift_ppm);
  sim.awaits_light = !options.taps.empty();
  const auto simulation = std::make_shared<Simulation>();
  GW_ASSIGN_OR_RETURN(simulation->camera, SimCamera::create(sim, simulation->timeline));
  for (const std::string& tap : options.taps)
    simulation->clients.push_back(std::make_unique<EmissionClient>(tap, simulation->timeline));
  SimCamera* const camera = simulation->camera.get();
  return OpenedCamera{.camera = std::shared_ptr<Camera>(simulation, camera),
                      .stage = camera,
                      .turn = [camera](double degrees) { camera->turn(degrees); },
                      .clock = sim.clock,
                      .detail = "scene " + sim.scene};
}

}  // namespace

CameraBackend sim_backend() {
  const auto own = std::make_shared<SimOptions>();
  return {.name = "sim",
          .shared = {"--size", "--fps", "--black-level"},
          .add_options =
              [own](CLI::App& app) {
                add_scene_options(app, *own);
                add_sensor_options(app, *own);
                add_fault_options(app, *own);
                add_disturbance_options(app, *own);
              },
          .open = [own](const CameraSettings& settings) { return open_sim(*own, settings); }};
}

}  // namespace glasswing
