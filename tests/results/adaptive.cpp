// Captures that adapt against the full plan: a scene's first images, and round after round what core/design
// chooses, summed from recorded stripes and each with the noise of one image. Prints how many images reach
// the full plan's mean PSNR less 0.5 dB, as lines of JSON, and every round beside them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <optional>

#include "core/base/status.h"
#include "core/composite/fast_compositor.h"
#include "core/design/adaptation.h"
#include "core/design/plan_design.h"
#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/methods.h"
#include "tests/results/rendered_scene.h"
#include "tests/results/solved.h"

namespace glasswing {
namespace {

constexpr double kLess_db = 0.5;

bool same_pattern(const v1::Stimulus& a, const v1::Stimulus& b) {
  return a.kind() == b.kind() && std::ranges::equal(a.colour(), b.colour()) && a.orient() == b.orient() &&
         a.bar_width_px() == b.bar_width_px() && a.inverse() == b.inverse();
}

// The plan's images, recorded or summed.
absl::StatusOr<SynthesizedCapture> shown(const RenderedScene& scene, const v1::Plan& plan, StripeSums& sums) {
  const v1::CaptureManifest& recorded = scene.manifest();
  const std::vector<v1::Monitor> monitors(recorded.monitors().begin(), recorded.monitors().end());
  GW_ASSIGN_OR_RETURN(const std::vector<Step> steps, expand(plan, monitors));
  SynthesizedCapture capture = part_of(recorded, [&](const v1::Frame& frame) {
    return std::ranges::any_of(steps, [&](const Step& step) {
      return step.object == frame.object() && same_pattern(step.stimulus, frame.stimulus());
    });
  });
  for (const Step& step : steps) {
    if (kind_of(step.stimulus) != StimulusKind::kSinusoid) continue;
    v1::Frame frame;
    frame.set_file(fmt::format("step {}", step.number));
    frame.set_object(true);
    frame.set_exposure_ms(recorded.frames(0).exposure_ms());
    *frame.mutable_stimulus() = step.stimulus;
    GW_ASSIGN_OR_RETURN(std::vector<Part> parts, sums.parts(step.stimulus, step.stimulus.phi_deg()));
    capture.add(frame, std::move(parts));
  }
  return capture;
}

// Those that stripes can be summed to.
std::vector<DesignedWave> possible_waves(const v1::Monitor& monitor, StripeSums& sums) {
  std::vector<DesignedWave> waves;
  for (DesignedWave wave : usual_waves(extent_of(monitor))) {
    // A plan's directions reach from -90 to 90 degrees.
    if (wave.phi_deg > 90.0) wave.phi_deg -= 180.0;
    v1::Stimulus stimulus;
    stimulus.set_kind("sinusoid");
    stimulus.set_panel(monitor.name());
    stimulus.set_phi_deg(wave.phi_deg);
    stimulus.set_period_px(wave.period_px);
    stimulus.set_peak(1.0);
    if (sums.parts(stimulus, wave.phi_deg).ok()) waves.push_back(wave);
  }
  return waves;
}

struct Tried {
  Matte matte;
  double psnr_db = 0.0;  // mean over the photographs
  int images = 0;
};

absl::StatusOr<Tried> attempt(const RenderedScene& scene, const SynthesizedCapture& capture,
                              double noise_sd) {
  GW_ASSIGN_OR_RETURN(const auto method, make_method("gaussian", {}));
  GW_ASSIGN_OR_RETURN(const auto prepared, method->prepare(capture.manifest));
  GW_ASSIGN_OR_RETURN(const FrameStack stack, scene.stack(*method, capture, {.noise_sd = noise_sd}));
  GW_ASSIGN_OR_RETURN(Solved solved, solve(*method, capture.manifest, stack));
  Tried tried{.matte = std::move(solved.matte), .images = static_cast<int>(prepared->frames_needed().size())};
  GW_ASSIGN_OR_RETURN(const FastCompositor compositor, FastCompositor::create(tried.matte));
  const std::vector<std::string> names = scene.photograph_names();
  for (const std::string& name : names) {
    const Photograph photograph = scene.photograph(name);
    GW_ASSIGN_OR_RETURN(const RadianceImage seen, compositor.composite(photograph.backgrounds));
    tried.psnr_db += scene.psnr(seen, photograph.seen) / static_cast<double>(names.size());
  }
  return tried;
}

struct Wish {
  int first_images = 50;
  double target_db = 0.0;  // 0: the full plan's PSNR less kLess_db
  double noise_sd = 0.005;
};

absl::Status compare(const RenderedScene& scene, const Wish& wish) {
  const v1::CaptureManifest& recorded = scene.manifest();
  GW_ASSIGN_OR_RETURN(const Tried full, attempt(scene, as_recorded(recorded), wish.noise_sd));
  fmt::print("{}: full plan, {} images, {:.1f} dB\n", scene.name(), full.images, full.psnr_db);
  const std::vector<v1::Monitor> monitors(recorded.monitors().begin(), recorded.monitors().end());
  StripeSums sums(recorded);
  const std::vector<DesignedWave> waves = possible_waves(monitors.front(), sums);
  GW_ASSIGN_OR_RETURN(
      DesignedPlan designed,
      design_plan({.images = wish.first_images, .noise = {.read_sd = wish.noise_sd, .full_well = {}}},
                  {.monitors = monitors, .camera = {}}));
  v1::Plan plan = std::move(designed.plan);
  plan.mutable_adapt()->set_target_db(wish.target_db > 0.0 ? wish.target_db : full.psnr_db - kLess_db);
  plan.mutable_adapt()->set_at_most(full.images);
  std::optional<int> images;
  while (true) {
    GW_ASSIGN_OR_RETURN(const SynthesizedCapture capture, shown(scene, plan, sums));
    GW_ASSIGN_OR_RETURN(const Tried tried, attempt(scene, capture, wish.noise_sd));
    JudgedView view{.pixels = {}, .camera = recorded.camera()};
    add_pixels_of_object(tried.matte, 0, 1, monitors.size(), view.pixels);
    GW_ASSIGN_OR_RETURN(Adaptation adaptation, adapt({std::move(view)}, plan, monitors, waves));
    const v1::AdaptedRound& found = adaptation.found.front();
    fmt::print("{}: {} images, {:.1f} dB; {:.0f} % known to {:.1f} dB, 95 % to {:.1f} dB\n", scene.name(),
               found.image_count(), tried.psnr_db, 100.0 * found.known_share(), plan.adapt().target_db(),
               found.error_db());
    if (tried.psnr_db >= full.psnr_db - kLess_db) {
      images = found.image_count();
      break;
    }
    if (!adaptation.next) break;
    *plan.add_rounds() = *std::move(adaptation.next);
  }
  if (images) {
    fmt::print("{}: {} of {} images\n", scene.name(), *images, full.images);
  } else {
    fmt::print("{}: not reached\n", scene.name());
  }
  return absl::OkStatus();
}

int run(int argc, char** argv) {
  CLI::App app("Images that adaptive captures take for the quality of the full plan");
  std::filesystem::path directory;
  std::vector<std::string> names{"A_crystal", "B_bimodal", "C_brushed", "D_foreground", "G_misregistered"};
  Wish wish;
  app.add_option("directory", directory, "Folder with the scenes")->required()->check(CLI::ExistingDirectory);
  app.add_option("--scenes", names, "Scenes to measure")->delimiter(',')->capture_default_str();
  app.add_option("--first", wish.first_images, "Images before the first round")->capture_default_str();
  app.add_option("--target-db", wish.target_db, "What is asked for; 0: the full plan's PSNR less 0.5 dB")
      ->capture_default_str();
  app.add_option("--noise", wish.noise_sd, "Standard deviation, of full scale")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  for (const std::string& name : names) {
    if (const absl::Status status = compare(RenderedScene(directory / name), wish); !status.ok()) {
      fmt::print(stderr, "{}: {}\n", name, status.ToString());
      return 1;
    }
  }
  return 0;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  return glasswing::run(argc, argv);
}
