#include "client/layouts/layout_search.h"

#include <algorithm>

namespace glasswing {
namespace {

constexpr int kMinBits = 2, kMaxBits = 14;
constexpr int kFewestSteps = 3, kMostSteps = 32, kMostStepsBesideBars = 16, kMaxWaves = 6;
constexpr double kBlock = 1.0;        // of one more block
constexpr double kTwoFamilies = 4.0;  // a code and fringes
constexpr double kOtherBits = 5.0;    // than the monitor's, if there is only a code

constexpr std::array kAllBlocks{LayoutBlock::kWhite, LayoutBlock::kBlack,         LayoutBlock::kColumns,
                                LayoutBlock::kRows,  LayoutBlock::kFringeColumns, LayoutBlock::kFringeRows};

class Search {
 public:
  Search(LayoutCosts& costs, LayoutFamily family, const std::array<int, 2>& own_bits, double most,
         double margin)
      : costs_(costs), own_bits_(own_bits), margin_(margin), best_(most) {
    reading_.family = family;
    reading_.cost = family == LayoutFamily::kBarsAndFringes ? kTwoFamilies : 0.0;
  }

  std::vector<LayoutReading> run() {
    const bool bars = reading_.family != LayoutFamily::kFringes,
               fringes = reading_.family != LayoutFamily::kBars;
    const int most_steps = bars ? kMostStepsBesideBars : kMostSteps;
    for (const bool pairs : {false, true}) {
      if (pairs && !bars) continue;
      reading_.pairs = pairs;
      if (!fringes) {
        place(0);
        continue;
      }
      for (reading_.steps = kFewestSteps; reading_.steps <= most_steps; ++reading_.steps) {
        for (reading_.waves = 1; reading_.waves <= kMaxWaves; ++reading_.waves) {
          if (reading_.steps * reading_.waves <= costs_.photographs()) place(0);
        }
      }
    }
    std::ranges::stable_sort(found_, {}, &LayoutReading::cost);
    std::erase_if(found_, [&](const LayoutReading& one) { return one.cost > best_ + margin_; });
    return std::move(found_);
  }

 private:
  // All ways to continue from a photograph.
  void place(int at) {
    if (at == costs_.photographs()) return keep();
    for (const LayoutBlock block : kAllBlocks) {
      if (std::ranges::any_of(reading_.spans, [&](const LayoutSpan& span) { return span.block == block; }))
        continue;
      if (is_solid(block)) {
        add(block, at, 1, costs_.solid(at, block == LayoutBlock::kWhite));
      } else if (is_fringe(block)) {
        if (reading_.family == LayoutFamily::kBars) continue;
        const int count = reading_.steps * reading_.waves;
        if (at + count > costs_.photographs()) continue;
        add(block, at, count,
            kBlock + costs_.fringes(axis_of(block), at, reading_.steps, reading_.waves,
                                    best_ + margin_ - reading_.cost));
      } else if (reading_.family != LayoutFamily::kFringes) {
        add_bars(block, at);
      }
    }
  }

  void add_bars(LayoutBlock block, int at) {
    const int shots = reading_.pairs ? 2 : 1;
    const size_t axis = axis_of(block);
    for (int bits = kMinBits; bits <= kMaxBits && at + bits * shots <= costs_.photographs(); ++bits) {
      const bool odd = reading_.family == LayoutFamily::kBars && bits != own_bits_[axis];
      add(block, at, bits * shots,
          kBlock + (odd ? kOtherBits : 0.0) + costs_.bars(axis, at, bits, reading_.pairs));
    }
  }

  void add(LayoutBlock block, int at, int count, double cost) {
    if (reading_.cost + cost > best_ + margin_) return;
    const double before = reading_.cost;
    reading_.cost += cost;
    reading_.spans.push_back({.block = block, .first = at, .count = count});
    place(at + count);
    reading_.spans.pop_back();
    reading_.cost = before;
  }

  void keep() {
    std::array<bool, 2> bars{}, fringes{};  // by axis
    for (const LayoutSpan& span : reading_.spans) {
      if (!is_solid(span.block)) (is_fringe(span.block) ? fringes : bars)[span.axis()] = true;
    }
    const bool has_axes = bars[0] || bars[1] || fringes[0] || fringes[1];
    if (!has_axes || (reading_.family == LayoutFamily::kBarsAndFringes && bars != fringes)) return;
    best_ = std::min(best_, reading_.cost);
    found_.push_back(reading_);
  }

  LayoutCosts& costs_;
  const std::array<int, 2> own_bits_;
  const double margin_;
  LayoutReading reading_;
  double best_;
  std::vector<LayoutReading> found_;
};

}  // namespace

std::vector<LayoutReading> search_layouts(LayoutCosts& costs, LayoutFamily family,
                                          const std::array<int, 2>& own_bits, double most, double margin) {
  return Search(costs, family, own_bits, most, margin).run();
}

}  // namespace glasswing
