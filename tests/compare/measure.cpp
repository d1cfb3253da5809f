#include "tests/compare/measure.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/composite/compositor.h"
#include "core/image/image_file.h"
#include "solver/methods.h"
#include "tests/results/solved.h"

namespace glasswing {
namespace {

// Short solves are repeated for a median time.
constexpr int kMaxSolves = 3;
constexpr double kShortSolve_s = 1.0;

absl::StatusOr<Solved> solve_timed(const Method& method, const v1::CaptureManifest& manifest,
                                   const FrameStack& stack) {
  GW_ASSIGN_OR_RETURN(Solved solved, solve(method, manifest, stack));
  std::vector<double> seconds{solved.seconds};
  while (solved.seconds < kShortSolve_s && seconds.size() < kMaxSolves) {
    GW_ASSIGN_OR_RETURN(const Solved again, solve(method, manifest, stack));
    seconds.push_back(again.seconds);
  }
  std::ranges::sort(seconds);
  solved.seconds = seconds[seconds.size() / 2];
  return solved;
}

}  // namespace

std::filesystem::path composite_path(const std::filesystem::path& folder, const std::string& scene,
                                     const std::string& family, const std::string& variant,
                                     const std::string& photograph) {
  return folder / (family + ", " + variant) / scene / (photograph + ".png");
}

absl::StatusOr<Figures> measure(const RenderedScene& scene, const Candidate& candidate,
                                const SynthesizedCapture& capture, const NoiseLevel& noise,
                                const std::filesystem::path& folder) {
  Figures figures{.scene = scene.name(),
                  .family = candidate.family,
                  .variant = candidate.variant,
                  .noise = noise.name,
                  .psnr = {}};
  GW_ASSIGN_OR_RETURN(const auto method, make_method(candidate.method, candidate.options));
  GW_ASSIGN_OR_RETURN(const auto prepared, method->prepare(capture.manifest));
  for (const int frame : prepared->frames_needed())
    ++(capture.manifest.frames(frame).object() ? figures.images_with_object : figures.images_without);
  GW_ASSIGN_OR_RETURN(const FrameStack stack, scene.stack(*method, capture, noise.degradation));
  GW_ASSIGN_OR_RETURN(const Solved solved, solve_timed(*method, capture.manifest, stack));
  figures.solve_seconds = solved.seconds;
  figures.flagged = solved.flagged;
  for (const std::string& name : scene.photograph_names()) {
    const Photograph photograph = scene.photograph(name);
    GW_ASSIGN_OR_RETURN(const RadianceImage ours, composite(solved.matte, photograph.backgrounds));
    figures.psnr[name] = scene.psnr(ours, photograph.seen);
    if (figures.noise != kNoiseLevels[0].name) continue;
    const std::filesystem::path path =
        composite_path(folder, scene.name(), candidate.family, candidate.variant, name);
    std::filesystem::create_directories(path.parent_path());
    GW_RETURN_IF_ERROR(write_radiance(path, ours, Encoding::kLinear));
  }
  return figures;
}

Figures measure_bare(const RenderedScene& scene) {
  Figures figures{
      .scene = scene.name(), .family = kBare, .variant = "", .noise = kNoiseLevels[0].name, .psnr = {}};
  for (const std::string& name : scene.photograph_names())
    figures.psnr[name] = scene.psnr(scene.photograph(name).bare, scene.photograph(name).seen);
  return figures;
}

}  // namespace glasswing
