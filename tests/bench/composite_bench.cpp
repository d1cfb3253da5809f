// Composites of a matte over a background that changes with every frame, on two threads: compares the fast
// compositor with the exact one and with OpenCV's remap, which reads one position per pixel, on the same
// frame.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <thread>

#include "core/composite/compositor.h"
#include "core/composite/fast_compositor.h"
#include "core/matte/matte_file.h"
#include "tests/bench/rows.h"

namespace glasswing {
namespace {

constexpr int kThreads = 2, kWidth = 1280, kHeight = 720, kPictures = 4;

struct Kind {
  const char* name;
  double sigma_px, ratio;  // of the wider axis; ratio to the narrower one
  int modes;
  bool boxes;
  bool any = false;  // a tenth of the lens has footprints of any shape
};
constexpr std::array<Kind, 6> kKinds{{{"narrow", 0.4, 1.0, 1, false},
                                      {"wide", 8.0, 1.0, 1, false},
                                      {"oriented", 4.0, 2.0, 1, false},
                                      {"two modes, oriented", 2.0, 2.0, 2, false},
                                      {"boxes", 4.0, 1.0, 1, true},
                                      {"any shape", 4.0, 1.0, 1, false, true}}};

// A ring of radius 12 px: a circle of 40 Gaussians of sigma 1, and 40 of sigma 2 px.
PyramidFootprint ring(const Mode& mode) {
  constexpr int kAround = 40;
  PyramidFootprint pyramid{
      .texture = mode.texture, .noise_sd = 0.005f, .prior_sd = 0.01f, .coefficients = {}};
  for (int i = 0; i < 2 * kAround; ++i) {
    const int level = i % 2;
    const double angle = std::numbers::pi * i / kAround, step = std::ldexp(2.0, level);
    const auto place = [&](float centre, double away) {
      return std::max(0, static_cast<int>((static_cast<double>(centre) + 12.0 * away) / step));
    };
    pyramid.coefficients.push_back({.level = level,
                                    .column = place(mode.x_px, std::cos(angle)),
                                    .row = place(mode.y_px, std::sin(angle)),
                                    .weight = mode.weight / (2 * kAround)});
  }
  return pyramid;
}

// A lens over a third of the picture, `width` x `height` px as the monitor. Channels differ, as through
// glass; around it the monitor is seen directly. Has all rows, or this many of them, evenly spread.
Matte lens(const Kind& kind, int width, int height, int rows) {
  Matte matte(0, 0, width, rows, kind.modes);
  matte.metadata.set_format_version(1);
  matte.metadata.set_width_px(width);
  matte.metadata.set_height_px(rows);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_width_px(width);
  monitor.set_height_px(height);
  if (kind.boxes) matte.metadata.set_footprint(std::string(kBoxFootprint));
  if (kind.any) matte.metadata.set_footprint(std::string(kPyramidFootprint));
  const double radius = std::sqrt(static_cast<double>(width) * height / 3.0 / std::numbers::pi);
  for (int row = 0; row < rows; ++row) {
    const double y = (row + 0.5) * height / rows;
    for (int x = 0; x < width; ++x) {
      const double dx = x + 0.5 - 0.5 * width, dy = y - 0.5 * height, away = std::hypot(dx, dy) / radius;
      for (int c = 0; c < kChannels; ++c) {
        const std::span<Mode> modes = matte.modes(x, row, c);
        if (away > 1.0) {
          modes[0] = {.weight = 1.0f,
                      .x_px = static_cast<float>(x) + 0.5f,
                      .y_px = static_cast<float>(y),
                      .xx_px2 = 0.08f,
                      .yy_px2 = 0.08f};
          continue;
        }
        for (size_t m = 0; m < modes.size(); ++m) {
          // Sizes vary by a factor of two, angles over the full circle.
          const double wide = kind.sigma_px * std::exp2(away - 0.5), narrow = wide / kind.ratio;
          const double angle = std::atan2(dy, dx) + 0.3 * static_cast<double>(m);
          const double cosine = std::cos(angle), sine = std::sin(angle), u = wide * wide, v = narrow * narrow;
          const double shrink = (0.4 + 0.01 * c + 0.3 * away) * (m == 0 ? -1.0 : 0.8);
          modes[m] = {.weight = 0.9f / static_cast<float>(modes.size()),
                      .x_px = static_cast<float>(0.5 * width + shrink * dx),
                      .y_px = static_cast<float>(0.5 * height + shrink * dy),
                      .xx_px2 = static_cast<float>(cosine * cosine * u + sine * sine * v),
                      .xy_px2 = static_cast<float>(kind.ratio > 1.0 ? cosine * sine * (u - v) : 0.0),
                      .yy_px2 = static_cast<float>(sine * sine * u + cosine * cosine * v)};
        }
        if (kind.any && (x + 3 * row) % 10 == 0) matte.add_pyramid(x, row, c, ring(modes[0]));
      }
    }
  }
  return matte;
}

// Waves of all lengths that move from picture to picture.
RadianceImage waves(int width, int height, size_t i) {
  RadianceImage picture(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        double light = 0.5;
        for (int octave = 1; octave < 8; ++octave)
          light += 0.06 * std::sin((x + 7.0 * static_cast<double>(i) + (0.6 + 0.1 * c) * y) *
                                   std::exp2(octave) * 0.005);
        picture.at(x, y, c) = static_cast<float>(light);
      }
    }
  }
  return picture;
}
const std::vector<std::vector<RadianceImage>>& pictures() {
  static const std::vector<std::vector<RadianceImage>> made = [] {
    std::vector<std::vector<RadianceImage>> all;
    for (size_t i = 0; i < kPictures; ++i) all.push_back({waves(kWidth, kHeight, i)});
    return all;
  }();
  return made;
}

struct Prepared {
  Matte matte;
  FastCompositor fast;
};
const Prepared& prepared(size_t kind) {
  static std::map<size_t, Prepared> all;
  const auto known = all.find(kind);
  if (known != all.end()) return known->second;
  Matte matte = lens(kKinds[kind], kWidth, kHeight, kHeight);
  FastCompositor fast = FastCompositor::create(matte, kThreads).value();
  return all.emplace(kind, Prepared{std::move(matte), std::move(fast)}).first->second;
}

void fast(benchmark::State& state, size_t kind) {
  const Prepared& of = prepared(kind);
  size_t i = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(of.fast.composite(pictures()[i++ % kPictures], kThreads).value());
  state.SetItemsProcessed(state.iterations());
}

// Three rows only, since a frame with wide footprints takes minutes.
void exact(benchmark::State& state, size_t kind) {
  constexpr int kRows = 3;
  const Matte matte = lens(kKinds[kind], kWidth, kHeight, kRows);
  size_t i = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(composite(matte, pictures()[i++ % kPictures], kThreads).value());
  state.SetItemsProcessed(state.iterations());
  state.counters["items_per_second"] = benchmark::Counter(
      static_cast<double>(state.iterations() * kRows) / kHeight, benchmark::Counter::kIsRate);
}

void prepare(benchmark::State& state, size_t kind) {
  const Prepared& of = prepared(kind);
  for (auto _ : state) benchmark::DoNotOptimize(FastCompositor::create(of.matte, kThreads).value());
  state.SetItemsProcessed(state.iterations());
}

// Every mode is sampled bilinearly at its centre, by channel if they differ, and weighted.
void remap(benchmark::State& state, size_t kind) {
  const Prepared& of = prepared(kind);
  const int modes = of.matte.modes_per_channel();
  struct Map {
    int channel;
    cv::Mat x, y, weight;
  };
  std::vector<Map> maps;
  for (int c = 0; c < kChannels; ++c) {
    for (int m = 0; m < modes; ++m) {
      Map map{c, cv::Mat(kHeight, kWidth, CV_32F), cv::Mat(kHeight, kWidth, CV_32F),
              cv::Mat(kHeight, kWidth, CV_32F)};
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const Mode& mode = of.matte.modes(x, y, c)[m];
          map.x.at<float>(y, x) = mode.x_px - 0.5f;
          map.y.at<float>(y, x) = mode.y_px - 0.5f;
          map.weight.at<float>(y, x) = mode.weight;
        }
      }
      maps.push_back(map);
    }
  }
  cv::setNumThreads(kThreads);
  size_t i = 0;
  for (auto _ : state) {
    const RadianceImage& picture = pictures()[i++ % kPictures][0];
    const cv::Mat whole(kHeight, kWidth, CV_32FC3, const_cast<float*>(picture.samples.data()));
    std::array<cv::Mat, 3> planes, sums;
    cv::split(whole, planes.data());
    for (cv::Mat& sum : sums) sum = cv::Mat::zeros(kHeight, kWidth, CV_32F);
    for (const Map& map : maps) {
      const size_t c = map.channel;
      cv::Mat seen;
      cv::remap(planes[c], seen, map.x, map.y, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
      cv::accumulateProduct(seen, map.weight, sums[c]);
    }
    cv::Mat out;
    cv::merge(sums.data(), 3, out);
    benchmark::DoNotOptimize(out.data);
  }
  state.SetItemsProcessed(state.iterations());
}

// Reads as many bytes as the weights and a picture's samples, with as many threads: the limit set by memory.
void read_memory(benchmark::State& state, size_t kind) {
  const Prepared& of = prepared(kind);
  const std::vector<std::uint64_t> bytes(of.fast.size_bytes() / 8, 1);
  for (auto _ : state) {
    std::array<std::uint64_t, kThreads> sums{};
    std::vector<std::jthread> threads;
    for (size_t t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] {
        std::uint64_t sum = 0;
        for (size_t i = bytes.size() * t / kThreads; i < bytes.size() * (t + 1) / kThreads; ++i)
          sum += bytes[i];
        sums[t] = sum;
      });
    }
    threads.clear();
    benchmark::DoNotOptimize(sums);
  }
  state.SetItemsProcessed(state.iterations());
}

// A matte's file of 12 megapixels, two modes a channel, before a monitor as large.
struct Large {
  static constexpr int kLargeWidth = 4000, kLargeHeight = 3000;
  std::string file;
  std::vector<RadianceImage> background;
  std::optional<FastCompositor> fast;  // made by the first that needs it
};
Large& large() {
  static Large made{.file = large_matte(),
                    .background = {waves(Large::kLargeWidth, Large::kLargeHeight, 0)},
                    .fast = std::nullopt};
  return made;
}

void large_first(benchmark::State& state) {
  const Large& of = large();
  for (auto _ : state)
    benchmark::DoNotOptimize(composite_file(
                                 of.file, of.background, [](Matte&) {}, kThreads)
                                 .value());
  state.SetItemsProcessed(state.iterations());
}

void large_prepare(benchmark::State& state) {
  Large& of = large();
  for (auto _ : state)
    of.fast.emplace(FastCompositor::create(
                        of.file, [](Matte&) {}, kThreads)
                        .value());
  state.SetItemsProcessed(state.iterations());
}

void large_next(benchmark::State& state) {
  Large& of = large();
  if (!of.fast)
    of.fast.emplace(FastCompositor::create(
                        of.file, [](Matte&) {}, kThreads)
                        .value());
  for (auto _ : state) benchmark::DoNotOptimize(of.fast->composite(of.background, kThreads).value());
  state.SetItemsProcessed(state.iterations());
}

void add_large_rows(std::vector<Row>& rows) {
  const auto add = [&rows](const std::string& name, const std::string& unit, const std::string& key,
                           void (*run)(benchmark::State&)) {
    benchmark::RegisterBenchmark(key.c_str(), run)
        ->UseRealTime()
        ->MeasureProcessCPUTime()
        ->Iterations(1)
        ->Repetitions(3)
        ->Unit(benchmark::kMillisecond);
    const std::string timed = key + "/iterations:1/repeats:3/process_time/real_time";
    rows.push_back({"composite, 12 megapixels, two threads: " + name, unit, {timed}, [=](const Rates& rates) {
                      return unit == "s" ? 1.0 / rates.at(key) : rates.at(key);
                    }});
  };
  add("a file's first picture", "s", "composite/large/first", large_first);
  add("preparing many", "s", "composite/large/prepare", large_prepare);
  add("each of many", "frames/s", "composite/large/next", large_next);
}

}  // namespace

std::string large_matte() {
  return encode_matte(lens(kKinds[3], Large::kLargeWidth, Large::kLargeHeight, Large::kLargeHeight)).value();
}

void add_composite_rows(std::vector<Row>& rows) {
  for (size_t kind = 0; kind < kKinds.size(); ++kind) {
    const std::string name = std::string("composite, ") + kKinds[kind].name;
    const std::string key = "composite/" + std::to_string(kind);
    const auto add = [&](const std::string& what, void (*run)(benchmark::State&, size_t)) {
      benchmark::RegisterBenchmark((key + what).c_str(), [=](benchmark::State& state) { run(state, kind); })
          ->UseRealTime()
          ->MeasureProcessCPUTime()
          ->Unit(benchmark::kMillisecond);
      return key + what;
    };
    const std::string own = add("", fast), oracle = add("/exact", exact), looked_up = add("/remap", remap),
                      made = add("/prepare", prepare), memory = add("/memory", read_memory);
    // Google Benchmark's name for a benchmark timed like this.
    const auto timed = [](const std::string& of) { return of + "/process_time/real_time"; };
    const auto ratio = [](const std::string& a, const std::string& b) {
      return [a, b](const Rates& rates) { return rates.at(a) / rates.at(b); };
    };
    rows.push_back({name + ", 1280x720, two threads", "frames/s", {timed(own)}, [own](const Rates& rates) {
                      return rates.at(own);
                    }});
    rows.push_back(
        {name + ", over the exact one", "x the rate", {timed(own), timed(oracle)}, ratio(own, oracle)});
    rows.push_back({name + ", over OpenCV's remap at the centres",
                    "x the rate",
                    {timed(own), timed(looked_up)},
                    ratio(own, looked_up)});
    rows.push_back({name + ", over reading its weights once",
                    "x the time",
                    {timed(own), timed(memory)},
                    ratio(memory, own)});
    rows.push_back(
        {name + ", preparing the matte", "frames' time", {timed(own), timed(made)}, ratio(own, made)});
  }
  add_large_rows(rows);
}

}  // namespace glasswing
