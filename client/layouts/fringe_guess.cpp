#include "client/layouts/fringe_guess.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace glasswing {
namespace {

constexpr double kTurnAlongAxis = 2.0;  // change of phase along the own axis, in that along the other
constexpr double kMaxResidual = 0.1, kMaxMeanSpread = 0.15;
constexpr double kMaxTurn_rad = 1.5;  // above it noise and slopes reach half a turn
constexpr double kPeriodTolerance = 0.06;

std::vector<PatternView::Fringe> fringes_of(const PatternView& view, const PhotographLayout& layout,
                                            const LayoutSpan& span) {
  std::vector<PatternView::Fringe> fringes;
  for (int first = span.first; first < span.first + span.count; first += layout.steps)
    fringes.push_back(view.fringe(first, layout.steps));
  return fringes;
}

// The frequencies of waves along an axis, as multiples of the lowest.
std::vector<double> ratios_of(const std::vector<PatternView::Fringe>& fringes, size_t axis) {
  std::vector<double> ratios;
  for (const PatternView::Fringe& fringe : fringes) ratios.push_back(std::abs(fringe.turn_rad[axis]));
  const double lowest = *std::ranges::min_element(ratios);
  for (double& ratio : ratios) ratio /= std::max(lowest, 1e-9);
  return ratios;
}

absl::Status check_periods(const std::vector<double>& ratios, const LayoutSpan& span,
                           const v1::Monitor& monitor, const FringeFacts& facts) {
  const char* direction = span.axis() == 0 ? "x" : "y";
  const std::string seen = fmt::format("{:.2f}", fmt::join(ratios, " : "));
  if (facts.periods.size() != ratios.size()) {
    return absl::InvalidArgumentError(fmt::format(
        "{}; along {} their frequencies are as {}: pass --periods with the number of fringes along a "
        "side of the monitor for each, in this order",
        facts.periods.empty() ? "how long the fringes were cannot be seen"
                              : fmt::format("--periods names {} fringes, the photographs show {}",
                                            facts.periods.size(), ratios.size()),
        direction, seen));
  }
  const int side_px = span.axis() == 0 ? monitor.width_px() : monitor.height_px();
  std::vector<double> given;
  for (const FringePeriod& period : facts.periods) given.push_back(side_px / period.px(side_px));
  const double lowest = *std::ranges::min_element(given);
  bool fits = true;
  for (size_t i = 0; i < given.size(); ++i) {
    given[i] /= lowest;
    fits = fits && std::abs(std::log(ratios[i] / given[i])) < std::log1p(kPeriodTolerance);
  }
  if (fits) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "--periods does not fit: along {} the photographs show frequencies as {}, those given are as "
      "{:.2f}",
      direction, seen, fmt::join(given, " : ")));
}

// 1: the phase rises along the pictures' axis; -1: it falls.
int sign_of(const std::vector<PatternView::Fringe>& fringes, size_t axis) {
  double sum = 0.0;
  for (const PatternView::Fringe& fringe : fringes) {
    if (std::abs(fringe.turn_rad[axis]) < kMaxTurn_rad) sum += fringe.turn_rad[axis];
  }
  return sum < 0.0 ? -1 : 1;
}

}  // namespace

std::string against_fringes(const PatternView& view, const PhotographLayout& layout, const LayoutSpan& span,
                            const std::vector<std::string>& files) {
  bool across = true;
  for (const PatternView::Fringe& fringe : fringes_of(view, layout, span)) {
    if (fringe.residual > kMaxResidual || fringe.mean_spread > kMaxMeanSpread)
      return fmt::format("{} are not {} steps of fringes", span.range(files), layout.steps);
    across = across && std::abs(fringe.turn_rad[span.axis()]) >
                           kTurnAlongAxis * std::abs(fringe.turn_rad[1 - span.axis()]);
  }
  if (across) return "";
  return fmt::format("{} are no {} fringes", span.range(files), span.axis() == 0 ? "vertical" : "horizontal");
}

absl::Status settle_fringes(const PatternView& view, const std::vector<LayoutSpan>& spans,
                            const v1::Monitor& monitor, const FringeFacts& facts, PhotographLayout& layout,
                            std::vector<std::string>& reasons) {
  int falling = 0, axes = 0;
  for (const LayoutSpan& span : spans) {
    if (span.block == LayoutBlock::kWhite || span.block == LayoutBlock::kBlack) continue;
    const std::vector<PatternView::Fringe> fringes = fringes_of(view, layout, span);
    const std::vector<double> ratios = ratios_of(fringes, span.axis());
    double residual = 0.0;
    for (const PatternView::Fringe& fringe : fringes) residual = std::max(residual, fringe.residual);
    reasons.push_back(
        fmt::format("{}: {} waves of {} steps, frequencies as {:.2f}; a sinusoid leaves {:.1f} % of "
                    "their energy",
                    span.axis() == 0 ? "along x" : "along y", fringes.size(), layout.steps,
                    fmt::join(ratios, " : "), 100.0 * residual));
    if (absl::Status status = check_periods(ratios, span, monitor, facts); !status.ok()) return status;
    ++axes;
    falling += sign_of(fringes, span.axis()) < 0 ? 1 : 0;
  }
  layout.periods = facts.periods;
  if (!facts.backward && falling == axes) {
    return absl::InvalidArgumentError(
        "the phase falls along the pictures' axes: the view is mirrored or upside down, or the fringes moved "
        "towards smaller x and y; pass --shift forward or --shift backward");
  }
  layout.backward = facts.backward.value_or(false);
  const bool mirrored = axes == 2 && falling == 1;
  reasons.push_back(fmt::format("{}{}",
                                facts.backward ? "the steps go as --shift says" : "the steps go forward",
                                mirrored ? ", in a mirrored view" : ""));
  return absl::OkStatus();
}

}  // namespace glasswing
