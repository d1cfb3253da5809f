// Rendered scenes with 0.5 % of noise, solved with Gaussians and with footprints of any shape: PSNR of their
// composites, how much of white is within three of the errors that the mattes state, the size of files, and
// the processor time.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <deque>

#include "core/composite/fast_compositor.h"
#include "core/footprint/composite_error.h"
#include "core/matte/matte_file.h"
#include "core/matte/pyramid_share.h"
#include "solver/any/pyramid_solver.h"
#include "solver/methods.h"
#include "tests/results/rendered_scene.h"
#include "tests/results/solved.h"

namespace glasswing {
namespace {

constexpr double kNoise = 0.005;

struct Kind {
  Solved solved;
  double processor_s;
  FastCompositor compositor;
  PyramidShare share;
  size_t bytes;
};

const MethodOptions kAny{{"footprints", "any"}};

double processor_s(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

Kind solved_kind(const RenderedScene& scene, const MethodOptions& options) {
  const auto method = make_method("gaussian", options).value();
  const SynthesizedCapture capture = as_recorded(scene.manifest());
  const FrameStack stack = scene.stack(*method, capture, {.noise_sd = kNoise}).value();
  const double start_s = processor_s(CLOCK_PROCESS_CPUTIME_ID);
  Solved solved = solve(*method, capture.manifest, stack).value();
  const double took_s = processor_s(CLOCK_PROCESS_CPUTIME_ID) - start_s;
  FastCompositor compositor = FastCompositor::create(solved.matte).value();
  const PyramidShare share = pyramid_share(solved.matte);
  const size_t bytes = encode_matte(solved.matte).value().size();
  return {std::move(solved), took_s, std::move(compositor), share, bytes};
}

// Of the samples inside the object whose error is known, in every fourth row: the share within three of it,
// in per cent.
std::string within(const RenderedScene& scene, const Kind& kind, const Photograph& photograph,
                   const RadianceImage& made) {
  Matte some = kind.solved.matte;
  for (int y = 0; y < some.height_px(); ++y) {
    for (int x = 0; y % 4 != 0 && x < some.width_px(); ++x) some.coverage(x, y) = 0.0f;
  }
  const RadianceImage error = composite_error(some, photograph.backgrounds).value();
  const size_t row = 3 * static_cast<size_t>(made.width_px);
  double known = 0.0, good = 0.0, all = 0.0;
  for (size_t i = 0; i < made.samples.size(); ++i) {
    if (scene.mask().samples[i] <= 32767 || i / row % 4 != 0) continue;
    ++all;
    if (!std::isfinite(error.samples[i])) continue;
    ++known;
    good += std::abs(made.samples[i] - photograph.seen.samples[i]) <= 3.0f * error.samples[i];
  }
  return fmt::format("{:.1f} of {:.0f}", 100.0 * good / known, 100.0 * known / all);
}

std::string median_of(std::vector<double> each) {
  if (each.empty()) return "none";
  std::ranges::sort(each);
  return fmt::format("{:.3f} ({:.3f}) ms", 1e3 * each[each.size() / 2], 1e3 * each[each.size() * 19 / 20]);
}

// Processor time of the second pass for a channel, over every fourth row: median and 95 % of those pixels of
// which no channel was fitted, and of a fit in the others.
std::string second_pass(const RenderedScene& scene, Matte matte) {
  const auto method = make_method("gaussian", kAny).value();
  const SynthesizedCapture capture = as_recorded(scene.manifest());
  const FrameStack stack = scene.stack(*method, capture, {.noise_sd = kNoise}).value();
  const MixtureLayout layout = lay_out_mixture(capture.manifest).value();
  std::deque<PatternAnswers> answers;
  std::deque<PatternLanes> patterns;
  for (const MixtureMonitor& monitor : layout.monitors)
    patterns.emplace_back(answers.emplace_back(monitor.patterns, monitor.extent));
  std::vector<PyramidFitter> fitters(patterns.begin(), patterns.end());
  PyramidSolver solver(stack, layout, patterns, fitters);
  std::vector<double> judged, fitted;
  for (int y = 0; y < matte.height_px(); y += 4) {
    for (int x = 0; x < matte.width_px(); ++x) {
      if (!(matte.coverage(x, y) > 0.0f)) continue;
      const std::int64_t before = solver.fitted();
      const double start_s = processor_s(CLOCK_THREAD_CPUTIME_ID);
      solver.refine(x, y, matte);
      const double took_s = processor_s(CLOCK_THREAD_CPUTIME_ID) - start_s;
      const auto count = static_cast<double>(solver.fitted() - before);
      count > 0.0 ? fitted.push_back(took_s / count) : judged.push_back(took_s / kChannels);
    }
  }
  return fmt::format("{} pixels only judged, {} a channel; {} fitted, {} a fit", judged.size(),
                     median_of(judged), fitted.size(), median_of(fitted));
}

void report(RenderedScene scene) {
  scene.calibrate({.noise_sd = kNoise});
  const std::array<Kind, 2> kinds{solved_kind(scene, {}), solved_kind(scene, kAny)};
  std::vector<Photograph> photographs;
  for (const std::string& name : scene.photograph_names()) {
    if (name != "white") photographs.push_back(scene.photograph(name));
  }
  photographs.push_back(scene.white());  // errors take longest
  for (const Photograph& photograph : photographs) {
    std::array<std::string, 2> psnr, errors;
    for (size_t k = 0; k < kinds.size(); ++k) {
      const RadianceImage made = kinds[k].compositor.composite(photograph.backgrounds).value();
      psnr[k] = fmt::format("{:.1f}", scene.psnr(made, photograph.seen));
      if (photograph.name == "white") errors[k] = within(scene, kinds[k], photograph, made);
    }
    fmt::print("| {} | {} | {} → {} | {} |\n", scene.name(), photograph.name, psnr[0], psnr[1],
               errors[0].empty() ? "" : errors[0] + " → " + errors[1]);
    std::fflush(stdout);
  }
  const PyramidShare& share = kinds[1].share;
  fmt::print(
      "{}: {:.1f} % of the object's pixels have pyramids; Gaussians {}, {:.2f} MB; any {}, {:.2f} MB\n",
      scene.name(), 100.0 * static_cast<double>(share.pixels) / static_cast<double>(share.object),
      kinds[0].solved.text(), 1e-6 * static_cast<double>(kinds[0].bytes), kinds[1].solved.text(),
      1e-6 * static_cast<double>(kinds[1].bytes));
  fmt::print("{}: processor time {:.2f} → {:.2f} s for {} pixels of the object; second pass: {}\n",
             scene.name(), kinds[0].processor_s, kinds[1].processor_s, share.object,
             second_pass(scene, kinds[0].solved.matte));
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  CLI::App app{"Solves rendered scenes with footprints of any shape, and prints what they are worth"};
  std::vector<std::string> scenes;
  app.add_option("scenes", scenes, "Folders of scenes")->required()->check(CLI::ExistingDirectory);
  CLI11_PARSE(app, argc, argv);
  fmt::print(
      "| scene | picture | PSNR, Gaussians → any | % within three errors, of % known |\n"
      "| --- | --- | --- | --- |\n");
  for (const std::string& scene : scenes) report(RenderedScene(scene));
  return 0;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  return glasswing::run(argc, argv);
}
