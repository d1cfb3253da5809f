#include "solver/gaussian/stack_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>

namespace glasswing {
namespace {

int texture_of(const v1::CaptureManifest& manifest, const std::string& panel) {
  for (int i = 0; i < manifest.monitors_size(); ++i) {
    if (manifest.monitors(i).name() == panel) return i;
  }
  return -1;
}

double colour_of(const v1::Stimulus& stimulus, int channel) {
  return stimulus.colour_size() == 3 ? stimulus.colour(channel) : 1.0;
}

bool is_solid(const v1::Stimulus& stimulus, double value) {
  if (stimulus.kind() != "solid") return false;
  for (int c = 0; c < 3; ++c) {
    if (colour_of(stimulus, c) != value) return false;
  }
  return true;
}

struct Sample {
  int frame;
  double r_px;
  std::array<double, 3> peak;
};

absl::Status check_sweeps(const StackLayout& layout, const v1::CaptureManifest& manifest) {
  if (layout.sweeps.empty()) {
    return absl::FailedPreconditionError(
        "the archive has no stripe sweeps (kind gauss_stripe, with the object)");
  }
  std::map<int, std::set<double>> orientations;
  std::map<int, double> sigma_px;
  for (const SweepLayout& sweep : layout.sweeps) {
    const std::string& monitor = manifest.monitors(sweep.texture).name();
    if (sweep.frames.size() < 5) {
      return absl::FailedPreconditionError(
          fmt::format("the sweep at {} deg on monitor \"{}\" has {} steps; at least 5 are needed",
                      sweep.phi_deg, monitor, sweep.frames.size()));
    }
    const double first_sigma_px = sigma_px.emplace(sweep.texture, sweep.sigma_px).first->second;
    if (sweep.sigma_px != first_sigma_px) {
      return absl::FailedPreconditionError(fmt::format(
          "monitor \"{}\" was swept with stripes of {} and {} px; this version solves from one width",
          monitor, first_sigma_px, sweep.sigma_px));
    }
    // A stripe turned by 180 degrees is the same stripe.
    orientations[sweep.texture].insert(std::round(std::fmod(sweep.phi_deg + 360.0, 180.0) * 1000.0));
  }
  for (const auto& [texture, angles] : orientations) {
    if (angles.size() < 3) {
      return absl::FailedPreconditionError(fmt::format(
          "monitor \"{}\" was swept in {} orientations; an oriented footprint needs at least 3, such as 0, "
          "90 and 45 deg",
          manifest.monitors(texture).name(), angles.size()));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<StackLayout> lay_out(const v1::CaptureManifest& manifest) {
  StackLayout layout;
  std::map<std::tuple<int, double, double>, std::vector<Sample>> sweeps;  // by texture, phi, sigma
  std::map<std::string, int> empty_frames;                                // by serialised stimulus
  std::set<double> exposures_ms;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    if (stimulus.reference() || frame.also_lit_size() > 0) continue;
    const bool pattern = stimulus.kind() == "solid" || stimulus.kind() == "square";
    if (pattern || stimulus.kind() == "gauss_stripe") exposures_ms.insert(frame.exposure_ms());
    if (pattern && !frame.object()) {
      empty_frames.emplace(stimulus.SerializeAsString(), i);
      if (is_solid(stimulus, 0.0) && layout.empty_black < 0) layout.empty_black = i;
      const bool first_monitor = texture_of(manifest, stimulus.panel()) == 0;
      if (is_solid(stimulus, 1.0) && first_monitor && layout.empty_white < 0) layout.empty_white = i;
    }
    if (frame.object() && is_solid(stimulus, 0.0) && layout.black < 0) layout.black = i;
    if (!frame.object() || stimulus.kind() != "gauss_stripe") continue;
    const int texture = texture_of(manifest, stimulus.panel());
    if (texture < 0) {
      return absl::FailedPreconditionError(fmt::format(
          "{} names monitor \"{}\", which the manifest does not list", frame.file(), stimulus.panel()));
    }
    if (!(stimulus.sigma_px() > 0.0) || !(stimulus.peak() > 0.0) || !std::isfinite(stimulus.r_px())) {
      return absl::FailedPreconditionError(
          fmt::format("{} shows a stripe without sigma_px, peak or r_px", frame.file()));
    }
    Sample sample{.frame = i, .r_px = stimulus.r_px(), .peak = {}};
    for (int c = 0; c < 3; ++c)
      sample.peak[static_cast<size_t>(c)] = stimulus.peak() * colour_of(stimulus, c);
    sweeps[{texture, stimulus.phi_deg(), stimulus.sigma_px()}].push_back(sample);
  }
  if (exposures_ms.size() > 1) {
    return absl::FailedPreconditionError(
        fmt::format("the frames have {} exposures, from {} to {} ms; this version solves from one",
                    exposures_ms.size(), *exposures_ms.begin(), *exposures_ms.rbegin()));
  }
  for (auto& [key, samples] : sweeps) {
    std::sort(samples.begin(), samples.end(),
              [](const Sample& a, const Sample& b) { return a.r_px < b.r_px; });
    SweepLayout sweep;
    std::tie(sweep.texture, sweep.phi_deg, sweep.sigma_px) = key;
    sweep.cos_phi = std::cos(sweep.phi_deg * std::numbers::pi / 180.0);
    sweep.sin_phi = std::sin(sweep.phi_deg * std::numbers::pi / 180.0);
    for (const Sample& sample : samples) {
      sweep.frames.push_back(sample.frame);
      sweep.r_px.push_back(sample.r_px);
      sweep.peak.push_back(sample.peak);
    }
    layout.sweeps.push_back(std::move(sweep));
  }
  if (layout.black < 0) {
    return absl::FailedPreconditionError(
        "the archive has no frame of the object before black (kind solid, colour 0 0 0)");
  }
  if (absl::Status status = check_sweeps(layout, manifest); !status.ok()) return status;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (!frame.object() || frame.stimulus().reference() || frame.also_lit_size() > 0) continue;
    const auto empty = empty_frames.find(frame.stimulus().SerializeAsString());
    if (empty != empty_frames.end()) layout.pairs.push_back({.object = i, .empty = empty->second});
  }
  return layout;
}

}  // namespace glasswing
