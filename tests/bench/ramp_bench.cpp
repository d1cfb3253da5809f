// Video mattes from the ramp: extraction, smoothing and finishing of a stream of frames on two threads,
// compared with OpenCV's reading and writing of the same frames.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <unistd.h>

#include <deque>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "solver/ramp/ramp_extractor.h"
#include "solver/ramp/smoother/ramp_smoother.h"
#include "tests/bench/rows.h"
#include "tests/solver/ramp/ramp_scene.h"

namespace glasswing {
namespace {

constexpr int kThreads = 2, kFrames = 4;

// A moving lens over a third of the picture, with a highlight and an ordinary camera's noise.
struct Video {
  RampScene scene;
  std::vector<std::vector<std::uint16_t>> frames;
  RampExtractor extractor;

  static RampScene scene_of(int width_px, int height_px) {
    RampScene scene;
    scene.width_px = width_px;
    scene.height_px = height_px;
    scene.read_sd = 0.004;
    return scene;
  }
  Video(int width_px, int height_px)
      : scene(scene_of(width_px, height_px)), extractor(scene.extractor({}, 4).value()) {
    const double radius = std::sqrt(width_px * height_px / 3.0 / 3.14159);
    for (int i = 0; i < kFrames; ++i) {
      frames.push_back(scene.frame(
          [&](int x, int y) {
            const double dx = x - (0.48 + 0.01 * i) * width_px, dy = y - 0.5 * height_px;
            const double away = std::hypot(dx, dy) / radius;
            if (away > 1.0) return RampTruth{};
            const double shine = std::hypot(dx + 0.4 * radius, dy + 0.4 * radius) / (0.05 * radius);
            return RampTruth{.object = true,
                             .x_px = 0.5 * width_px - (0.3 + 0.3 * away) * dx,
                             .y_px = 0.5 * height_px - (0.3 + 0.3 * away) * dy,
                             .rho = 0.95 - 0.6 * std::pow(away, 8),
                             .f = 0.8 * std::exp(-shine * shine)};
          },
          static_cast<unsigned>(i)));
    }
  }
  FrameView view(size_t i) const { return scene.view(frames[i % frames.size()]); }
};

// One of each size, created on first use.
const Video& video(int height_px) {
  static const Video small(1280, 720);
  if (height_px == 720) return small;
  static const Video large(1920, 1080);
  return large;
}

void extract(benchmark::State& state, int height_px) {
  const Video& of = video(height_px);
  size_t i = 0;
  RampFrame frame;
  for (auto _ : state) {
    const FrameView view = of.view(i++);
    frame = of.extractor.extract(view, kThreads, std::move(frame)).value();
    of.extractor.finish(view, frame, kThreads);
    benchmark::DoNotOptimize(frame);
  }
  state.SetItemsProcessed(state.iterations());
}

// As in a video: each frame is smoothed with those before and after it.
void whole(benchmark::State& state, int height_px) {
  struct Extracted {
    RampFrame frame;
    SmoothInput input;
  };
  const Video& of = video(height_px);
  const RampSmoother smoother(SmoothingOptions{});
  std::deque<Extracted> near;
  const size_t length = smoother.frames_before() + 1 + smoother.frames_after();
  size_t i = 0;
  RampFrame spent;
  const auto add = [&] {
    Extracted& extracted = near.emplace_back();
    extracted.frame = of.extractor.extract(of.view(i++), kThreads, std::move(spent)).value();
    extracted.input.frame = &extracted.frame;
    smoother.prepare(extracted.input, kThreads);
  };
  while (near.size() + 1 < length) add();
  for (auto _ : state) {
    add();
    std::vector<SmoothInput> window;
    for (const Extracted& each : near) window.push_back(each.input);
    const size_t at = smoother.frames_before();
    RampFrame frame = smoother.smooth(window, at, kThreads);
    of.extractor.finish(of.view(i - length + at), frame, kThreads);
    benchmark::DoNotOptimize(frame);
    spent = std::move(near.front().frame);
    near.pop_front();
  }
  state.SetItemsProcessed(state.iterations());
}

void read_and_write(benchmark::State& state, int height_px) {
  const Video& of = video(height_px);
  const auto path = [&](const char* name) {
    return (std::filesystem::temp_directory_path() /
            fmt::format("glasswing-bench-{}-{}-{}.png", ::getpid(), height_px, name))
        .string();
  };
  const cv::Mat frame(of.scene.height_px, of.scene.width_px, CV_16UC3,
                      const_cast<std::uint16_t*>(of.frames.front().data()));
  cv::imwrite(path("in"), frame);
  for (auto _ : state) cv::imwrite(path("out"), cv::imread(path("in"), cv::IMREAD_UNCHANGED));
  state.SetItemsProcessed(state.iterations());
  std::filesystem::remove(path("in"));
  std::filesystem::remove(path("out"));
}

}  // namespace

void add_ramp_rows(std::vector<Row>& rows) {
  for (const int height_px : {720, 1080}) {
    const std::string size = height_px == 720 ? "1280x720" : "1920x1080";
    const std::string own = "ramp/" + size, alone = own + "/extract", files = own + "/files";
    const auto add = [&](const std::string& name, void (*run)(benchmark::State&, int)) {
      benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) { run(state, height_px); })
          ->UseRealTime()
          ->MeasureProcessCPUTime()
          ->Unit(benchmark::kMillisecond);
    };
    add(own, whole);
    add(alone, extract);
    add(files, read_and_write);
    // Google Benchmark's name for a benchmark timed like this.
    const auto timed = [](const std::string& name) { return name + "/process_time/real_time"; };
    const auto rate = [](const std::string& of) { return [of](const Rates& rates) { return rates.at(of); }; };
    rows.push_back({"ramp mattes, " + size + ", two threads", "frames/s", {timed(own)}, rate(own)});
    rows.push_back({"ramp mattes without smoothing, " + size, "frames/s", {timed(alone)}, rate(alone)});
    rows.push_back({"ramp mattes over OpenCV reading and writing 16-bit PNG, " + size,
                    "x the time",
                    {timed(own), timed(files)},
                    [own, files](const Rates& rates) { return rates.at(files) / rates.at(own); }});
  }
}

}  // namespace glasswing
