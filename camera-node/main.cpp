#include <fmt/format.h>
#include <malloc.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <iostream>

#include "camera-node/backends/emission_client.h"
#include "camera-node/backends/libcamera_camera.h"
#include "camera-node/backends/replay_camera.h"
#include "camera-node/backends/sim_camera.h"
#include "camera-node/camera_metrics.h"
#include "camera-node/services/calibration_service.h"
#include "camera-node/services/camera_service.h"
#include "camera-node/services/stage_service.h"
#include "core/archive/archive_metrics.h"
#include "core/archive/archive_service.h"
#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/version.h"
#include "core/cli/daemon_options.h"
#include "core/cli/man_page.h"
#include "core/service/build_id.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "core/service/supervision.h"
#include "core/telemetry/logs.h"
#include "core/telemetry/metrics.h"
#include "core/telemetry/process_metrics.h"

namespace {

using namespace glasswing;

nanoseconds of_ms(double ms) {
  return nanoseconds(std::llround(ms * 1e6));
}

// The backends other than the simulated one.
struct RealCameras {
  LibcameraCamera::Options real;
  std::string archive, stamp = "unknown";
  double readout_ms = 0.0, delay_ms = 0.0, fixed_exposure_ms = 0.0;

  void add_options(CLI::App& app) {
    app.add_option("--archive", archive, "replay: directory of the session archive to show again");
    app.add_option("--camera", real.camera, "libcamera: the camera's id or model, or a part of it");
    app.add_option("--format", real.format,
                   "libcamera: pixel format, such as SRGGB10 or YUYV; the best there is if left out");
    app.add_option("--gain", real.gain, "libcamera: analogue gain")
        ->check(CLI::Range(0.1, 1000.0))
        ->capture_default_str();
    app.add_option("--fixed-exposure-ms", fixed_exposure_ms, "libcamera: of a camera without a control of it")
        ->check(CLI::Range(0.01, 10000.0));
    app.add_option(
           "--stamp", stamp,
           "libcamera: what the driver's time stamps mean: start of the first row's exposure or of its "
           "readout, or arrival of its data here")
        ->check(CLI::IsMember({"unknown", "start", "readout", "arrival"}))
        ->capture_default_str();
    app.add_option("--stamp-delay-ms", delay_ms,
                   "libcamera: at most, from a frame's readout to its data's arrival; one frame if left out")
        ->check(CLI::Range(0.0, 1000.0));
    app.add_option(
           "--readout-ms", readout_ms,
           "libcamera: from the first row's start to the last row's, 0 with a global shutter; what the "
           "camera says, or one frame, if left out")
        ->check(CLI::Range(0.0, 1000.0));
  }

  absl::StatusOr<std::unique_ptr<Camera>> open(const CLI::App& app, const std::string& backend,
                                               const SimCameraOptions& common) {
    const auto given = [&app](const char* option) { return app.count(option) > 0; };
    real.name = common.name;
    if (given("--fps")) real.frame_rate_hz = common.frame_rate_hz;
    if (backend == "replay") {
      if (archive.empty()) return absl::InvalidArgumentError("--backend replay needs --archive DIR");
      return ReplayCamera::open({.name = real.name, .archive = archive, .frame_rate_hz = real.frame_rate_hz});
    }
    if (given("--size")) real.size = PictureSize{common.width_px, common.height_px};
    if (given("--fixed-exposure-ms")) real.fixed_exposure_ms = fixed_exposure_ms;
    if (given("--stamp-delay-ms")) real.delay = of_ms(delay_ms);
    if (given("--readout-ms")) real.readout = of_ms(readout_ms);
    real.stamp = stamp == "start"     ? StampMeaning::kStart
                 : stamp == "readout" ? StampMeaning::kReadout
                 : stamp == "arrival" ? StampMeaning::kArrival
                                      : StampMeaning::kUnknown;
    return LibcameraCamera::open(real);
  }
};

// Developed pictures have more contrast than their gamma gives them.
constexpr SensorCurve kSCurve{.exponent = 1.0f / 2.2f, .contrast = 0.5f};

absl::StatusOr<SensorCurve> parse_response(const std::string& text) {
  if (text == "linear") return SensorCurve();
  if (text == "s-curve") return kSCurve;
  double gamma = 0.0;
  int read = 0;
  if (std::sscanf(text.c_str(), "gamma:%lf%n", &gamma, &read) != 1 ||
      static_cast<size_t>(read) != text.size() || !(gamma >= 0.2 && gamma <= 5.0)) {
    return absl::InvalidArgumentError("--response is " + text +
                                      "; it must be linear, s-curve, or gamma:G with G 0.2 to 5");
  }
  return SensorCurve{.exponent = static_cast<float>(1.0 / gamma)};
}

int fail(const absl::Status& status) {
  std::cerr << "glasswing-camera: " << status.message() << "\n";
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Glasswing's camera node: exposures, when each really happened, and the frames themselves.");
  set_up_help(app, "glasswing-camera");
  app.footer(
      "Example:\n  glasswing-camera --server 127.0.0.1:7440 --data /var/lib/glasswing-camera \\\n"
      "                   --backend sim --scene crystal --tap 127.0.0.1:7441\n"
      "  glasswing-camera --data DIR --backend libcamera --format YUYV --size 640x480\n"
      "  glasswing-camera --data DIR --backend replay --archive archives/vase");
  ListenOptions listen{.address = "127.0.0.1:7442", .reflection = false};
  SimCameraOptions sim;
  std::string server, data, backend = "sim", stage = "sim", size = "128x96", response = "linear";
  LogOptions logs;
  std::vector<std::string> taps;
  double late_ms = 0.0, stamp_jitter_ms = 0.0, stamp_shift_ms = 0.0;
  double clock_offset_ms = 0.0, clock_drift_ppm = 0.0;
  add_listen_options(app, listen);
  app.add_option("--server", server, "host:port of glasswing-server, to register with");
  app.add_option("--name", sim.name, "this node's name in the rig")->capture_default_str();
  app.add_option("--data", data, "directory for the archives")->required();
  std::optional<double> reserve_mb;
  app.add_option(
         "--reserve", reserve_mb,
         "MB of the disk that frames leave free: a capture that would need them waits for room. 2 % of "
         "the disk, but at least 1000, or a tenth of a small disk, if left out")
      ->check(CLI::Range(0.0, 1e9));
  app.add_option("--backend", backend, "which kind of camera")
      ->check(CLI::IsMember({"sim", "libcamera", "replay"}))
      ->capture_default_str();
  app.add_option("--size", size, "WIDTHxHEIGHT of its pictures; libcamera: the camera's own if left out")
      ->capture_default_str();
  app.add_option("--fps", sim.frame_rate_hz, "frames a second; libcamera, replay: its own if left out")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  app.add_option(
         "--scene", sim.scene,
         "sim: crystal, glass, brushed, wobble (a drop of water that moves), wobble-lit (with a lamp's "
         "highlight) or none")
      ->capture_default_str();
  app.add_option("--tap", taps, "sim: host:port of a display node whose light it sees; repeat for more");
  app.add_option("--seed", sim.sensor.seed, "sim: seed of noise and faults")->capture_default_str();
  app.add_option("--noise-sd", sim.sensor.read_sd, "sim: read noise, of full scale")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  app.add_option("--blur", sim.blur_sigma_px, "sim: sigma of the lens's blur, px of the camera")
      ->check(CLI::Range(0.0, 20.0))
      ->capture_default_str();
  app.add_option(
         "--vignetting", sim.sensor.vignetting,
         "sim: of the light in the picture's middle, what its corners lack; with the distance squared")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app.add_option("--black-level", sim.sensor.black_level,
                 "sim: what is read without light, of full scale, before the response")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  app.add_option("--response", response,
                 "sim: how samples are coded after the noise: linear; gamma:G, as gamma:2.2: to the power "
                 "1/G; s-curve: gamma:2.2 and then half way to 3u^2 - 2u^3")
      ->capture_default_str();
  app.add_option("--bits", sim.sensor.bits, "sim: bits a sample")
      ->check(CLI::Range(8, 16))
      ->capture_default_str();
  app.add_flag("--true-auto-gain", sim.automatics.gain,
               "sim: its gain follows the last frames' light, and is reported as constant");
  app.add_flag("--true-auto-white-balance", sim.automatics.white_balance,
               "sim: its channels' gains follow the last frames' colour");
  app.add_option("--fault-drop", sim.drop, "sim: probability that a frame is lost")
      ->check(CLI::Range(0.0, 0.99));
  app.add_option("--fault-duplicate", sim.duplicate,
                 "sim: probability that a frame repeats the last one's pixels")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--fault-late-ms", late_ms, "sim: frames are delivered up to this late, in order")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--fault-stamp-jitter-ms", stamp_jitter_ms,
                 "sim: frames' times are off by up to this, and are said to be")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--fault-stamp-shift-ms", stamp_shift_ms,
                 "sim: frames' times are off by this, and are not said to be: a camera that lies")
      ->check(CLI::Range(-1000.0, 1000.0));
  app.add_option("--clock-offset-ms", clock_offset_ms, "sim: how far this node's clock is ahead")
      ->check(CLI::Range(-1e9, 1e9));
  app.add_option("--clock-drift-ppm", clock_drift_ppm, "sim: how much too fast this node's clock runs")
      ->check(CLI::Range(-1000.0, 1000.0));
  RealCameras others;
  others.add_options(app);
  app.add_option("--stage", stage, "who moves the object; manual without --backend sim")
      ->check(CLI::IsMember({"sim", "manual"}))
      ->capture_default_str();
  TlsFiles tls;
  add_tls_options(app, tls);
  add_log_options(app, logs);
  MetricsOptions metrics{.address = "", .program = "glasswing-camera", .build = build_id()};
  add_metrics_option(app, metrics);
  app.set_version_flag("--version", kVersion);
  CLI11_PARSE(app, argc, argv);

  // Pictures come and go by the megabyte: their pages stay, instead of being faulted in again each time.
  ::mallopt(M_MMAP_THRESHOLD, 1 << 30);
  ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
  ::mallopt(M_ARENA_MAX, 1);
  block_signals();
  start_logging("glasswing-camera", logs);
  if (absl::Status status = use_tls(tls); !status.ok()) return fail(status);
  if (absl::Status status = check_name("node", sim.name); !status.ok()) return fail(status);
  int read = 0;
  if (std::sscanf(size.c_str(), "%dx%d%n", &sim.width_px, &sim.height_px, &read) != 2 ||
      static_cast<size_t>(read) != size.size() || sim.width_px < 1 || sim.height_px < 1 ||
      sim.width_px > 16384 || sim.height_px > 16384) {
    return fail(
        absl::InvalidArgumentError("--size is " + size + "; it must be WIDTHxHEIGHT, each 1 to 16384"));
  }
  const std::filesystem::path archives = std::filesystem::path(data) / "archives";
  std::optional<std::int64_t> reserve_bytes;
  if (reserve_mb) reserve_bytes = std::llround(1e6 * *reserve_mb);
  ArchiveStore store(archives, DiskRoom(archives, reserve_bytes));
  if (absl::Status status = store.prepare(); !status.ok()) return fail(status);

  const absl::StatusOr<SensorCurve> curve = parse_response(response);
  if (!curve.ok()) return fail(curve.status());
  sim.sensor.curve = *curve;
  sim.late = of_ms(late_ms);
  sim.stamp_jitter = of_ms(stamp_jitter_ms);
  sim.stamp_shift = of_ms(stamp_shift_ms);
  sim.clock = NodeClock(of_ms(clock_offset_ms), clock_drift_ppm);
  EmissionTimeline timeline;
  ManualStage manual;
  Stage* object_stage = &manual;
  std::unique_ptr<Camera> camera;
  if (backend == "sim") {
    listen.clock = sim.clock;
    absl::StatusOr<std::unique_ptr<SimCamera>> simulated = SimCamera::create(sim, timeline);
    if (!simulated.ok()) return fail(simulated.status());
    if (stage == "sim") object_stage = simulated->get();
    camera = *std::move(simulated);
  } else {
    absl::StatusOr<std::unique_ptr<Camera>> opened = others.open(app, backend, sim);
    if (!opened.ok()) return fail(opened.status());
    camera = *std::move(opened);
  }
  std::vector<std::unique_ptr<EmissionClient>> clients;
  for (const std::string& tap : taps) clients.push_back(std::make_unique<EmissionClient>(tap, timeline));

  CameraServiceImpl cameras(*camera, store);
  ArchiveServiceImpl archive_service(store);
  CalibrationServiceImpl calibrations(store);
  StageServiceImpl stages(*object_stage);
  absl::StatusOr<std::unique_ptr<ServiceHost>> host =
      ServiceHost::start(listen, {&cameras, &archive_service, &calibrations, &stages});
  if (!host.ok()) return fail(host.status());
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_CAMERA);
  node.set_name(sim.name);
  node.set_build(build_id());
  node.set_address((*host)->advertised());
  const v1::GetCameraResponse described = camera->describe();
  node.set_detail(fmt::format("{} {}x{} at {:.4g} fps{}", backend, described.camera().width_px(),
                              described.camera().height_px(), described.frame_rate_hz(),
                              backend == "sim" ? ", scene " + sim.scene : ""));
  camera_metrics();
  archive_metrics();
  const AskedMetrics disk([&] { return disk_metrics(archives); });
  const absl::StatusOr<std::unique_ptr<MetricsHost>> metrics_host = MetricsHost::start(metrics);
  if (!metrics_host.ok()) return fail(metrics_host.status());
  const Registration registration(server, node, archives);
  spdlog::info("listening on address={}", (*host)->address());
  serve_until_signal([&] { return (*host)->answers(kSelfCall); });
  cameras.stop();
  archive_service.stop();
  (*host)->stop(std::chrono::seconds(2));
  return 0;
}
