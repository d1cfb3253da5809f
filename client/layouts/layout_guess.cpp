#include "client/layouts/layout_guess.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "client/layouts/bar_guess.h"
#include "client/layouts/fringe_guess.h"
#include "client/layouts/layout_search.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr double kMinLit = 0.002;  // of the frame
constexpr double kMargin = 5.0;    // by which the next best reading must be worse: a likelihood ratio of 150
// What the photographs of the right layout cost at most: each a little, and one in eight of them all.
constexpr double kUsual = 0.6, kBadShare = 0.125;
constexpr int kMaxDoublings = 6;  // of a cell, which a question proposes

absl::Status unsettled(const std::string& what) {
  return absl::InvalidArgumentError(what + "; name the layout, or what each photograph shows with --list");
}

double most_cost(int photographs) {
  return kUsual * photographs + LayoutCosts::kWorst * std::floor(kBadShare * photographs);
}

std::string words_of(LayoutFamily family) {
  switch (family) {
    case LayoutFamily::kBars:
      return "a code of bars";
    case LayoutFamily::kFringes:
      return "phase-shifted fringes";
    case LayoutFamily::kBarsAndFringes:
      return "a code of bars with fringes";
  }
  return "";
}

std::string shown_in(const LayoutSpan& span) {
  switch (span.block) {
    case LayoutBlock::kColumns:
      return "vertical bars";
    case LayoutBlock::kRows:
      return "horizontal bars";
    case LayoutBlock::kFringeColumns:
      return "vertical fringes";
    case LayoutBlock::kFringeRows:
      return "horizontal fringes";
    case LayoutBlock::kWhite:
      return "white";
    case LayoutBlock::kBlack:
      return "black";
  }
  return "";
}

std::string words_of(const LayoutReading& reading, const std::vector<std::string>& files) {
  std::vector<std::string> parts;
  for (const LayoutSpan& span : reading.spans) {
    const char* verb = is_solid(span.block) ? "is" : "show";
    parts.push_back(fmt::format("{} {} {}", span.range(files), verb, shown_in(span)));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

// One of the layout's readings against the photographs: a layout as far as the reading tells it.
class Guesser {
 public:
  Guesser(const PatternView& view, const std::vector<std::string>& files, const v1::Monitor& monitor,
          const LayoutFacts& facts, std::vector<std::string>& reasons)
      : view_(view), files_(files), monitor_(monitor), facts_(facts), reasons_(reasons), costs_(view) {
    const double cell_px = facts.cell_px.value_or(1.0);
    own_bits_ = {bits_of(monitor.width_px() / cell_px), bits_of(monitor.height_px() / cell_px)};
  }

  absl::StatusOr<PhotographLayout> guess() {
    std::vector<LayoutReading> readings;
    double most = LayoutCosts::kWorst * count();
    for (const LayoutFamily family : kLayoutFamilies) {
      for (LayoutReading& reading : search_layouts(costs_, family, own_bits_, most, kMargin)) {
        // Beside bars, only what could be the answer is searched for.
        most = std::min({most, reading.cost, most_cost(count())});
        readings.push_back(std::move(reading));
      }
    }
    std::ranges::stable_sort(readings, {}, &LayoutReading::cost);
    if (readings.empty() || readings.front().cost > most_cost(count())) return nothing_fits(readings);
    drop_impossible(readings);
    const LayoutReading& best = readings.front();
    if (readings.size() > 1 && readings[1].cost < best.cost + kMargin) {
      return unsettled(fmt::format("two layouts fit alike: {}; or else {}", words_of(best, files_),
                                   words_of(readings[1], files_)));
    }
    reasons_.push_back(words_of(best, files_));
    if (const std::string bad = bad_photographs(best); !bad.empty())
      reasons_.push_back(bad + " not, and are taken for it all the same");
    return layout_of(best);
  }

 private:
  int count() const { return static_cast<int>(files_.size()); }

  absl::StatusOr<PhotographLayout> layout_of(const LayoutReading& reading) {
    PhotographLayout layout;
    layout.code = PatternCode::kPhaseShift;
    layout.steps = reading.steps;
    for (const LayoutSpan& span : reading.spans) layout.order.push_back(span.block);
    BarsSeen bars;
    if (reading.family != LayoutFamily::kFringes) {
      layout.complements = reading.pairs ? Complements::kAfter : Complements::kNone;
      GW_ASSIGN_OR_RETURN(bars, settle_bars(view_, reading.spans, layout, reasons_));
    }
    if (reading.family == LayoutFamily::kBars) GW_RETURN_IF_ERROR(settle_cells(reading, layout));
    if (reading.family != LayoutFamily::kBars) {
      GW_RETURN_IF_ERROR(
          settle_fringes(view_, {reading.spans, bars, monitor_, facts_, costs_}, layout, reasons_));
    }
    if (reading.family == LayoutFamily::kFringes) {
      for (LayoutBlock& block : layout.order) {
        if (block == LayoutBlock::kFringeColumns) block = LayoutBlock::kColumns;
        if (block == LayoutBlock::kFringeRows) block = LayoutBlock::kRows;
      }
    }
    reasons_.push_back("this is " + options_of(layout));
    return layout;
  }

  // Of a code; 0 along an axis that has none.
  static std::array<int, 2> bits_along_axes(const LayoutReading& reading) {
    std::array<int, 2> bits{};
    for (const LayoutSpan& span : reading.spans) {
      if (!is_solid(span.block) && !is_fringe(span.block)) bits[span.axis()] = reading.bits(span);
    }
    return bits;
  }

  // Whether a code of such cells has these bits.
  bool has_bits(const std::array<int, 2>& bits, double cell_px) const {
    return (bits[0] == 0 || bits[0] == bits_of(monitor_.width_px() / cell_px)) &&
           (bits[1] == 0 || bits[1] == bits_of(monitor_.height_px() / cell_px));
  }

  // Cells are as wide as high. Beside fringes one is a pixel, a period or half of one.
  bool is_possible(const LayoutReading& reading) const {
    if (reading.family == LayoutFamily::kFringes) return true;
    if (reading.family == LayoutFamily::kBarsAndFringes && !facts_.cell_px && facts_.periods.empty())
      return true;
    std::vector<double> cells_px{facts_.cell_px.value_or(1.0)};
    for (int k = 1; reading.family == LayoutFamily::kBars && k <= kMaxDoublings; ++k)
      cells_px.push_back(cells_px.front() * std::exp2(k));
    for (const FringePeriod& period : facts_.periods) {
      if (reading.family == LayoutFamily::kBars || facts_.cell_px) break;
      for (const int side_px : {monitor_.width_px(), monitor_.height_px()})
        cells_px.insert(cells_px.end(), {period.px(side_px), 0.5 * period.px(side_px)});
    }
    const std::array<int, 2> bits = bits_along_axes(reading);
    return std::ranges::any_of(cells_px, [&](double cell_px) { return has_bits(bits, cell_px); });
  }

  // Of readings that fit alike, those that no cell has, unless that are all.
  void drop_impossible(std::vector<LayoutReading>& readings) const {
    const double most = readings.front().cost + kMargin;
    if (std::ranges::any_of(readings,
                            [&](const LayoutReading& one) { return one.cost < most && is_possible(one); }))
      std::erase_if(readings, [&](const LayoutReading& one) { return !is_possible(one); });
  }

  // A code of the monitor's own size, or the question of what size it is.
  absl::Status settle_cells(const LayoutReading& reading, PhotographLayout& layout) const {
    layout.cell_px = facts_.cell_px.value_or(1.0);
    const std::array<int, 2> bits = bits_along_axes(reading);
    int expected = 0;
    for (const LayoutSpan& span : reading.spans)
      expected += is_solid(span.block) ? 1 : own_bits_[span.axis()] * (reading.pairs ? 2 : 1);
    if (has_bits(bits, layout.cell_px)) return absl::OkStatus();
    const std::string code = layout.code == PatternCode::kGray ? "a Gray code" : "a binary code";
    const std::string seen =
        fmt::format("{} of {:g}x{:g} cells has {} photographs in this order, these are {}", code,
                    std::ceil(monitor_.width_px() / layout.cell_px),
                    std::ceil(monitor_.height_px() / layout.cell_px), expected, count());
    for (int doublings = 0; doublings <= kMaxDoublings; ++doublings) {
      const double cell_px = std::exp2(doublings);
      if (!has_bits(bits, cell_px)) continue;
      return absl::InvalidArgumentError(fmt::format(
          "{}: {:g}x{:g}? If so, pass --cell {:g}; else the size that the code was made for as --monitor",
          seen, std::ceil(monitor_.width_px() / cell_px), std::ceil(monitor_.height_px() / cell_px),
          cell_px));
    }
    return absl::InvalidArgumentError(fmt::format(
        "{}, with {} bits of columns and {} of rows; pass the size that the code was made for as --monitor",
        seen, bits[0], bits[1]));
  }

  // "x.png and y.png should show vertical bars and do", for a sentence that goes on; empty: none.
  std::string bad_photographs(const LayoutReading& reading) {
    std::vector<std::string> bad;
    for (const LayoutSpan& span : reading.spans) {
      std::vector<int> photographs;
      if (is_solid(span.block)) {
        if (costs_.solid(span.first, span.block == LayoutBlock::kWhite) >= 0.5 * LayoutCosts::kWorst)
          photographs = {span.first};
      } else if (is_fringe(span.block)) {
        for (int wave = 0; wave < reading.waves; ++wave) {
          const int first = span.first + wave * reading.steps;
          if (costs_.fringes(span.axis(), first, reading.steps, 1, most_cost(count())) < LayoutCosts::kWorst)
            continue;
          for (int step = 0; step < reading.steps; ++step) photographs.push_back(first + step);
        }
      } else {
        photographs = costs_.bad_bars(span.axis(), span.first, reading.bits(span), reading.pairs);
      }
      if (photographs.empty()) continue;
      constexpr size_t kNamed = 4;
      std::vector<std::string> names;
      for (size_t i = 0; i < std::min(photographs.size(), kNamed); ++i)
        names.push_back(files_[photographs[i]]);
      if (photographs.size() > kNamed) names.push_back(fmt::format("{} more", photographs.size() - kNamed));
      bad.push_back(fmt::format("{} should {} {}", fmt::join(names, ", "),
                                is_solid(span.block) ? "be" : "show", shown_in(span)));
    }
    return bad.empty() ? "" : fmt::format("{} and do", fmt::join(bad, "; "));
  }

  absl::Status nothing_fits(const std::vector<LayoutReading>& readings) {
    std::vector<std::string> failures;
    for (const LayoutFamily family : kLayoutFamilies) {
      const auto best = std::ranges::find(readings, family, &LayoutReading::family);
      if (best == readings.end()) continue;
      const std::string bad = bad_photographs(*best);
      failures.push_back(
          fmt::format("as {} {}", words_of(family), bad.empty() ? "they fit poorly all over" : bad + " not"));
    }
    return unsettled(fmt::format(
        "no standard layout explains these {} photographs: {}", count(),
        failures.empty() ? "there are too few or too many" : fmt::format("{}", fmt::join(failures, "; "))));
  }

  const PatternView& view_;
  const std::vector<std::string>& files_;
  const v1::Monitor& monitor_;
  const LayoutFacts& facts_;
  std::vector<std::string>& reasons_;
  LayoutCosts costs_;
  std::array<int, 2> own_bits_{};
};

}  // namespace

LayoutGuess guess_layout(const StackSamples& samples, const std::vector<std::string>& files,
                         const v1::Monitor& monitor, const LayoutFacts& facts) {
  LayoutGuess result{.reasons = {}, .layout = absl::InternalError("")};
  const PatternView view(samples);
  result.reasons.push_back(fmt::format("{} photographs of {}x{} px; {:.1f} % of the frame sees the patterns",
                                       files.size(), samples.width_px, samples.height_px,
                                       100.0 * view.lit_share()));
  if (view.lit_share() < kMinLit) {
    result.layout =
        unsettled(fmt::format("the patterns are seen by less than {} % of the frame", 100.0 * kMinLit));
  } else {
    result.layout = Guesser(view, files, monitor, facts, result.reasons).guess();
  }
  return result;
}

}  // namespace glasswing
