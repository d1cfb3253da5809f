// Rendered scenes with 0.5 % of noise, solved with Gaussians and with footprints of any shape: PSNR of their
// composites, how much of white is within three of the errors that the mattes state, and the size of files.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>

#include "core/composite/fast_compositor.h"
#include "core/footprint/composite_error.h"
#include "core/matte/matte_file.h"
#include "core/matte/pyramid_share.h"
#include "solver/methods.h"
#include "tests/results/rendered_scene.h"
#include "tests/results/solved.h"

namespace glasswing {
namespace {

constexpr double kNoise = 0.005;

struct Kind {
  Solved solved;
  FastCompositor compositor;
  PyramidShare share;
  size_t bytes;
};

Kind solved_kind(const RenderedScene& scene, const MethodOptions& options) {
  const auto method = make_method("gaussian", options).value();
  const SynthesizedCapture capture = as_recorded(scene.manifest());
  const FrameStack stack = scene.stack(*method, capture, {.noise_sd = kNoise}).value();
  Solved solved = solve(*method, capture.manifest, stack).value();
  FastCompositor compositor = FastCompositor::create(solved.matte).value();
  const PyramidShare share = pyramid_share(solved.matte);
  const size_t bytes = encode_matte(solved.matte).value().size();
  return {std::move(solved), std::move(compositor), share, bytes};
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

void report(RenderedScene scene) {
  scene.calibrate({.noise_sd = kNoise});
  const std::array<Kind, 2> kinds{solved_kind(scene, {}), solved_kind(scene, {{"footprints", "any"}})};
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
