// Solves the rendered scenes, clean and degraded, and prints the PSNR of the composites relative to the
// photographs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <map>

#include "core/composite/compositor.h"
#include "core/image/image_file.h"
#include "core/method/methods.h"
#include "solver/methods.h"
#include "tests/results/rendered_scene.h"
#include "tests/results/sheet.h"
#include "tests/results/solved.h"

namespace glasswing {
namespace {

// dB of simpler solvers on the clean frames: an EM fit of two Gaussians (one for C) in a hundred lines, an
// exhaustive fit of one box, and the background without the object.
struct Floor {
  double quick, box, plain;
};

const std::map<std::string, Floor> kFloors = {{"A_crystal/stilllife", {43.6, 27.4, 11.0}},
                                              {"A_crystal/stone", {41.1, 28.0, 15.0}},
                                              {"A_crystal/landscape", {36.4, 22.5, 8.7}},
                                              {"B_bimodal/stilllife", {37.7, 24.4, 14.5}},
                                              {"B_bimodal/stone", {37.9, 26.9, 16.1}},
                                              {"B_bimodal/landscape", {41.3, 29.8, 16.5}},
                                              {"C_brushed/stilllife", {36.5, 31.8, 10.8}},
                                              {"C_brushed/stone", {35.3, 30.4, 14.7}},
                                              {"C_brushed/landscape", {36.3, 31.4, 8.1}},
                                              {"C_brushed/lines", {28.5, 21.4, 8.8}},
                                              {"D_foreground/stilllife", {44.9, 33.4, 11.6}},
                                              {"D_foreground/stone", {47.2, 36.8, 13.9}},
                                              {"D_foreground/landscape", {51.7, 35.6, 8.6}},
                                              {"E_twomonitors/stilllife", {44.5, 33.1, 8.6}},
                                              {"E_twomonitors/stone", {44.0, 34.5, 11.2}},
                                              {"E_twomonitors/landscape", {45.5, 34.2, 8.1}},
                                              {"E_twomonitors/left_stilllife", {47.1, 32.7, 14.7}},
                                              {"E_twomonitors/left_stone", {45.3, 32.2, 17.8}},
                                              {"E_twomonitors/left_landscape", {52.7, 40.3, 17.2}},
                                              {"E_twomonitors/both", {41.9, 0.0, 9.4}},
                                              {"G_misregistered/stilllife", {41.8, 21.9, 14.2}},
                                              {"G_misregistered/stone", {39.7, 25.9, 16.9}},
                                              {"G_misregistered/landscape", {43.1, 25.7, 14.9}}};

void report(const RenderedScene& scene, const Method& method, bool noise, const std::string& pictures,
            const std::string& composites, bool photographs) {
  const SynthesizedCapture capture = as_recorded(scene.manifest());
  const auto solved = [&](const Degradation& degradation) {
    return solve(method, capture.manifest, scene.stack(method, capture, degradation).value()).value();
  };
  const Solved clean = solved({});
  const Solved noisy = noise ? solved({.noise_sd = 0.005, .bits = 12}) : Solved{};
  bool first = true;
  for (const std::string& name : scene.photograph_names()) {
    const Photograph photograph = scene.photograph(name);
    const RadianceImage ours = composite(clean.matte, photograph.backgrounds).value();
    const double decibels = scene.psnr(ours, photograph.seen);
    const auto floor = kFloors.find(scene.name() + "/" + name);
    const Floor floors = floor == kFloors.end() ? Floor{} : floor->second;
    const auto keep = [&](const char* kind, const RadianceImage& image) {
      if (composites.empty()) return;
      const std::string folder = fmt::format("{}/{}/{}", composites, kind, scene.name());
      std::filesystem::create_directories(folder);
      (void)write_radiance(folder + "/" + name + ".png", image, Encoding::kLinear);
    };
    keep("clean", ours);
    std::string noisy_text = "–";
    if (noise) {
      const RadianceImage noisy_composite = composite(noisy.matte, photograph.backgrounds).value();
      keep("noisy", noisy_composite);
      noisy_text = fmt::format("{:.1f}", scene.psnr(noisy_composite, photograph.seen));
    }
    fmt::print("| {} | {} | {:.1f} | {} | {:.1f} | {:.1f} | {:.1f} | {} |\n", first ? scene.name() : "", name,
               decibels, noisy_text, floors.quick, floors.box, floors.plain,
               !first  ? ""
               : noise ? clean.text() + "; noisy " + noisy.text()
                       : clean.text());
    std::fflush(stdout);
    if (first && !pictures.empty()) {
      write_sheet(pictures + "/results_" + scene.name() + ".png", photograph.seen, ours, clean.matte,
                  photographs);
    }
    first = false;
  }
}

int run(int argc, char** argv) {
  CLI::App app{"Solves rendered scenes and prints PSNR inside the object, in dB"};
  std::string directory, pictures, composites, method_name = "gaussian";
  std::vector<std::string> scenes{"A_crystal",    "B_bimodal",     "C_brushed",
                                  "D_foreground", "E_twomonitors", "G_misregistered"};
  std::vector<std::string> settings;
  bool no_noise = false, no_photographs = false;
  app.add_option("directory", directory, "Folder with the scenes")->required()->check(CLI::ExistingDirectory);
  app.add_option("--scenes", scenes, "Scenes to solve")->delimiter(',');
  app.add_option("--method", method_name, "Method to solve with")->capture_default_str();
  app.add_option("--set", settings, "Option of the method, such as modes=2");
  app.add_option("--pictures", pictures, "Folder for one picture per scene");
  app.add_option("--composites", composites, "Folder for every composite, 16-bit linear PNG");
  app.add_flag("--no-photographs", no_photographs, "Leave photographs and composites out of the pictures");
  app.add_flag("--no-noise", no_noise, "Clean frames only");
  CLI11_PARSE(app, argc, argv);
  MethodOptions options;
  for (const std::string& setting : settings) {
    const auto option = parse_setting(setting);
    if (!option.ok()) {
      fmt::print(stderr, "{}\n", std::string(option.status().message()));
      return 1;
    }
    options[option->first] = option->second;
  }
  const auto method = make_method(method_name, options);
  if (!method.ok()) {
    fmt::print(stderr, "{}\n", std::string(method.status().message()));
    return 1;
  }
  fmt::print(
      "| scene | photograph | clean | noisy | two-mode EM | one box | bare | |\n| --- | --- | --- | --- | "
      "--- | --- | --- | --- |\n");
  for (const std::string& name : scenes) {
    report(RenderedScene(std::filesystem::path(directory) / name), **method, !no_noise, pictures, composites,
           !no_photographs);
  }
  return 0;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  return glasswing::run(argc, argv);
}
