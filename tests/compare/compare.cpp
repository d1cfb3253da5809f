// Runs every method on every rendered scene, at several image counts and noise levels, and writes
// docs/comparison.csv, charts, rows of pictures and the tables of docs/comparison.md.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <iostream>
#include <tuple>

#include "core/base/status.h"
#include "tests/compare/candidate.h"
#include "tests/compare/figures.h"
#include "tests/compare/measure.h"
#include "tests/compare/report.h"

namespace glasswing {
namespace {

struct Options {
  std::filesystem::path directory, docs = "docs", composites = "build/compare";
  std::vector<std::string> scenes{"A_crystal",    "B_bimodal",     "C_brushed",
                                  "D_foreground", "E_twomonitors", "G_misregistered"};
  std::vector<std::string> only, variants;
  bool report_only = false, print_only = false;
  bool some_scenes = false;
  double full_well = 0.0;  // 0: kNoiseLevels

  std::vector<NoiseLevel> noise_levels() const {
    if (full_well == 0.0) return {std::begin(kNoiseLevels), std::end(kNoiseLevels)};
    // Ten electrons of read noise, of a camera of ten thousand.
    return {{"photons", {.noise_sd = 0.001, .full_well = full_well, .bits = 12}}};
  }
};

bool wanted(const Options& options, const Candidate& candidate) {
  const auto named = [](const std::vector<std::string>& names, const std::string& name) {
    return names.empty() || std::ranges::find(names, name) != names.end();
  };
  return named(options.only, candidate.family) && named(options.variants, candidate.variant);
}

// Replaces earlier measurements of the same.
void put(Figures figures, std::vector<Figures>& all) {
  const auto key = [](const Figures& own) { return std::tie(own.scene, own.family, own.variant, own.noise); };
  const auto known =
      std::ranges::find_if(all, [&](const Figures& other) { return key(other) == key(figures); });
  if (known == all.end()) {
    all.push_back(std::move(figures));
  } else {
    *known = std::move(figures);
  }
}

// Saved scene by scene, so that an interrupted run keeps its results.
absl::Status measure_all(const Options& options, const std::filesystem::path& kept,
                         std::vector<Figures>& all) {
  const std::vector<Candidate> competing = candidates();
  const auto start = std::chrono::steady_clock::now();
  for (const std::string& name : options.scenes) {
    RenderedScene scene(options.directory / name);
    if (options.full_well > 0.0) scene.calibrate(options.noise_levels()[0].degradation);
    put(measure_bare(scene), all);
    for (const Candidate& candidate : competing) {
      if (!wanted(options, candidate)) continue;
      const absl::StatusOr<SynthesizedCapture> capture = candidate.capture(scene);
      if (absl::IsFailedPrecondition(capture.status())) {
        fmt::print("{}, {} of {}: {}\n", candidate.family, candidate.variant, scene.name(),
                   std::string(capture.status().message()));
        continue;
      }
      GW_RETURN_IF_ERROR(capture.status());
      for (const NoiseLevel& noise : options.noise_levels()) {
        GW_ASSIGN_OR_RETURN(Figures figures, measure(scene, candidate, *capture, noise, options.composites));
        const double since = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        fmt::print(
            "{:6.0f} s  {:16} {:24} {:12} {:6} {:3}+{:<3} images {:6.2f} s {:5.1f} % flagged {:5.1f} dB\n",
            since, figures.scene, figures.family, figures.variant, figures.noise, figures.images_with_object,
            figures.images_without, figures.solve_seconds, 100.0 * figures.flagged, figures.mean_psnr());
        std::fflush(stdout);
        put(std::move(figures), all);
      }
    }
    if (!options.print_only) GW_RETURN_IF_ERROR(write_figures(kept, all));
  }
  return absl::OkStatus();
}

absl::Status run(const Options& options) {
  const std::filesystem::path kept = options.docs / "comparison.csv";
  std::vector<Figures> all;
  const bool partly = options.some_scenes || !options.only.empty() || !options.variants.empty();
  if (options.report_only || (partly && std::filesystem::exists(kept))) {
    GW_ASSIGN_OR_RETURN(all, read_figures(kept));
  }
  if (!options.report_only) GW_RETURN_IF_ERROR(measure_all(options, kept, all));
  if (options.print_only) return absl::OkStatus();
  return write_report(options.directory, options.docs, options.composites, all);
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  CLI::App app{"Compares the methods on rendered scenes and writes docs/comparison.*"};
  glasswing::Options options;
  app.add_option("directory", options.directory, "Folder with the scenes")
      ->required()
      ->check(CLI::ExistingDirectory);
  const CLI::Option* const scenes =
      app.add_option("--scenes", options.scenes, "Scenes to measure; figures of the others are kept")
          ->delimiter(',');
  app.add_option("--only", options.only,
                 "Methods to measure, as named in the table; figures of the others are kept");
  app.add_option("--variant", options.variants,
                 "Variants of these, such as '50 images'; figures of the others are kept");
  app.add_flag("--report", options.report_only, "Measure nothing; only rewrite tables, charts and pictures");
  app.add_flag("--print", options.print_only, "Only print the figures; leaves the pages as they are");
  app.add_option("--full-well", options.full_well,
                 "Instead of the levels of noise: photon noise of so many electrons and 0.1 % of read noise, "
                 "of a camera whose noise is known; prints only")
      ->check(CLI::Range(10.0, 1e7));
  app.add_option("--docs", options.docs, "Folder with comparison.md")->capture_default_str();
  app.add_option("--composites", options.composites, "Folder for every composite, 16-bit linear PNG")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  options.some_scenes = scenes->count() > 0;
  if (options.full_well > 0.0) options.print_only = true;
  const absl::Status status = glasswing::run(options);
  if (!status.ok()) std::cerr << "glasswing-compare: " << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
