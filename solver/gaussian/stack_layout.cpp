#include "solver/gaussian/stack_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>

#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

struct Sample {
  ExposedFrame frame;
  double r_px;
  std::array<double, 3> peak;
};

std::vector<std::vector<AreaFrames>> areas_of(const v1::CaptureManifest& manifest,
                                              const Exposures& exposures) {
  using Key = std::tuple<int, bool, bool, double, double, bool, double>;
  std::map<Key, AreaFrames> areas;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    if (!is_pattern(frame) || !frame.object()) continue;
    const bool bars = kind_of(stimulus) == StimulusKind::kSquare;
    const double light = gray_of(stimulus);
    const int texture = texture_of(manifest, stimulus.panel());
    if ((!bars && kind_of(stimulus) != StimulusKind::kSolid) || !(light > 0.0) || texture < 0) continue;
    LitArea lit{.bars = bars};
    if (bars) {
      lit = {.bars = true,
             .horizontal = stimulus.orient() == "horizontal_bars",
             .bar_px = stimulus.bar_width_px(),
             .offset_px = stimulus.offset_px(),
             .inverse = stimulus.inverse()};
      // Other bars have edges within pixels.
      if (!(lit.bar_px >= 1.0) || lit.bar_px != std::round(lit.bar_px) ||
          lit.offset_px != std::round(lit.offset_px))
        continue;
    }
    AreaFrames& area = areas[{texture, bars, lit.horizontal, lit.bar_px, lit.offset_px, lit.inverse, -light}];
    area.lit = lit;
    area.light = light;
    area.shot.push_back(exposures.exposed(manifest, i));
  }
  std::vector<std::vector<AreaFrames>> by_texture(manifest.monitors_size());
  for (auto& [key, area] : areas) by_texture[std::get<0>(key)].push_back(std::move(area));
  return by_texture;
}

absl::Status check_sweeps(const StackLayout& layout, const v1::CaptureManifest& manifest) {
  if (layout.sweeps.empty()) {
    return absl::FailedPreconditionError(
        "the archive has no stripe sweeps (kind gauss_stripe, with the object)");
  }
  std::map<int, std::multiset<double>> orientations;
  for (const SweepLayout& sweep : layout.sweeps) {
    const std::string& monitor = manifest.monitors(sweep.texture).name();
    if (sweep.shots.size() < 5) {
      return absl::FailedPreconditionError(
          fmt::format("the sweep at {} deg on monitor \"{}\" has {} steps; at least 5 are needed",
                      sweep.phi_deg, monitor, sweep.shots.size()));
    }
    if (orientations[sweep.texture].size() >= 16) {
      return absl::FailedPreconditionError(
          fmt::format("monitor \"{}\" was swept more than 16 times; at most 16 can be solved", monitor));
    }
    // A stripe turned by 180 degrees is the same stripe.
    orientations[sweep.texture].insert(std::round(std::fmod(sweep.phi_deg + 360.0, 180.0) * 1000.0));
  }
  for (const auto& [texture, angles] : orientations) {
    const std::set<double> distinct(angles.begin(), angles.end());
    if (distinct.size() < 3) {
      return absl::FailedPreconditionError(fmt::format(
          "monitor \"{}\" was swept in {} orientations; an oriented footprint needs at least 3, such as 0, "
          "90 and 45 deg",
          manifest.monitors(texture).name(), distinct.size()));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<StackLayout> lay_out(const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(manifest));
  StackLayout layout;
  std::map<std::tuple<int, double, double>, std::vector<Sample>> sweeps;  // by texture, phi, sigma
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    if (!is_pattern(frame) || !frame.object() || kind_of(stimulus) != StimulusKind::kStripe) continue;
    const int texture = texture_of(manifest, stimulus.panel());
    if (texture < 0) {
      return absl::FailedPreconditionError(fmt::format(
          "{} names monitor \"{}\", which the manifest does not list", frame.file(), stimulus.panel()));
    }
    const auto in = [](double value, double low, double high) { return value > low && value <= high; };
    if (!in(stimulus.sigma_px(), 0.0, 1000.0) || !in(stimulus.peak(), 0.0, 1.0) ||
        !in(stimulus.r_px(), -1e5, 1e5) || !in(stimulus.phi_deg(), -1e4, 1e4)) {
      return absl::FailedPreconditionError(fmt::format(
          "{} shows a stripe of sigma {} px, peak {}, at {} px, {} deg; accepted are (0, 1000], (0, 1], "
          "+-100000 and +-10000",
          frame.file(), stimulus.sigma_px(), stimulus.peak(), stimulus.r_px(), stimulus.phi_deg()));
    }
    Sample sample{.frame = exposures.exposed(manifest, i), .r_px = stimulus.r_px(), .peak = {}};
    for (int c = 0; c < 3; ++c) sample.peak[c] = stimulus.peak() * colour_of(stimulus, c);
    sweeps[{texture, stimulus.phi_deg(), stimulus.sigma_px()}].push_back(sample);
  }
  for (auto& [key, samples] : sweeps) {
    std::sort(samples.begin(), samples.end(),
              [](const Sample& a, const Sample& b) { return a.r_px < b.r_px; });
    SweepLayout sweep;
    std::tie(sweep.texture, sweep.phi_deg, sweep.sigma_px) = key;
    sweep.cos_phi = std::cos(sweep.phi_deg * std::numbers::pi / 180.0);
    sweep.sin_phi = std::sin(sweep.phi_deg * std::numbers::pi / 180.0);
    for (const Sample& sample : samples) {
      if (!sweep.r_px.empty() && sample.r_px - sweep.r_px.back() < 1e-6) {
        if (sample.peak != sweep.peak.back()) {
          return absl::FailedPreconditionError(
              fmt::format("{} shows a stripe at the position of another that was brighter or darker",
                          manifest.frames(sample.frame.frame).file()));
        }
        sweep.shots.back().push_back(sample.frame);
        layout.one_frame_a_shot = false;
        continue;
      }
      sweep.shots.push_back({sample.frame});
      sweep.r_px.push_back(sample.r_px);
      sweep.peak.push_back(sample.peak);
    }
    layout.sweeps.push_back(std::move(sweep));
  }
  layout.areas = areas_of(manifest, exposures);
  layout.stage = lay_out_stage(manifest, exposures);
  layout.wave_noise = WaveNoise(manifest);
  GW_RETURN_IF_ERROR(check_black(layout.stage));
  GW_RETURN_IF_ERROR(check_sweeps(layout, manifest));
  return layout;
}

std::vector<int> frames_of(const StackLayout& layout) {
  const std::vector<int> stage = frames_of(layout.stage);
  std::set<int> frames(stage.begin(), stage.end());
  for (const int frame : layout.wave_noise.frames()) frames.insert(frame);
  const auto need = [&](const Shot& shot) {
    for (const ExposedFrame& exposed : shot) frames.insert(exposed.frame);
  };
  for (const SweepLayout& sweep : layout.sweeps) std::ranges::for_each(sweep.shots, need);
  for (const std::vector<AreaFrames>& areas : layout.areas) {
    for (const AreaFrames& area : areas) need(area.shot);
  }
  return {frames.begin(), frames.end()};
}

}  // namespace glasswing
