#include "core/pattern/plan_fit.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/base/status.h"
#include "core/pattern/id_patch.h"

namespace glasswing {
namespace {

constexpr double kUsualSide_px = 128.0, kUsualSigma_px = 4.0;
constexpr double kMinSigma_px = 0.5, kMaxSigma_px = 200.0, kSigmaStep_px = 0.25;
constexpr int kDraftImages = 100;
constexpr int kMaxLevels = 14;
constexpr int kManyImages = 300, kWhiteSteps = 100;
constexpr double kShorter = 8.0;   // how much shorter the exposure for highlights is
constexpr double kNotable = 1.02;  // a longer exposure than this is more informative
constexpr double kLonger = 8.0;    // and that of dark objects longer
constexpr int kMaxHoldRefreshes = 600;
constexpr double kSettling_ms = 1.0;       // of a monitor
constexpr double kTriggerMargin_ms = 4.0;  // for the uncertainty of stamps and clocks
constexpr double kFineBars = 128.0;        // of a side, where bars alone determine the place

double longer_side(const v1::Monitor& monitor) {
  return std::max(monitor.width_px(), monitor.height_px());
}

double longest_side(const RigLimits& rig) {
  double longest = 0.0;
  for (const v1::Monitor& monitor : rig.monitors) longest = std::max(longest, longer_side(monitor));
  return longest;
}

double slowest_refresh_hz(const RigLimits& rig) {
  double slowest = 0.0;
  for (const v1::Monitor& monitor : rig.monitors) {
    const double refresh_hz = monitor.refresh_hz();
    if (refresh_hz > 0.0) slowest = slowest > 0.0 ? std::min(slowest, refresh_hz) : refresh_hz;
  }
  return slowest;
}

// Width of the bars of a level (SquareWaves, plan.proto).
double bar_px(double longer_px, int level) {
  return std::exp2(std::ceil(std::log2(longer_px)) - level);
}

// The fewest levels whose finest bars are at most so wide; bars are not finer than a pixel.
int levels_for(double longer_px, double finest_px) {
  int level = 1;
  while (level < kMaxLevels && bar_px(longer_px, level) > std::max(finest_px, 1.0)) ++level;
  return level;
}

v1::Plan plan_with(PlanQuality quality, double sigma_px, const RigLimits& rig) {
  const bool draft = quality == PlanQuality::kDraft;
  v1::Plan plan;
  plan.set_method("gaussian");
  for (const v1::Monitor& monitor : rig.monitors) {
    v1::PlanMonitor& planned = *plan.add_monitors();
    planned.set_name(monitor.name());
    planned.set_width_px(monitor.width_px());
    planned.set_height_px(monitor.height_px());
  }
  for (const double orientation_deg : {0.0, 90.0, 45.0, -45.0}) {
    if (draft && orientation_deg < 0.0) continue;
    v1::Sweep& sweep = *plan.add_sweeps();
    sweep.set_orientation_deg(orientation_deg);
    sweep.set_sigma_px(sigma_px);
    sweep.set_step_px(std::round(1e3 * (draft ? 1.1 : 0.5) * sigma_px) / 1e3);
    if (draft) sweep.set_margin_sigmas(1.5);
  }
  for (const double level : {0.0, 1.0}) {
    v1::Solid& solid = *plan.add_solids();
    for (int c = 0; c < 3; ++c) solid.add_colour(level);
  }
  v1::SquareWaves& waves = *plan.mutable_square_waves();
  waves.set_levels(levels_for(longest_side(rig), draft ? sigma_px : 0.25 * sigma_px));
  if (draft) {
    waves.set_first_level(std::max(waves.levels() - 2, 1));
    waves.set_without_complements(true);
  }
  if (images_of(plan, rig) > kManyImages) plan.set_white_every(kWhiteSteps);
  return plan;
}

// The plan with the narrowest stripes that takes at most this many images.
absl::StatusOr<v1::Plan> plan_of_images(PlanQuality quality, int images, const RigLimits& rig) {
  const auto plan_at = [&](int k) { return plan_with(quality, k * kSigmaStep_px, rig); };
  const auto fits = [&](int k) { return images_of(plan_at(k), rig) <= images; };
  int low = static_cast<int>(kMinSigma_px / kSigmaStep_px),
      high = static_cast<int>(kMaxSigma_px / kSigmaStep_px);
  if (!fits(high)) {
    return absl::InvalidArgumentError(
        fmt::format("{} images are too few for these monitors; the widest stripes take {}", images,
                    images_of(plan_at(high), rig)));
  }
  while (low < high) {
    const int middle = (low + high) / 2;
    fits(middle) ? high = middle : low = middle + 1;
  }
  return plan_at(high);
}

double rounded(double sigma_px) {
  return std::clamp(std::round(2.0 * sigma_px) / 2.0, kMinSigma_px, kMaxSigma_px);
}

// The time that a picture must stay unchanged for: exposure, readout and the time to the next frame. A
// triggered exposure waits for no frame, but it must fit between the scan-outs of two pictures.
double needed_ms(const v1::GetCameraResponse& camera, double exposure_ms, double refresh_hz) {
  if (camera.on_demand()) return 0.0;  // it stands until the camera has taken it
  const double period_ms = camera.frame_rate_hz() > 0.0 ? 1e3 / camera.frame_rate_hz() : 0.0;
  const double exposed_ms = exposure_ms + static_cast<double>(camera.readout_ns()) / 1e6;
  if (camera.trigger().empty()) return exposed_ms + period_ms;
  const double scanout_ms = refresh_hz > 0.0 ? 1e3 / refresh_hz : 0.0;
  return std::max(exposed_ms + kTriggerMargin_ms + scanout_ms, period_ms);
}

// A free-running exposure fits into a picture between its scan-out and the next one's with some probability;
// the fewest refreshes for each that fits.
int free_running_hold(const v1::GetCameraResponse& camera, double exposure_ms, double refresh_hz) {
  const double refresh_ms = 1e3 / refresh_hz, period_ms = 1e3 / camera.frame_rate_hz();
  const double exposed_ms = exposure_ms + static_cast<double>(camera.readout_ns()) / 1e6;
  int best = kDefaultHoldRefreshes;
  double least = std::numeric_limits<double>::infinity();
  for (int hold = kDefaultHoldRefreshes; hold <= kMaxHoldRefreshes; ++hold) {
    const double share = ((hold - 1) * refresh_ms - kSettling_ms - exposed_ms) / period_ms;
    if (share <= 0.0) continue;
    if (const double each = hold / std::min(share, 1.0); each < least) {
      best = hold;
      least = each;
    }
    if (share >= 1.0) break;
  }
  return best;
}

absl::Status fit_camera(const PlanWish& wish, const RigLimits& rig, v1::Plan& plan) {
  if (!rig.camera) {
    plan.add_exposure_ms(kDefaultExposureMs);
    plan.set_hold_refreshes(kDefaultHoldRefreshes);
    return absl::OkStatus();
  }
  const double least_ms = rig.camera->min_exposure_ms(), most_ms = rig.camera->max_exposure_ms();
  const double exposure_ms = std::min(std::max(kDefaultExposureMs, std::ceil(1e3 * least_ms) / 1e3),
                                      std::floor(1e3 * most_ms) / 1e3);
  double longest_ms = exposure_ms;
  if (wish.object == ObjectKind::kDark)
    longest_ms = std::min(kLonger * exposure_ms, std::floor(1e3 * most_ms) / 1e3);
  if (longest_ms > kNotable * exposure_ms) plan.add_exposure_ms(longest_ms);
  plan.add_exposure_ms(exposure_ms);
  const bool highlights = wish.quality == PlanQuality::kBest || wish.object == ObjectKind::kMetal;
  if (highlights && exposure_ms / kShorter >= least_ms) plan.add_exposure_ms(exposure_ms / kShorter);
  const double refresh_hz = slowest_refresh_hz(rig);
  const double hold = std::ceil(needed_ms(*rig.camera, longest_ms, refresh_hz) * refresh_hz / 1e3 - 1e-6);
  if (hold > kMaxHoldRefreshes) {
    return absl::InvalidArgumentError(
        fmt::format("the camera needs {:.4g} ms for a picture; a step can last {:.4g} ms at most",
                    needed_ms(*rig.camera, longest_ms, refresh_hz), 1e3 * kMaxHoldRefreshes / refresh_hz));
  }
  const bool free_running = rig.camera->trigger().empty() && !rig.camera->on_demand() &&
                            rig.camera->frame_rate_hz() > 0.0 && refresh_hz > 0.0;
  plan.set_hold_refreshes(free_running ? free_running_hold(*rig.camera, longest_ms, refresh_hz)
                                       : std::max(static_cast<int>(hold), kDefaultHoldRefreshes));
  return absl::OkStatus();
}

// The plan's monitors that the rig has too, with the sizes known to either of them.
std::vector<v1::Monitor> common_monitors(const v1::Plan& plan, const RigLimits& rig) {
  if (plan.monitors().empty()) return rig.monitors;
  std::vector<v1::Monitor> monitors;
  for (const v1::PlanMonitor& planned : plan.monitors()) {
    const auto real = std::ranges::find(rig.monitors, planned.name(), &v1::Monitor::name);
    if (real != rig.monitors.end()) {
      monitors.push_back(*real);
    } else if (planned.has_width_px() && planned.has_height_px()) {
      monitors.emplace_back().set_name(planned.name());
      monitors.back().set_width_px(planned.width_px());
      monitors.back().set_height_px(planned.height_px());
    }
  }
  return monitors;
}

double narrowest_sigma(const v1::Plan& plan) {
  double sigma_px = 0.0;
  for (const v1::Sweep& sweep : plan.sweeps())
    sigma_px = sigma_px > 0.0 ? std::min(sigma_px, sweep.sigma_px()) : sweep.sigma_px();
  return sigma_px;
}

void add_level_misfits(const v1::Plan& plan, const std::vector<v1::Monitor>& monitors,
                       std::vector<std::string>& out) {
  // Sinusoids determine the place.
  if (!plan.has_square_waves() || plan.has_calibration() || !plan.fringes().empty()) return;
  const int levels = plan.square_waves().levels();
  for (const v1::Monitor& monitor : monitors) {
    const double longer_px = longer_side(monitor), sigma_px = narrowest_sigma(plan);
    const double allowed_px = sigma_px > 0.0 ? 2.0 * sigma_px : longer_px / kFineBars;
    const double finest_px = bar_px(longer_px, levels);
    if (finest_px <= std::max(allowed_px, 1.0)) continue;
    out.push_back(
        fmt::format("square_waves has {} levels: on \"{}\" ({}x{}) the finest bars are {:g} px wide, too "
                    "coarse to tell where a "
                    "pixel looks; levels: {} makes them {:g} px",
                    levels, monitor.name(), monitor.width_px(), monitor.height_px(), finest_px,
                    levels_for(longer_px, allowed_px), bar_px(longer_px, levels_for(longer_px, allowed_px))));
  }
}

// The solver would reject the frames.
void add_orientation_misfits(const v1::Plan& plan, std::vector<std::string>& out) {
  constexpr size_t kMinOrientations = 3;
  if (plan.method() != "gaussian" || plan.has_calibration() || plan.sweeps().empty()) return;
  if (!plan.fringes().empty()) return;  // any mixture in three directions is solved
  std::set<double> orientations;        // a stripe turned by 180 degrees is the same stripe
  for (const v1::Sweep& sweep : plan.sweeps())
    orientations.insert(std::round(1e3 * std::fmod(sweep.orientation_deg() + 360.0, 180.0)));
  if (orientations.size() >= kMinOrientations) return;
  out.push_back(fmt::format(
      "sweeps have {} orientation{}: method gaussian solves at least {}, such as 0, 90 and 45 deg",
      orientations.size(), orientations.size() == 1 ? "" : "s", kMinOrientations));
}

void add_camera_misfits(const v1::Plan& plan, const RigLimits& rig, std::vector<std::string>& out) {
  if (!rig.camera) return;
  std::vector<double> exposures(plan.exposure_ms().begin(), plan.exposure_ms().end());
  if (exposures.empty()) exposures.push_back(kDefaultExposureMs);
  const double refresh_hz = slowest_refresh_hz(rig);
  for (const double exposure_ms : exposures) {
    const double least_ms = rig.camera->min_exposure_ms(), most_ms = rig.camera->max_exposure_ms();
    if (exposure_ms < least_ms || exposure_ms > most_ms) {
      out.push_back(fmt::format("exposure_ms is {:g}; the camera takes {:.4g} to {:.4g} ms", exposure_ms,
                                least_ms, most_ms));
      continue;
    }
    const double needed = needed_ms(*rig.camera, exposure_ms, refresh_hz);
    const double still_ms = refresh_hz > 0.0 ? 1e3 * hold_refreshes_of(plan) / refresh_hz : needed;
    if (needed <= still_ms) continue;
    out.push_back(
        fmt::format("an exposure of {:g} ms needs {:.4g} ms with the camera's readout and frame time; a "
                    "picture stands still for {:.4g} ms: set hold_refreshes to {:.0f}, or expose shorter",
                    exposure_ms, needed, still_ms, std::ceil(needed * refresh_hz / 1e3)));
  }
}

}  // namespace

const std::map<std::string, PlanQuality>& plan_qualities() {
  static const std::map<std::string, PlanQuality> qualities = {
      {"draft", PlanQuality::kDraft}, {"good", PlanQuality::kGood}, {"best", PlanQuality::kBest}};
  return qualities;
}

const std::map<std::string, ObjectKind>& object_kinds() {
  static const std::map<std::string, ObjectKind> kinds = {{"clear", ObjectKind::kClear},
                                                          {"frosted", ObjectKind::kFrosted},
                                                          {"metal", ObjectKind::kMetal},
                                                          {"dark", ObjectKind::kDark}};
  return kinds;
}

absl::Status fit_to_camera(const RigLimits& rig, v1::Plan& plan) {
  return fit_camera({}, rig, plan);
}

int images_of(const v1::Plan& plan, const RigLimits& rig) {
  v1::Plan once = plan;
  once.clear_exposure_ms();
  const absl::StatusOr<std::vector<Step>> steps = expand(once, rig.monitors);
  // More steps than a plan may have.
  if (!steps.ok()) return std::numeric_limits<int>::max();
  return static_cast<int>(std::ranges::count(*steps, true, &Step::object));
}

absl::StatusOr<v1::Plan> make_plan(const PlanWish& wish, const RigLimits& rig) {
  if (rig.monitors.empty())
    return absl::InvalidArgumentError(
        "there is no monitor to make a plan for; name one: --monitor back:1920x1080");
  const double scale = std::sqrt(longest_side(rig) / kUsualSide_px);
  const double sigma_px = kUsualSigma_px * scale * (wish.quality == PlanQuality::kBest ? 0.5 : 1.0) *
                          (wish.object == ObjectKind::kFrosted ? 2.0 : 1.0);
  v1::Plan plan;
  if (wish.images || wish.quality == PlanQuality::kDraft) {
    const int images = wish.images.value_or(kDraftImages * static_cast<int>(rig.monitors.size()));
    GW_ASSIGN_OR_RETURN(plan, plan_of_images(wish.quality, images, rig));
  } else {
    plan = plan_with(wish.quality, rounded(sigma_px), rig);
  }
  if (plan.sweeps(0).sigma_px() < rig.blur_px)
    plan = plan_with(wish.quality, rounded(rig.blur_px + 0.25), rig);
  GW_RETURN_IF_ERROR(fit_camera(wish, rig, plan));
  GW_RETURN_IF_ERROR(check_plan(plan));
  GW_RETURN_IF_ERROR(expand(plan, rig.monitors).status());
  return plan;
}

std::vector<std::string> misfits(const v1::Plan& plan, const RigLimits& rig) {
  std::vector<std::string> out;
  add_level_misfits(plan, common_monitors(plan, rig), out);
  add_orientation_misfits(plan, out);
  const double sigma_px = narrowest_sigma(plan);
  if (sigma_px > 0.0 && sigma_px < rig.blur_px) {
    out.push_back(
        fmt::format("stripes of sigma_px {:g} are narrower than the blur of camera and monitor, {:.3g} px: "
                    "they cost steps and show no finer detail; sigma_px: {:g} suffices",
                    sigma_px, rig.blur_px, rounded(rig.blur_px + 0.25)));
  }
  add_camera_misfits(plan, rig, out);
  return out;
}

int patch_rows_for(const RigLimits& rig) {
  double rows = std::max(double{IdPatch::kMinRows}, 12.0 * rig.blur_px);
  for (const v1::Monitor& monitor : rig.monitors) rows = std::max(rows, monitor.height_px() / 24.0);
  return 2 * static_cast<int>(std::ceil(0.5 * rows));
}

std::string plan_text(const v1::Plan& plan, const RigLimits& rig, std::string_view command) {
  std::vector<std::string> sizes;
  for (const v1::Monitor& monitor : rig.monitors)
    sizes.push_back(fmt::format("{} {}x{}", monitor.name(), monitor.width_px(), monitor.height_px()));
  std::string text =
      fmt::format("# Made by `{}` for {}{}: {} images with the object{}.\n\nmethod: \"{}\"\n", command,
                  fmt::join(sizes, ", "), rig.camera ? " and the rig's camera" : "", images_of(plan, rig),
                  plan.exposure_ms_size() > 1 ? ", at each exposure" : "", plan.method());
  for (const v1::PlanMonitor& monitor : plan.monitors())
    text += fmt::format("monitors {{ name: \"{}\" width_px: {} height_px: {} }}\n", monitor.name(),
                        monitor.width_px(), monitor.height_px());
  if (!plan.sweeps().empty()) text += "\n# Stripes: narrower ones show finer detail and take more steps.\n";
  for (const v1::Sweep& sweep : plan.sweeps()) {
    text += fmt::format(
        "sweeps {{ orientation_deg: {:<3} sigma_px: {} step_px: {}{} }}\n", sweep.orientation_deg(),
        sweep.sigma_px(), sweep.step_px(),
        sweep.has_margin_sigmas() ? fmt::format(" margin_sigmas: {}", sweep.margin_sigmas()) : "");
  }
  if (!plan.fringes().empty())
    text += "\n# Sinusoids: long periods tell the place roughly, short ones exactly.\n";
  for (const v1::Fringes& fringes : plan.fringes()) {
    text += fmt::format("fringes {{ orientation_deg: {:<3} period_px: [{}]{}{} }}\n",
                        fringes.orientation_deg(), fmt::join(fringes.period_px(), ", "),
                        fringes.has_phases() ? fmt::format(" phases: {}", fringes.phases()) : "",
                        fringes.object_only() ? " object_only: true" : "");
  }
  text += plan.sweeps().empty()
              ? "\n# Black, white, and bars, with and without the object: they separate it from the stage.\n"
              : "\n# Black, white, and bars down to a fraction of a stripe, with and without the object.\n";
  for (const v1::Solid& solid : plan.solids())
    text +=
        fmt::format("solids {{ colour: [{}, {}, {}] }}\n", solid.colour(0), solid.colour(1), solid.colour(2));
  const v1::SquareWaves& waves = plan.square_waves();
  text += fmt::format("square_waves {{ {}levels: {}{} }}\n",
                      waves.has_first_level() ? fmt::format("first_level: {} ", waves.first_level()) : "",
                      waves.levels(), waves.without_complements() ? " without_complements: true" : "");
  if (plan.has_white_every())
    text += fmt::format(
        "\n# White again after so many steps, so that the light's drift can be removed.\nwhite_every: {}\n",
        plan.white_every());
  text += rig.camera ? "\n# Exposure, readout and the time to the next frame fit into the time that a "
                       "picture stands still.\n"
                     : "\n# Not checked with a camera: `glasswing plan make --for-rig` does that.\n";
  text += fmt::format("hold_refreshes: {}\nexposure_ms: [{}]\n", plan.hold_refreshes(),
                      fmt::join(plan.exposure_ms(), ", "));
  const bool has_patches =
      std::ranges::all_of(rig.monitors, [](const v1::Monitor& monitor) { return monitor.patch_rows() > 0; });
  if (has_patches) return text;
  return text + fmt::format(
                    "\n# Without an id patch frames are proven by time alone. To show one:\n"
                    "#   glasswing-display --patch-rows {}\n",
                    patch_rows_for(rig));
}

}  // namespace glasswing
