#include "solver/explain_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <memory>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/cli/help.h"
#include "core/footprint/matte_transport.h"
#include "core/image/image_file.h"
#include "core/import/mapped_archive.h"
#include "core/method/methods.h"
#include "solver/gaussian/stack_solver.h"
#include "solver/method/brightness_drift.h"
#include "solver/method/linear_stack.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"

namespace glasswing {
namespace {

struct Explain {
  std::string archive, picture;
  std::vector<std::string> settings;
  int x = 0, y = 0;
};

constexpr double kShown = 4.0;  // standard deviations: samples that are brighter, or further off, are printed

void print_samples(const LaneSamples& lane, const LaneFit& fit, const SweptMonitor& monitor) {
  const double noise = std::max(lane.noise_sd, 1e-9);
  for (const SampleLayout::Sweep& sweep : monitor.samples.sweeps) {
    std::cout << fmt::format("    sweep at {:.1f} deg, sigma {:g} px: r, sample, model, residual in noise\n",
                             std::atan2(sweep.axis.sin_phi, sweep.axis.cos_phi) * 180.0 / M_PI,
                             sweep.axis.sigma_px);
    for (int i = 0; i < sweep.count; ++i) {
      const size_t at = sweep.first + i;
      const double r = sweep.first_r_px + monitor.samples.offset_px[at], y = lane.sweeps.y[at],
                   weight = lane.sweeps.weight[at];
      double model = (fit.fit.floor + lane.black - lane.baseline) * lane.sweeps.floor_answer[at];
      for (const Footprint& mode : fit.fit.modes) model += response(mode, sweep.axis, r, monitor.extent);
      const double off = (y - model) * std::sqrt(weight) / noise;
      if (std::max(y, model) > kShown * noise || std::abs(off) > kShown)
        std::cout << fmt::format("    {:9.2f} {:9.5f} {:9.5f} {:6.1f}\n", r, y, model, off);
    }
  }
}

void print_areas(const LaneSamples& lane, const LaneFit& fit, const SweptMonitor& monitor) {
  if (monitor.areas.empty()) return;
  std::cout << "    white and bars: light, model, residual in noise\n";
  for (size_t a = 0; a < monitor.areas.size(); ++a) {
    const ShownArea& area = monitor.areas[a];
    const std::string name =
        !area.lit.bars ? fmt::format("solid {:g}", area.light)
                       : fmt::format("{} bars of {:g} px{}", area.lit.horizontal ? "horizontal" : "vertical",
                                     area.lit.bar_px, area.lit.inverse ? ", inverse" : "");
    double model = lane.black + fit.fit.floor;
    for (const Footprint& mode : fit.fit.modes)
      model += area.light * mode.weight * LitShare(mode, monitor.extent).of(area.lit).share;
    std::cout << fmt::format("    {:30} {:9.5f} {:9.5f} {:6.1f}\n", name, lane.area[a], model,
                             (lane.area[a] - model) / std::sqrt(std::abs(lane.area_variance[a])));
  }
}

void print_lane(const StackSolver::Explained& lane, const std::vector<SweptMonitor>& monitors,
                const v1::CaptureManifest& manifest) {
  for (size_t m = 0; m < monitors.size(); ++m) {
    const LaneSamples& samples = lane.samples[m];
    const LaneFit& fit = lane.fits[m];
    std::cout << fmt::format("{} on monitor {}: black {:.5f}, without stripes {:.5f}, noise {:.5f}\n",
                             kChannelNames[lane.channel], manifest.monitors(monitors[m].texture).name(),
                             samples.black, samples.baseline, samples.noise_sd);
    print_samples(samples, fit, monitors[m]);
    print_areas(samples, fit, monitors[m]);
    for (size_t s = 0; s < samples.peaks.size(); ++s) {
      for (const Peak& peak : samples.peaks[s].all())
        std::cout << fmt::format("  peak of sweep {}: {:.5f} at {:.2f} px, sigma {:.2f} px\n", s,
                                 peak.amplitude, peak.centre_px, peak.sigma_px);
    }
    for (const std::string& text : lane.notes[m]) std::cout << "  " << text << "\n";
    const double poor = unexplained(fit, samples.noise_sd, monitors[m].samples);
    std::cout << fmt::format(
        "  F {:.5f}, {} modes; white has {:+.5f} +- {:.5f} beyond them{}{}\n", samples.black + fit.fit.floor,
        fit.fit.modes.size(), fit.beyond.rest, std::sqrt(fit.beyond.variance),
        contradicts_white(fit.beyond) ? ": poor fit" : "",
        poor > 0.0 ? fmt::format("; samples are off by {:.1f} % of the highest: poor fit", 100.0 * poor)
                   : "");
  }
}

// What the matte holds of one channel's light from one monitor, and why.
std::string choice_text(const Matte& matte, int x, int channel, int texture) {
  double light = 0.0;
  int modes = 0;
  for (const Mode& mode : matte.modes(x, 0, channel)) {
    if (mode.texture != texture || !(mode.weight > 0.0f)) continue;
    light += static_cast<double>(mode.weight);
    ++modes;
  }
  const std::span<const PyramidFootprint> all = matte.pyramids(x, 0, channel);
  const auto own = std::ranges::find(all, texture, &PyramidFootprint::texture);
  if (own == all.end()) {
    return fmt::format("Gaussians: {} modes with a light of {:.5f}; {}", modes, light,
                       (matte.flags(x, 0) & kFlagPoorFit) != 0
                           ? "the pixel is a poor fit, which no pyramid explains better"
                           : "the samples do not speak for a pyramid");
  }
  std::array<int, kPyramidLevels> counts{};
  double in_pyramid = 0.0, kept = 0.0;
  for (const Coefficient& coefficient : own->coefficients) {
    const bool is_mode = coefficient.level >= kPyramidLevels;
    (is_mode ? kept : in_pyramid) += static_cast<double>(coefficient.weight);
    if (!is_mode) ++counts[static_cast<size_t>(coefficient.level)];
  }
  return fmt::format(
      "pyramid: {} coefficients ({} of sigma 1, 2, 4, 8, 16 px) with {:.1f} % of a light of {:.5f}; the "
      "other {:.1f} % stay in {} Gaussians; F {:+.5f}",
      std::accumulate(counts.begin(), counts.end(), 0), fmt::join(counts, ", "),
      100.0 * in_pyramid / (in_pyramid + kept), in_pyramid + kept, 100.0 * kept / (in_pyramid + kept), modes,
      own->foreground);
}

// The pixel as the matte has it: solves its row.
absl::Status explain_matte(const Explain& arguments, const MappedArchive& archive) {
  MethodOptions options;
  for (const std::string& setting : arguments.settings) {
    GW_ASSIGN_OR_RETURN(const auto option, parse_setting(setting));
    options[option.first] = option.second;
  }
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Method> method, make_method("gaussian", options));
  GW_ASSIGN_OR_RETURN(const Matte matte, solve_archive(*method, archive, 0, nullptr, true,
                                                       RowRange{.first = arguments.y, .count = 1}));
  const int x = arguments.x;
  std::vector<double> light(matte.metadata.monitors_size());
  std::cout << "in the matte:\n";
  for (int c = 0; c < kChannels; ++c) {
    for (int t = 0; t < matte.metadata.monitors_size(); ++t) {
      double own = 0.0;
      for (const Mode& mode : matte.gaussians(x, 0, c)) own += mode.texture == t ? mode.weight : 0.0f;
      if (!(own > 0.0)) continue;
      light[t] += own;
      std::cout << fmt::format("{} on monitor {}: {}\n", kChannelNames[c], matte.metadata.monitors(t).name(),
                               choice_text(matte, x, c, t));
    }
  }
  if (arguments.picture.empty()) return absl::OkStatus();
  const auto brightest = static_cast<int>(std::ranges::max_element(light) - light.begin());
  RadianceImage picture = footprint_picture(matte, x, 0, brightest);
  const float most = std::ranges::max(picture.samples);
  if (!(most > 0.0f)) {
    return absl::FailedPreconditionError(
        fmt::format("pixel {}, {} sees no monitor, so {} is not written", x, arguments.y, arguments.picture));
  }
  for (float& sample : picture.samples) sample /= most;
  GW_RETURN_IF_ERROR(write_radiance(arguments.picture, picture, Encoding::kDisplay));
  std::cout << fmt::format("{}: its footprint on monitor {}, the brightest place white\n", arguments.picture,
                           matte.metadata.monitors(brightest).name());
  return absl::OkStatus();
}

absl::Status explain(const Explain& arguments) {
  GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open(arguments.archive));
  const v1::CaptureManifest& manifest = archive->manifest();
  const int width = manifest.camera().width_px(), height = manifest.camera().height_px();
  if (arguments.x < 0 || arguments.x >= width || arguments.y < 0 || arguments.y >= height) {
    return absl::InvalidArgumentError(
        fmt::format("pixel {}, {} is outside the picture of {}x{}", arguments.x, arguments.y, width, height));
  }
  const auto read_row = [&](int row,
                            const std::vector<int>& frames) -> absl::StatusOr<std::vector<std::uint16_t>> {
    std::vector<std::uint16_t> samples;
    for (const int frame : frames) {
      GW_ASSIGN_OR_RETURN(const FrameSamples own, archive->read(frame, row, 1));
      samples.insert(samples.end(), own.samples.begin(), own.samples.end());
    }
    return samples;
  };
  GW_ASSIGN_OR_RETURN(const LinearStack linear, LinearStack::create(manifest));
  const v1::CaptureManifest of_light = linear.manifest_of_light(manifest);
  GW_ASSIGN_OR_RETURN(const StackLayout layout, lay_out(of_light));
  FrameStack stack{.width_px = width,
                   .first_row = arguments.y,
                   .row_count = 1,
                   .rows = {},
                   .owner = nullptr,
                   .mosaic = mosaic_of(manifest.camera())};
  GW_ASSIGN_OR_RETURN(stack.brightness, measure_brightness_drift(manifest, read_row));
  stack.rows.resize(manifest.frames_size());
  const auto owner = std::make_shared<std::vector<FrameSamples>>();
  for (const int frame : frames_of(layout)) {
    GW_ASSIGN_OR_RETURN(FrameSamples row, archive->read(frame, arguments.y, 1));
    stack.rows[frame] = row.samples;
    owner->push_back(std::move(row));
  }
  stack.owner = owner;
  stack = linear.of(std::move(stack));
  GW_ASSIGN_OR_RETURN(const OptionValues values, OptionValues::read("gaussian", {}));
  const std::vector<SweptMonitor> monitors = swept_monitors(layout);
  StackSolver solver(stack, layout, monitors, kMaxFootprints, values.number("silhouette_tolerance"));
  const std::vector<StackSolver::Explained> lanes = solver.explain(arguments.x, 0);
  if (lanes.empty())
    std::cout << fmt::format("pixel {}, {}: the object changes nothing here\n", arguments.x, arguments.y);
  for (const StackSolver::Explained& lane : lanes) print_lane(lane, monitors, manifest);
  return arguments.settings.empty() && arguments.picture.empty() ? absl::OkStatus()
                                                                 : explain_matte(arguments, *archive);
}

}  // namespace

void add_explain_command(CLI::App& app, DaemonOptions& daemon) {
  const auto arguments = std::make_shared<Explain>();
  CLI::App& command = add_command(app, daemon, "explain",
                                  "Print how method gaussian solves one pixel: samples, candidates, modes",
                                  [arguments]() -> absl::StatusOr<int> {
                                    GW_RETURN_IF_ERROR(explain(*arguments));
                                    return 0;
                                  });
  command.footer(
      "With --set footprints=any it says for each channel whether the matte has Gaussians or a pyramid "
      "(docs/footprints.md), of how many coefficients, and how much light they have.\n\n"
      "Examples:\n"
      "  glasswing-solver explain out/archives/crystal 64 52\n"
      "  glasswing-solver explain out/archives/vase 64 52 --set footprints=any --picture footprint.png");
  command.add_option("archive", arguments->archive, "folder with manifest.json")->required();
  command.add_option("x", arguments->x, "column of the camera's picture, from 0")->required();
  command.add_option("y", arguments->y, "row, from 0")->required();
  command.add_option("--set", arguments->settings,
                     "solve the pixel's row with this option, NAME=VALUE, and say what the matte has");
  command.add_option(
      "--picture", arguments->picture,
      "write where on the monitor that gives it most light the pixel's light comes from (PNG)");
}

}  // namespace glasswing
