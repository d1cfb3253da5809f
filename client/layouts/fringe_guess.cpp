#include "client/layouts/fringe_guess.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>

#include "core/base/median.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kMaxTurn_rad = 1.5;  // above it noise and slopes reach half a turn
constexpr double kPeriodTolerance = 0.06;
constexpr double kSamePhase = 0.7;  // length of the mean of unit vectors
constexpr double kSameFirstPhase_deg = 30.0;
constexpr double kMaxClearDensity = 0.1;  // edges a pixel

std::string numbers(const std::vector<double>& values) {
  return fmt::format("{:.2f}", fmt::join(values, " : "));
}

// The fringes of one axis, with the bars beside them.
struct Axis {
  LayoutSpan span;
  int bits = 0;  // of the code; 0: no bars
  std::vector<PatternView::Fringe> waves;
  int side_px = 0;
  const char* name = "x";

  double turn_rad(size_t wave) const { return waves[wave].turn_rad[span.axis()]; }
  // As multiples of the lowest frequency.
  std::vector<double> ratios() const {
    std::vector<double> ratios;
    for (size_t w = 0; w < waves.size(); ++w) ratios.push_back(std::abs(turn_rad(w)));
    const double lowest = *std::ranges::min_element(ratios);
    for (double& ratio : ratios) ratio /= std::max(lowest, 1e-9);
    return ratios;
  }
  // 1: the phase rises along the pictures' axis; -1: it falls.
  int sign() const {
    double sum = 0.0;
    for (size_t w = 0; w < waves.size(); ++w) sum += std::abs(turn_rad(w)) < kMaxTurn_rad ? turn_rad(w) : 0.0;
    return sum < 0.0 ? -1 : 1;
  }
};

absl::Status check_periods(const Axis& axis, const std::vector<FringePeriod>& given_periods) {
  const std::vector<double> ratios = axis.ratios();
  if (given_periods.size() != ratios.size()) {
    return absl::InvalidArgumentError(fmt::format(
        "{}; along {} their frequencies are in the ratio {}: pass --periods with the number of fringes along "
        "a side of the monitor for each, or their lengths, in this order",
        given_periods.empty() ? "the fringes' length cannot be determined"
                              : fmt::format("--periods names {} fringes, the photographs show {}",
                                            given_periods.size(), ratios.size()),
        axis.name, numbers(ratios)));
  }
  std::vector<double> given;
  for (const FringePeriod& period : given_periods) given.push_back(axis.side_px / period.px(axis.side_px));
  const double lowest = *std::ranges::min_element(given);
  bool fits = true;
  for (size_t i = 0; i < given.size(); ++i) {
    given[i] /= lowest;
    fits = fits && std::abs(std::log(ratios[i] / given[i])) < std::log1p(kPeriodTolerance);
  }
  if (fits) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "--periods does not fit: along {} the photographs show frequencies in the ratio {}, those given are in "
      "the ratio {}",
      axis.name, numbers(ratios), numbers(given)));
}

class FringeSettler {
 public:
  FringeSettler(const PatternView& view, const FringeEvidence& evidence, PhotographLayout& layout,
                std::vector<std::string>& reasons)
      : view_(view), evidence_(evidence), layout_(layout), reasons_(reasons) {
    for (const LayoutSpan& span : evidence.spans) {
      if (!is_fringe(span.block)) continue;
      Axis axis{.span = span, .bits = static_cast<int>(evidence.bars.waves[span.axis()].size()), .waves = {}};
      axis.side_px = span.axis() == 0 ? evidence.monitor.width_px() : evidence.monitor.height_px();
      axis.name = span.axis() == 0 ? "x" : "y";
      for (int first = span.first; first < span.first + span.count; first += layout.steps)
        axis.waves.push_back(view.fringe(first, layout.steps, evidence.costs.left_out(first, layout.steps)));
      axes_.push_back(std::move(axis));
    }
  }

  absl::Status settle() {
    for (const Axis& axis : axes_) {
      double residual = 0.0;
      for (const PatternView::Fringe& wave : axis.waves) residual = std::max(residual, wave.residual);
      reasons_.push_back(fmt::format(
          "along {}: {} waves of {} steps, frequencies in the ratio {}; a sinusoid leaves {:.1f} % of their "
          "energy unexplained",
          axis.name, axis.waves.size(), layout_.steps, numbers(axis.ratios()), 100.0 * residual));
      GW_RETURN_IF_ERROR(check_periods(axis, evidence_.facts.periods));
    }
    layout_.periods = evidence_.facts.periods;
    const bool beside_bars =
        std::ranges::any_of(evidence_.bars.waves, [](const auto& waves) { return !waves.empty(); });
    if (!beside_bars) return settle_direction();
    GW_RETURN_IF_ERROR(settle_cell());
    return settle_first_phase();
  }

 private:
  absl::Status settle_direction() {
    const auto falling = std::ranges::count_if(axes_, [](const Axis& axis) { return axis.sign() < 0; });
    const std::optional<bool>& backward = evidence_.facts.backward;
    if (!backward && falling == static_cast<std::ptrdiff_t>(axes_.size())) {
      return absl::InvalidArgumentError(
          "the phase falls along the pictures' axes: the view is mirrored or upside down, or the fringes "
          "moved towards smaller x and y; pass --shift forward or --shift backward");
    }
    layout_.backward = backward.value_or(false);
    const bool mirrored = axes_.size() == 2 && falling == 1;
    reasons_.push_back(fmt::format("{}{}", backward ? "the steps follow --shift" : "the steps go forward",
                                   mirrored ? ", in a mirrored view" : ""));
    return absl::OkStatus();
  }

  // Bars with clear edges, and how many cells of the code the bars of each are apart.
  template <typename Take>
  void for_clear_bars(const Axis& axis, Take take) const {
    const std::vector<BarShots>& waves = evidence_.bars.waves[axis.span.axis()];
    for (size_t k = 0; k < waves.size(); ++k) {
      const PatternView::Look& look = view_.look(waves[k].lit);
      if (look.has_bars() && look.density[axis.span.axis()] < kMaxClearDensity)
        take(waves[k], std::exp2(static_cast<double>(waves.size() - 1 - k)));
    }
  }

  // How well the phases of a wave agree at the edges of all clear bars, once or twice around.
  double likeness(const Axis& axis, size_t wave, bool twice) const {
    std::complex<double> sum;
    double count = 0.0;
    for_clear_bars(axis, [&](const BarShots& bars, double) {
      const PatternView::EdgePhases phases = view_.phases_at_edges(
          bars, axis.span.first + static_cast<int>(wave) * layout_.steps, layout_.steps, axis.span.axis());
      sum += static_cast<double>(phases.count) * (twice ? phases.twice : phases.once);
      count += phases.count;
    });
    return std::abs(sum) / std::max(count, 1.0);
  }

  bool fits_bits(double cell_px) const {
    return std::ranges::all_of(
        axes_, [&](const Axis& axis) { return axis.bits == bits_of(axis.side_px / cell_px); });
  }

  // A cell is a period, or half of one (a complementary Gray code), whose phase is then the same at all edges
  // of bars; or one of the monitor's pixels.
  std::vector<double> fitting_cells() const {
    std::vector<double> cells;
    for (size_t w = 0; w < layout_.periods.size(); ++w) {
      for (const bool half : {false, true}) {
        const double cell_px = layout_.periods[w].px(axes_.front().side_px) * (half ? 0.5 : 1.0);
        const bool alike = std::ranges::all_of(
            axes_, [&](const Axis& axis) { return likeness(axis, w, half) > kSamePhase; });
        if (fits_bits(cell_px) && alike) cells.push_back(cell_px);
      }
    }
    if (cells.empty() && fits_bits(1.0)) cells.push_back(1.0);
    return cells;
  }

  absl::Status settle_cell() {
    const std::vector<double> cells =
        evidence_.facts.cell_px ? std::vector{*evidence_.facts.cell_px} : fitting_cells();
    if (cells.size() == 1) {
      layout_.cell_px = cells.front();
      reasons_.push_back(fmt::format("a cell of the code is {:.6g} px wide", layout_.cell_px));
      return absl::OkStatus();
    }
    return absl::InvalidArgumentError(fmt::format(
        "the width of the code's cells is ambiguous{}; pass --cell",
        cells.empty() ? ": neither a period of --periods, half of one nor 1 px has as many bits as the "
                        "photographs show"
                      : fmt::format(": it may be {:.6g} px", fmt::join(cells, " or "))));
  }

  // At the edges of bars the phase is known: the difference is the first step's phase.
  std::complex<double> first_phase(const Axis& axis, size_t wave, bool backward) const {
    const double period_px = layout_.periods[wave].px(axis.side_px);
    std::complex<double> sum;
    for_clear_bars(axis, [&](const BarShots& bars, double cells) {
      const double turns = cells * layout_.cell_px / period_px;
      const bool coarsest = bars.lit == evidence_.bars.waves[axis.span.axis()].front().lit;
      if (!coarsest && std::abs(turns - std::round(turns)) > 0.02) return;
      const int first = axis.span.first + static_cast<int>(wave) * layout_.steps;
      const PatternView::EdgePhases phases =
          view_.phases_at_edges(bars, first, layout_.steps, axis.span.axis());
      const std::complex<double> seen = backward ? phases.once : std::conj(phases.once);
      sum += std::polar(static_cast<double>(phases.count), kTurn * turns) * seen;
    });
    return sum;
  }

  absl::Status settle_first_phase() {
    int forward = 0, backward = 0;
    for (const Axis& axis : axes_)
      (axis.sign() * evidence_.bars.direction[axis.span.axis()] > 0 ? forward : backward) +=
          std::abs(evidence_.bars.direction[axis.span.axis()]);
    if (evidence_.facts.backward) {
      layout_.backward = *evidence_.facts.backward;
    } else if ((forward > 0) == (backward > 0)) {
      return absl::InvalidArgumentError(
          "the direction of the fringes beside the bars cannot be determined; pass --shift forward or "
          "--shift "
          "backward");
    } else {
      layout_.backward = backward > 0;
    }
    std::complex<double> sum;
    double count = 0.0;
    for (const Axis& axis : axes_) {
      for (size_t w = 0; w < axis.waves.size(); ++w) {
        const std::complex<double> phase = first_phase(axis, w, layout_.backward);
        if (std::abs(phase) == 0.0) continue;
        sum += phase / std::abs(phase);
        count += 1.0;
      }
    }
    if (count == 0.0 || std::abs(sum) < kSamePhase * count) {
      return absl::InvalidArgumentError(
          "the fringes' phase at the edges of the bars is not the same everywhere, so their relation is "
          "ambiguous; name the layout with --cell and --phase");
    }
    const double seen_deg = std::arg(sum) * 360.0 / kTurn, grid_deg = 180.0 / layout_.steps;
    const double nearest_deg = grid_deg * std::round(seen_deg / grid_deg);
    layout_.phase_deg = std::abs(seen_deg - nearest_deg) < std::min(kSameFirstPhase_deg, 0.4 * grid_deg)
                            ? nearest_deg
                            : std::round(seen_deg);
    if (layout_.phase_deg < 0.0) layout_.phase_deg += 360.0;
    if (layout_.phase_deg == 360.0) layout_.phase_deg = 0.0;
    reasons_.push_back(
        fmt::format("beside the bars the fringes move {}, and their first phase is {:.0f} deg ({:.1f} "
                    "measured)",
                    layout_.backward ? "backward" : "forward", layout_.phase_deg, seen_deg));
    return absl::OkStatus();
  }

  const PatternView& view_;
  const FringeEvidence& evidence_;
  PhotographLayout& layout_;
  std::vector<std::string>& reasons_;
  std::vector<Axis> axes_;
};

}  // namespace

absl::Status settle_fringes(const PatternView& view, const FringeEvidence& evidence, PhotographLayout& layout,
                            std::vector<std::string>& reasons) {
  return FringeSettler(view, evidence, layout, reasons).settle();
}

}  // namespace glasswing
