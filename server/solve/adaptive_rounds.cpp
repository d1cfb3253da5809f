#include "server/solve/adaptive_rounds.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "core/base/pause.h"
#include "core/base/positioned_file.h"
#include "core/base/status.h"
#include "core/design/next_round.h"
#include "core/design/plan_design.h"
#include "core/frame/archive.h"
#include "core/matte/packed_matte.h"
#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
#include "server/archives/session_archive.h"

namespace glasswing {
namespace {

constexpr std::chrono::milliseconds kPoll(50);
constexpr int kLooked = 20'000;        // pixels of the draft, of which the object's are taken
constexpr int kJudged = 500;           // of the object's
constexpr size_t kDesigned = 64;       // of those that are not known well enough
constexpr double kShare = 0.95;        // of the object's pixels
constexpr int kLeastWaves = 6;         // of a round
constexpr double kUsualNoise = 0.005;  // of a camera that is not calibrated: a solve's errors tell the rest

// What a solve knows of one pixel's strongest channel, by texture.
using JudgedPixel = std::vector<KnownPixel>;

double light_of(std::span<const Mode> modes) {
  double light = 0.0;
  for (const Mode& mode : modes) light += mode.weight;
  return light;
}

JudgedPixel judged_pixel(const Matte& matte, int x, int y, size_t monitors) {
  int strongest = 0;
  const int channels = matte.is_colourless() ? 1 : kChannels;
  for (int c = 1; c < channels; ++c) {
    if (light_of(matte.modes(x, y, c)) > light_of(matte.modes(x, y, strongest))) strongest = c;
  }
  JudgedPixel pixel(monitors);
  // In order of weight.
  for (const Mode& mode : matte.modes(x, y, strongest)) {
    if (!(mode.weight > 0.0f) || static_cast<size_t>(mode.texture) >= monitors) continue;
    KnownPixel& known = pixel[static_cast<size_t>(mode.texture)];
    if (known.modes.size() == kMaxFootprints) continue;
    const auto at = static_cast<size_t>(known.modes.size());
    known.weight_sd[at] = mode.weight_sd;
    known.centre_sd_px[at] = mode.centre_sd_px;
    known.modes.push_back({.weight = mode.weight,
                           .x_px = mode.x_px,
                           .y_px = mode.y_px,
                           .xx_px2 = mode.xx_px2,
                           .xy_px2 = mode.xy_px2,
                           .yy_px2 = mode.yy_px2});
  }
  return pixel;
}

// Of the object, evenly.
absl::StatusOr<std::vector<JudgedPixel>> read_pixels(const std::filesystem::path& path, size_t monitors) {
  GW_ASSIGN_OR_RETURN(const PositionedFile file, PositionedFile::open(path));
  GW_ASSIGN_OR_RETURN(const PackedMatteReader reader, PackedMatteReader::open(file));
  const int width = reader.outline().width_px, height = reader.outline().height_px;
  const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(width) * height / kLooked)));
  std::vector<JudgedPixel> pixels;
  GW_RETURN_IF_ERROR(reader.for_rows(
      step / 2, (height - step / 2 + step - 1) / step,
      [&](const Matte& rows) {
        for (int y = 0; y < rows.height_px(); ++y) {
          for (int x = step / 2; x < width; x += step) {
            JudgedPixel pixel = judged_pixel(rows, x, y, monitors);
            const bool seen =
                std::ranges::any_of(pixel, [](const KnownPixel& on) { return !on.modes.empty(); });
            if (rows.coverage(x, y) > 0.0f && seen) pixels.push_back(std::move(pixel));
          }
        }
        return absl::OkStatus();
      },
      step));
  if (pixels.size() <= kJudged) return pixels;
  std::vector<JudgedPixel> some;
  for (size_t i = 0; i < kJudged; ++i) some.push_back(std::move(pixels[i * pixels.size() / kJudged]));
  return some;
}

RoundTarget target_of(const v1::Adapt& adapt) {
  if (adapt.has_target_px()) return {.kind = RoundTarget::Kind::kCentre, .error = adapt.target_px()};
  const double db = adapt.has_target_db() ? adapt.target_db() : kDefaultTargetDb;
  return {.kind = RoundTarget::Kind::kComposite, .error = std::pow(10.0, -db / 20.0)};
}

CameraNoise noise_of(const v1::Camera& camera) {
  CameraNoise noise{.read_sd = camera.read_sd() > 0.0 ? camera.read_sd() : kUsualNoise, .full_well = {}};
  if (camera.gain() > 0.0) noise.full_well = 1.0 / camera.gain();
  return noise;
}

// Patch learning and photos do not count.
int images_of(const std::vector<Step>& steps) {
  return static_cast<int>(std::ranges::count_if(steps, [](const Step& step) {
    const StimulusKind kind = kind_of(step.stimulus);
    return kind != StimulusKind::kPatch && kind != StimulusKind::kPhoto;
  }));
}

// What this share of all is not above.
double quantile(std::vector<double> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::ranges::nth_element(values, at);
  return *at;
}

v1::Round round_of(std::vector<DesignedWave> waves, const std::string& why) {
  std::ranges::sort(waves, [](const DesignedWave& a, const DesignedWave& b) {
    return a.phi_deg != b.phi_deg ? a.phi_deg < b.phi_deg : a.period_px > b.period_px;
  });
  v1::Round round;
  for (const DesignedWave& wave : waves) {
    if (round.fringes().empty() || round.fringes().rbegin()->orientation_deg() != wave.phi_deg) {
      v1::Fringes& fringes = *round.add_fringes();
      fringes.set_orientation_deg(wave.phi_deg);
      fringes.set_phases(2);
      fringes.set_object_only(true);
    }
    round.mutable_fringes()->rbegin()->add_period_px(wave.period_px);
  }
  round.set_why(why);
  return round;
}

}  // namespace

absl::Status AdaptiveRounds::wait_for_draft(const v1::Session& session, std::stop_token stop) {
  for (int polls = 0;; ++polls) {
    const std::optional<v1::Draft> draft = drafts_.of(session);
    if (draft && draft->image_count() == session.step_count()) return absl::OkStatus();
    GW_RETURN_IF_ERROR(drafts_.failure(session.name(), session.step_count()));
    // A node that was away is asked again.
    if (polls % 20 == 0) drafts_.look_at(session.name());
    if (!pause(stop, kPoll)) return absl::CancelledError("stopped");
  }
}

absl::StatusOr<v1::Session> AdaptiveRounds::grow(v1::Session session, std::stop_token stop) {
  GW_RETURN_IF_ERROR(wait_for_draft(session, stop));
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, SessionArchive(session).manifest());
  const std::vector<v1::Monitor> monitors(manifest.monitors().begin(), manifest.monitors().end());
  GW_ASSIGN_OR_RETURN(std::vector<JudgedPixel> pixels,
                      read_pixels(mattes_.draft(session.name()), monitors.size()));
  if (pixels.empty())
    return absl::FailedPreconditionError(
        "the draft shows no object, so that nothing tells what to show next");
  GW_ASSIGN_OR_RETURN(const std::vector<Step> steps, expand(session.plan(), monitors));
  const v1::Adapt& adapt = session.plan().adapt();
  const RoundTarget target = target_of(adapt);
  const CameraNoise noise = noise_of(manifest.camera());

  // By pixel, over all monitors; and where its worst place is.
  std::vector<double> composite(pixels.size(), 0.0), centre_px(pixels.size(), 0.0);
  std::vector<double> worst(pixels.size(), 0.0);
  std::vector<size_t> worst_monitor(pixels.size(), 0);
  std::vector<PatternAnswers> shown;
  for (size_t m = 0; m < monitors.size(); ++m) {
    GW_ASSIGN_OR_RETURN(std::vector<ShownPattern> patterns, shown_by(session.plan(), monitors[m]));
    shown.emplace_back(std::move(patterns),
                       MonitorExtent{.width_px = static_cast<double>(monitors[m].width_px()),
                                     .height_px = static_cast<double>(monitors[m].height_px())});
    std::vector<size_t> index;
    std::vector<KnownPixel> here;
    for (size_t p = 0; p < pixels.size(); ++p) {
      if (pixels[p][m].modes.empty()) continue;
      index.push_back(p);
      here.push_back(pixels[p][m]);
    }
    find_excess(shown.back(), here, noise);
    const std::vector<PixelError> errors = errors_of(shown.back(), here, noise);
    for (size_t i = 0; i < index.size(); ++i) {
      const size_t p = index[i];
      pixels[p][m].excess = here[i].excess;
      composite[p] = std::hypot(composite[p], errors[i].composite);
      centre_px[p] = std::max(centre_px[p], errors[i].centre_px);
      if (errors[i].of(target.kind) >= worst[p]) {
        worst[p] = errors[i].of(target.kind);
        worst_monitor[p] = m;
      }
    }
  }
  const std::vector<double>& judged = target.kind == RoundTarget::Kind::kCentre ? centre_px : composite;
  const double known = static_cast<double>(std::ranges::count_if(
                           judged, [&](double error) { return error <= target.error; })) /
                       static_cast<double>(judged.size());
  const int images = images_of(steps);
  const bool again = !session.adapted().empty() && session.adapted().rbegin()->image_count() == images;
  v1::AdaptedRound& found = again ? *session.mutable_adapted()->rbegin() : *session.add_adapted();
  found.set_image_count(images);
  found.set_known_share(known);
  // Infinite where more than a twentieth is not known at all.
  found.set_error_db(-20.0 * std::log10(std::clamp(quantile(composite, kShare), 1e-6, 1.0)));
  found.set_error_px(std::min(quantile(centre_px, kShare), static_cast<double>(kMaxSide_px)));
  const int at_most = adapt.has_at_most() ? adapt.at_most() : kDefaultAtMost;
  spdlog::info("adapted session={} images={} known={:.3f} error_db={:.1f} error_px={:.3f}", session.name(),
               images, known, found.error_db(), found.error_px());
  if (known >= kShare) return session;

  // The monitor that holds most of what is uncertain is designed for.
  std::vector<int> bad(monitors.size(), 0);
  for (size_t p = 0; p < pixels.size(); ++p) bad[worst_monitor[p]] += judged[p] > target.error ? 1 : 0;
  const auto monitor = static_cast<size_t>(std::ranges::max_element(bad) - bad.begin());
  std::vector<KnownPixel> uncertain;
  for (size_t p = 0; p < pixels.size(); ++p) {
    if (judged[p] > target.error && worst_monitor[p] == monitor) uncertain.push_back(pixels[p][monitor]);
  }
  if (uncertain.size() > kDesigned) {
    std::vector<KnownPixel> some;
    for (size_t i = 0; i < kDesigned; ++i) some.push_back(uncertain[i * uncertain.size() / kDesigned]);
    uncertain = std::move(some);
  }
  const int used =
      session.plan().monitors().empty() ? static_cast<int>(monitors.size()) : session.plan().monitors_size();
  const int exposures = std::max(session.plan().exposure_ms_size(), 1);
  const int each = 2 * used * exposures;  // images of a wave
  // Twice the images tell 3 dB more; further ahead a draft's errors say little.
  const int most = std::min(at_most - images, std::max(images, 2 * kLeastWaves * used * exposures)) / each;
  if (most <= 0) return session;
  const std::vector<DesignedWave> waves =
      choose_waves(shown[monitor], uncertain, noise, target, std::min(kLeastWaves, most), most);
  const std::string asked = target.kind == RoundTarget::Kind::kCentre
                                ? fmt::format("{:g} px", target.error)
                                : fmt::format("{:g} dB", -20.0 * std::log10(target.error));
  *session.mutable_plan()->add_rounds() = round_of(
      waves,
      fmt::format("{:.0f} % of the object's pixels were known to {} after {} images, {:.0f} % are asked "
                  "for; 95 % to {:.1f} dB and {:.3f} px",
                  100.0 * known, asked, images, 100.0 * kShare, found.error_db(), found.error_px()));
  return session;
}

}  // namespace glasswing
