#include "camera-node/backends/aravis/aravis_backend.h"

#include <fmt/format.h>

#include <cmath>

#include "camera-node/backends/aravis/aravis_camera.h"
#include "core/base/scanner.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

struct Options {
  AravisCamera::Options aravis;
  std::string offset;
  double trigger_delay_ms = 2.0;
  double ptp_error_ms = 0.1;
  std::optional<double> line_delay_ms, arrival_delay_ms;
};

std::optional<nanoseconds> of_ms(const std::optional<double>& ms) {
  return ms ? std::optional(nanoseconds(std::llround(*ms * 1e6))) : std::nullopt;
}

void add_options(CLI::App& app, Options& options) {
  app.add_option("--device", options.aravis.device,
                 "aravis: the camera's id, model, serial number or address, or part of it");
  app.add_option("--offset", options.offset,
                 "aravis: X,Y of the picture's corner on the sensor; default: centred");
  app.add_option(
         "--packet-size", options.aravis.packet_bytes,
         "aravis: bytes of a network packet; 1400 passes through every network, 8000 needs jumbo frames")
      ->check(CLI::Range(576, 16000))
      ->capture_default_str();
  app.add_option("--trigger", options.aravis.trigger,
                 "aravis: what starts the exposures of a capture: software, or a line of the camera, such as "
                 "Line1; default: free-running");
  app.add_option("--trigger-delay-ms", options.trigger_delay_ms,
                 "aravis: longest time from a software trigger to the exposure that it starts")
      ->check(CLI::Range(0.01, 1000.0))
      ->capture_default_str();
  app.add_option("--line-delay-ms", options.line_delay_ms,
                 "aravis: delay from the line's edge to the exposure; default: as set on the camera")
      ->check(CLI::Range(0.0, 10000.0));
  app.add_option("--arrival-delay-ms", options.arrival_delay_ms,
                 "aravis: for a camera without software triggers: longest time from an exposure's end to its "
                 "data's arrival; default: one frame")
      ->check(CLI::Range(0.0, 10000.0));
  app.add_option("--ptp", options.aravis.ptp,
                 "aravis: start, or end: the camera follows this machine's clock by PTP, and its time stamps "
                 "mean the start, or the end, of an exposure; default: times come from triggers")
      ->check(CLI::IsMember({"start", "end"}));
  app.add_option("--ptp-error-ms", options.ptp_error_ms,
                 "aravis: largest difference between the two clocks with --ptp")
      ->check(CLI::Range(0.001, 10.0))
      ->capture_default_str();
}

absl::StatusOr<AravisCamera::Offset> parse_offset(const std::string& text) {
  AravisCamera::Offset at;
  if (Scanner(text).number(at.x_px).then(",").number(at.y_px).done() && at.x_px >= 0 && at.y_px >= 0)
    return at;
  return absl::InvalidArgumentError("--offset is " + text + "; it must be X,Y, each 0 or more");
}

absl::StatusOr<OpenedCamera> open(const Options& options, const CameraSettings& settings) {
  AravisCamera::Options camera = options.aravis;
  camera.name = settings.name;
  camera.format = settings.format;
  camera.size = settings.size;
  camera.frame_rate_hz = settings.frame_rate_hz;
  camera.gain = settings.gain;
  camera.black_level = settings.black_level;
  camera.readout = of_ms(settings.readout_ms).value_or(nanoseconds(0));
  camera.trigger_delay = *of_ms(options.trigger_delay_ms);
  camera.line_delay = of_ms(options.line_delay_ms);
  camera.delay = of_ms(options.arrival_delay_ms);
  camera.ptp_error = *of_ms(options.ptp_error_ms);
  if (!options.offset.empty()) {
    GW_ASSIGN_OR_RETURN(camera.offset, parse_offset(options.offset));
  }
  GW_ASSIGN_OR_RETURN(std::shared_ptr<Camera> opened, AravisCamera::open(camera));
  return OpenedCamera{.camera = std::move(opened)};
}

}  // namespace

CameraBackend aravis_backend() {
  const auto own = std::make_shared<Options>();
  return {.name = "aravis",
          .shared = {"--size", "--fps", "--format", "--gain", "--black-level", "--readout-ms"},
          .add_options = [own](CLI::App& app) { add_options(app, *own); },
          .open = [own](const CameraSettings& settings) { return open(*own, settings); }};
}

}  // namespace glasswing
