// The simulated camera's frame rate, 640 x 480 of a monitor of that size, on one core: with a static picture,
// and while one picture replaces another.
#include <benchmark/benchmark.h>

#include <random>

#include "core/sim/sensor.h"
#include "tests/bench/rows.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

constexpr MonitorSize kSize{640, 480};
constexpr ExposureWindow kStanding{.start = milliseconds(22), .exposure = milliseconds(4)};
constexpr ExposureWindow kChanging{.start = milliseconds(40), .exposure = milliseconds(4)};

struct Stage {
  explicit Stage(const std::string& scene)
      : transport(*build_transport(scene, true, {{"back", kSize}}, kSize.width_px, kSize.height_px)),
        light{{.monitor = {.name = "back",
                           .width_px = kSize.width_px,
                           .height_px = kSize.height_px,
                           .scanout = milliseconds(16),
                           .lag = milliseconds(3),
                           .settle = milliseconds(1)},
               .pictures = {}}} {
    std::mt19937 random(1);
    for (const int start_ms : {0, 33}) {
      auto picture = std::make_shared<Image16>(kSize.width_px, kSize.height_px);
      for (std::uint16_t& code : picture->samples) code = static_cast<std::uint16_t>(random());
      light[0].pictures.push_back({.scanout_start = milliseconds(start_ms), .image = picture});
    }
  }
  Transport transport;
  std::vector<MonitorEmission> light;
};

void take(benchmark::State& state, const Stage& stage, const ExposureWindow& window) {
  const SensorModel model;
  std::int64_t frame = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        expose(integrate(stage.transport, stage.light, window, model.readout), 4.0, model, ++frame));
  }
  state.SetItemsProcessed(frame);
}

const Stage& crystal() {
  static const Stage stage("crystal");
  return stage;
}

void camera_empty_stage(benchmark::State& state) {
  take(state, Stage("none"), kStanding);
}
void camera_crystal(benchmark::State& state) {
  take(state, crystal(), kStanding);
}
void camera_crystal_changing(benchmark::State& state) {
  take(state, crystal(), kChanging);
}

}  // namespace

void add_camera_rows(std::vector<Row>& rows) {
  benchmark::RegisterBenchmark("camera_empty_stage", camera_empty_stage);
  benchmark::RegisterBenchmark("camera_crystal", camera_crystal);
  benchmark::RegisterBenchmark("camera_crystal_changing", camera_crystal_changing);
  const auto rate = [](const std::string& name) {
    return [name](const Rates& rates) { return rates.at(name); };
  };
  rows.push_back({"simulated camera, 640x480, empty stage, one core",
                  "frames/s",
                  {"camera_empty_stage"},
                  rate("camera_empty_stage")});
  rows.push_back({"simulated camera, 640x480, crystal, one core",
                  "frames/s",
                  {"camera_crystal"},
                  rate("camera_crystal")});
  rows.push_back({"simulated camera, 640x480, crystal, pictures changing",
                  "frames/s",
                  {"camera_crystal_changing"},
                  rate("camera_crystal_changing")});
}

}  // namespace glasswing
