// Solves the rendered scenes and compares the fast compositor's pictures with the exact one's. Fails if one
// differs by more than 0.002 of full scale rms.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>

#include "core/composite/compositor.h"
#include "core/composite/fast_compositor.h"
#include "solver/methods.h"
#include "tests/results/rendered_scene.h"
#include "tests/results/solved.h"

namespace glasswing {
namespace {

constexpr double kMaxRms = 0.002;

double seconds_of(const auto& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// False: one of its pictures differs too much.
bool check(const RenderedScene& scene, const std::string& method_name) {
  const auto method = make_method(method_name, {}).value();
  const FrameStack stack = scene.stack(*method, as_recorded(scene.manifest())).value();
  const Matte matte = solve(*method, scene.manifest(), stack).value().matte;
  const FastCompositor compositor = FastCompositor::create(matte).value();
  bool held = true;
  for (const std::string& name : scene.photograph_names()) {
    const Photograph photograph = scene.photograph(name);
    RadianceImage fast, exact;
    const double fast_s = seconds_of([&] { fast = compositor.composite(photograph.backgrounds).value(); });
    const double exact_s = seconds_of([&] { exact = composite(matte, photograph.backgrounds).value(); });
    double sum = 0.0, most = 0.0;
    for (size_t i = 0; i < exact.samples.size(); ++i) {
      const double off =
          std::abs(static_cast<double>(fast.samples[i]) - static_cast<double>(exact.samples[i]));
      sum += off * off;
      most = std::max(most, off);
    }
    const double rms = std::sqrt(sum / static_cast<double>(exact.samples.size()));
    held = held && rms <= kMaxRms;
    fmt::print("| {} | {} | {} | {:.5f} | {:.4f} | {:.0f} |\n", method_name, scene.name(), name, rms, most,
               exact_s / fast_s);
    std::fflush(stdout);
  }
  return held;
}

int run(int argc, char** argv) {
  CLI::App app{"Compares the fast compositor with the exact one on rendered scenes"};
  std::string directory;
  std::vector<std::string> scenes{"A_crystal",    "B_bimodal",     "C_brushed",
                                  "D_foreground", "E_twomonitors", "G_misregistered"};
  std::vector<std::string> methods{"gaussian", "hierarchical"};
  app.add_option("directory", directory, "Folder with the scenes")->required()->check(CLI::ExistingDirectory);
  app.add_option("--scenes", scenes, "Scenes to solve")->delimiter(',');
  app.add_option("--methods", methods, "Methods to solve them with")->delimiter(',');
  CLI11_PARSE(app, argc, argv);
  fmt::print(
      "| method | scene | photograph | rms | most | x the rate |\n| --- | --- | --- | --- | --- | --- |\n");
  bool held = true;
  for (const std::string& method : methods) {
    for (const std::string& scene : scenes)
      held = check(RenderedScene(std::filesystem::path(directory) / scene), method) && held;
  }
  return held ? 0 : 1;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  return glasswing::run(argc, argv);
}
