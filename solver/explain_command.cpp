#include "solver/explain_command.h"

#include <fmt/format.h>

#include <cmath>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/cli/help.h"
#include "core/import/mapped_archive.h"
#include "core/method/methods.h"
#include "solver/gaussian/stack_solver.h"
#include "solver/method/brightness_drift.h"
#include "solver/method/linear_stack.h"

namespace glasswing {
namespace {

struct Explain {
  std::string archive;
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

absl::Status explain(const Explain& arguments) {
  GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open(arguments.archive));
  const v1::CaptureManifest& manifest = archive->manifest();
  const int width = manifest.camera().width_px(), height = manifest.camera().height_px();
  if (arguments.x < 0 || arguments.x >= width || arguments.y < 0 || arguments.y >= height) {
    return absl::InvalidArgumentError(fmt::format("pixel {}, {} lies outside the picture of {}x{}",
                                                  arguments.x, arguments.y, width, height));
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
  return absl::OkStatus();
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
  command.footer("Example:\n  glasswing-solver explain out/archives/crystal 64 52");
  command.add_option("archive", arguments->archive, "folder with manifest.json")->required();
  command.add_option("x", arguments->x, "column of the camera's picture, from 0")->required();
  command.add_option("y", arguments->y, "row, from 0")->required();
}

}  // namespace glasswing
