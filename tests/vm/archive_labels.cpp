// Checks the labels of an archive's frames from their pixels alone: of the pictures that the camera should
// have seen in all steps, the one of the frame's own step must be the nearest.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>

#include "camera-node/backends/pixel_format.h"
#include "core/frame/archive.h"
#include "core/pattern/pattern.h"
#include "core/sim/sensor.h"
#include "tests/vm/camera_code.h"

namespace {

using namespace glasswing;

double squared_difference(const Image16& a, const Image16& b) {
  double sum = 0.0;
  for (size_t i = 0; i < a.samples.size(); ++i) {
    const double difference = (a.samples[i] - b.samples[i]) / 65535.0;
    sum += difference * difference;
  }
  return sum;
}

// As the GigE camera of tests/camera-node/backends/aravis sends it.
Image16 mono_of(const Image16& image, int bits) {
  const int full = (1 << bits) - 1;
  Image16 mono = image;
  for (size_t i = 0; i < mono.samples.size(); i += 3) {
    const int mean = (image.samples[i] + image.samples[i + 1] + image.samples[i + 2]) / 3;
    for (size_t c = 0; c < 3; ++c)
      mono.samples[i + c] = static_cast<std::uint16_t>(std::lround((mean >> (16 - bits)) * 65535.0 / full));
  }
  return mono;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Checks the labels of an archive's frames by their pixels.");
  std::string directory, scene = "crystal";
  app.add_option("archive", directory)->required();
  app.add_option("--scene", scene)->capture_default_str();
  bool mono = false;
  int bits = 8;
  app.add_flag("--mono", mono, "the camera has one channel; YUYV if left out");
  app.add_option("--bits", bits, "of that channel")->check(CLI::Range(8, 16))->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const std::unique_ptr<Archive> archive = Archive::open(directory).value();
  const v1::CaptureManifest manifest = archive->manifest();
  std::vector<SceneMonitor> monitors;
  for (const v1::Monitor& monitor : manifest.monitors())
    monitors.push_back({.name = monitor.name(), .size = {monitor.width_px(), monitor.height_px()}});
  SensorModel sensor;
  sensor.read_sd = sensor.gain = 0.0;
  sensor.bits = 16;
  sensor.full_scale_exposure_ms = kFullScaleExposure_ms;
  const auto traced = [&](bool object) {
    return build_transport(scene, object, monitors, manifest.camera().width_px(),
                           manifest.camera().height_px())
        .value();
  };
  const Transport with = traced(true), without = traced(false);
  std::vector<Image16> expected;
  for (const v1::Frame& frame : manifest.frames()) {
    std::vector<RadianceImage> pictures;
    for (const SceneMonitor& monitor : monitors) {
      const bool lit = monitor.name == frame.stimulus().panel();
      pictures.push_back(lit ? Pattern::create(frame.stimulus(), monitor.size).value().rasterised()
                             : RadianceImage());
    }
    const Image16 seen =
        expose((frame.object() ? with : without).respond(pictures), frame.exposure_ms(), sensor, 0);
    if (mono) {
      expected.push_back(mono_of(seen, bits));
      continue;
    }
    RawPicture sent{.format = find_pixel_format("YUYV"),
                    .width_px = manifest.camera().width_px(),
                    .height_px = manifest.camera().height_px(),
                    .stride_bytes = static_cast<size_t>(manifest.camera().width_px()) * 2,
                    .colour = {},
                    .black = 0.0,
                    .planes = {yuyv_of(seen)}};
    expected.push_back(image_of(sent).value());
  }
  int wrong = 0, alike = 0;
  double worst = 0.0;
  for (size_t i = 0; i < expected.size(); ++i) {
    const v1::Frame& frame = manifest.frames(static_cast<int>(i));
    const Image16 seen = decode_tiff(archive->read_frame_bytes(frame.file()).value()).value();
    const double own = squared_difference(seen, expected[i]);
    worst = std::max(worst, own / static_cast<double>(seen.samples.size()));
    for (size_t other = 0; other < expected.size(); ++other) {
      if (other == i) continue;
      alike += expected[other].samples == expected[i].samples ? 1 : 0;
      if (squared_difference(seen, expected[other]) >= own) continue;
      std::cout << frame.file() << " shows step " << manifest.frames(static_cast<int>(other)).step()
                << " rather than " << frame.step() << "\n";
      ++wrong;
      break;
    }
  }
  std::cout << expected.size() << " frames, mislabelled " << wrong << ", pairs of identical steps "
            << alike / 2 << ", largest rms difference from the expected picture " << std::sqrt(worst) << "\n";
  return wrong == 0 && !expected.empty() ? 0 : 1;
}
