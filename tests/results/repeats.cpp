// Solves rendered scenes again and again, each time with other noise, and holds the scatter of the
// composites, and what they are off from the photographs, against the error that their mattes predict
// (core/footprint/composite_error.h). PSNR without scatter is what a perfect filter of mattes could reach.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

#include "core/composite/fast_compositor.h"
#include "core/footprint/composite_error.h"
#include "solver/methods.h"
#include "tests/results/rendered_scene.h"
#include "tests/results/solved.h"

namespace glasswing {
namespace {

// Of one sample of the composites, over the repeats in which its error was known.
struct Scatter {
  int count = 0;
  double sum = 0.0, squares = 0.0, off = 0.0, predicted = 0.0;  // off: from the photograph
};

void report(const RenderedScene& scene, int repeats, double noise_sd) {
  const auto method = make_method("gaussian", {}).value();
  const SynthesizedCapture capture = as_recorded(scene.manifest());
  std::vector<Photograph> photographs;
  for (const std::string& name : scene.photograph_names()) photographs.push_back(scene.photograph(name));
  std::vector<std::vector<Scatter>> scatters(photographs.size());
  for (int repeat = 0; repeat < repeats; ++repeat) {
    const Degradation degradation{
        .noise_sd = noise_sd, .bits = 16, .seed = static_cast<unsigned>(repeat + 1)};
    const Solved solved =
        solve(*method, capture.manifest, scene.stack(*method, capture, degradation).value()).value();
    const FastCompositor compositor = FastCompositor::create(solved.matte).value();
    for (size_t i = 0; i < photographs.size(); ++i) {
      const RadianceImage seen = compositor.composite(photographs[i].backgrounds).value(),
                          error = composite_error(solved.matte, photographs[i].backgrounds).value();
      scatters[i].resize(seen.samples.size());
      for (size_t k = 0; k < seen.samples.size(); ++k) {
        const auto own = static_cast<double>(error.samples[k]), value = static_cast<double>(seen.samples[k]);
        if (std::isnan(own)) continue;
        Scatter& scatter = scatters[i][k];
        ++scatter.count;
        scatter.sum += value;
        scatter.squares += value * value;
        scatter.off += std::pow(value - static_cast<double>(photographs[i].seen.samples[k]), 2);
        scatter.predicted += own * own;
      }
    }
    fmt::print(stderr, "\r{}: {} of {}", scene.name(), repeat + 1, repeats);
  }
  fmt::print(stderr, "\n");
  for (size_t i = 0; i < photographs.size(); ++i) {
    std::vector<double> scatter_ratios, error_ratios;
    double off = 0.0, scattered = 0.0;  // mean squares, summed over samples
    for (const Scatter& scatter : scatters[i]) {
      if (scatter.count < std::max(2, 9 * repeats / 10)) continue;
      const double n = scatter.count, mean = scatter.sum / n;
      const double variance = std::max(scatter.squares / n - mean * mean, 0.0) * n / (n - 1.0);
      off += scatter.off / n;
      scattered += variance;
      scatter_ratios.push_back(std::sqrt(variance / (scatter.predicted / n)));
      error_ratios.push_back(std::sqrt(scatter.off / scatter.predicted));
    }
    const auto text = [](std::vector<double>& ratios) {
      std::ranges::sort(ratios);
      const auto within = [&](double low, double high) {
        const auto count = std::ranges::count_if(ratios, [&](double r) { return r >= low && r < high; });
        return 100.0 * static_cast<double>(count) / static_cast<double>(std::max<size_t>(ratios.size(), 1));
      };
      return fmt::format("{:.2f} | {:.0f} %, {:.0f} %, {:.0f} %",
                         ratios.empty() ? NAN : ratios[ratios.size() / 2], within(0.0, 0.7), within(0.7, 1.4),
                         within(1.4, INFINITY));
    };
    const auto psnr = [&](double squares) {
      return -10.0 * std::log10(squares / static_cast<double>(scatter_ratios.size()));
    };
    fmt::print("| {} | {} | {} | {} | {} | {:.1f} | {:.1f} |\n", scene.name(), photographs[i].name,
               scatter_ratios.size(), text(scatter_ratios), text(error_ratios), psnr(off),
               psnr(off - scattered));
  }
}

int run(int argc, char** argv) {
  CLI::App app{"Holds the scatter of noisy composites against the error that their mattes predict"};
  std::string directory;
  std::vector<std::string> scenes{"A_crystal", "B_bimodal", "C_brushed", "D_foreground"};
  int repeats = 50;
  double noise_sd = 0.005;
  app.add_option("directory", directory, "Folder with the scenes")->required()->check(CLI::ExistingDirectory);
  app.add_option("--scenes", scenes, "Scenes to solve")->delimiter(',');
  app.add_option("--repeats", repeats, "How often")->check(CLI::Range(2, 10000))->capture_default_str();
  app.add_option("--noise", noise_sd, "Of full scale")->check(CLI::Range(1e-4, 0.2))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  fmt::print(
      "| scene | photograph | samples | scatter over predicted | below 0.7, 0.7 to 1.4, above | error over "
      "predicted | | PSNR, dB | without scatter |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
  for (const std::string& name : scenes)
    report(RenderedScene(std::filesystem::path(directory) / name), repeats, noise_sd);
  return 0;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  return glasswing::run(argc, argv);
}
