#include "client/layouts/layout_guess.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "client/layouts/bar_guess.h"
#include "client/layouts/fringe_guess.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr double kMinLit = 0.002;  // of the frame
constexpr int kMaxGuessedSteps = 32;

absl::Status unsettled(const std::string& what) {
  return absl::InvalidArgumentError(what + "; name the layout, or what each photograph shows with --list");
}

std::vector<std::vector<LayoutBlock>> all_orders() {
  constexpr std::array kAll{LayoutBlock::kColumns, LayoutBlock::kRows, LayoutBlock::kWhite,
                            LayoutBlock::kBlack};
  std::vector<std::vector<LayoutBlock>> orders;
  for (unsigned chosen = 1; chosen < 16; ++chosen) {
    if ((chosen & 3u) == 0) continue;  // neither columns nor rows
    std::vector<LayoutBlock> order;
    for (unsigned i = 0; i < 4; ++i) {
      if ((chosen >> i & 1u) != 0) order.push_back(kAll[i]);
    }
    do {
      orders.push_back(order);
    } while (std::ranges::next_permutation(order).found);
  }
  return orders;
}

bool is_axis(LayoutBlock block) {
  return block == LayoutBlock::kColumns || block == LayoutBlock::kRows;
}

// Layouts with this many patterns. Gray code stands for binary code too, complements after their pattern for
// those before it: settle_bars() tells them apart. Periods are only counted.
std::vector<PhotographLayout> candidates(int photographs, const v1::Monitor& monitor) {
  std::vector<PhotographLayout> layouts;
  for (const std::vector<LayoutBlock>& order : all_orders()) {
    PhotographLayout layout;
    layout.order = order;
    const auto add = [&] {
      int count = 0;
      for (const LayoutBlock block : order) count += count_of(layout, block, monitor);
      if (count == photographs) layouts.push_back(layout);
    };
    add();
    layout.complements = Complements::kAfter;
    add();
    const auto axes = static_cast<int>(std::ranges::count_if(order, is_axis));
    const int of_axis = (photographs - static_cast<int>(order.size()) + axes) / axes;
    layout.code = PatternCode::kPhaseShift;
    for (layout.steps = 3; layout.steps <= std::min(of_axis, kMaxGuessedSteps); ++layout.steps) {
      layout.periods.assign(static_cast<size_t>(of_axis / layout.steps), {.value = 1.0});
      add();
    }
  }
  return layouts;
}

std::vector<LayoutSpan> spans_of(const PhotographLayout& layout, const v1::Monitor& monitor) {
  std::vector<LayoutSpan> spans;
  int first = 0;
  for (const LayoutBlock block : layout.order) {
    spans.push_back({.block = block, .first = first, .count = count_of(layout, block, monitor)});
    first += spans.back().count;
  }
  return spans;
}

// How far a layout explains the photographs, and what is against it.
struct Verdict {
  int explained = 0;
  std::string complaint;  // empty: nothing
};

Verdict judge(const PatternView& view, const PhotographLayout& layout, const std::vector<LayoutSpan>& spans,
              const std::vector<std::string>& files) {
  Verdict verdict;
  // Solids first: they cost nothing, and few layouts have them at the right places.
  for (const bool solids : {true, false}) {
    for (const LayoutSpan& span : spans) {
      if (is_axis(span.block) == solids) continue;
      const std::string& first = files[static_cast<size_t>(span.first)];
      if (span.block == LayoutBlock::kWhite && !view.look(span.first).white())
        verdict.complaint = first + " is not white";
      if (span.block == LayoutBlock::kBlack && !view.look(span.first).black())
        verdict.complaint = first + " is not black";
      if (is_axis(span.block)) {
        verdict.complaint = layout.code == PatternCode::kPhaseShift
                                ? against_fringes(view, layout, span, files)
                                : against_bars(view, layout, span, files);
      }
      if (!verdict.complaint.empty()) return verdict;
      verdict.explained += span.count;
    }
  }
  return verdict;
}

std::string words_of(const PhotographLayout& layout, const std::vector<LayoutSpan>& spans,
                     const std::vector<std::string>& files) {
  std::vector<std::string> parts;
  for (const LayoutSpan& span : spans) {
    const char* shown = layout.code == PatternCode::kPhaseShift ? "fringes" : "bars";
    switch (span.block) {
      case LayoutBlock::kColumns:
        parts.push_back(fmt::format("{} show vertical {}", span.range(files), shown));
        break;
      case LayoutBlock::kRows:
        parts.push_back(fmt::format("{} show horizontal {}", span.range(files), shown));
        break;
      case LayoutBlock::kWhite:
        parts.push_back(span.range(files) + " is white");
        break;
      case LayoutBlock::kBlack:
        parts.push_back(span.range(files) + " is black");
        break;
    }
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

absl::StatusOr<PhotographLayout> guess(const PatternView& view, const std::vector<std::string>& files,
                                       const v1::Monitor& monitor, const FringeFacts& facts,
                                       std::vector<std::string>& reasons) {
  std::vector<PhotographLayout> fitting;
  Verdict closest;
  for (const PhotographLayout& layout : candidates(static_cast<int>(files.size()), monitor)) {
    const Verdict verdict = judge(view, layout, spans_of(layout, monitor), files);
    if (verdict.complaint.empty()) fitting.push_back(layout);
    if (closest.complaint.empty() || verdict.explained > closest.explained) closest = verdict;
  }
  if (fitting.empty()) {
    return unsettled(
        fmt::format("no layout of a monitor of {}x{} px explains {} photographs{}", monitor.width_px(),
                    monitor.height_px(), files.size(),
                    closest.complaint.empty() ? "" : "; in the closest one " + closest.complaint));
  }
  if (fitting.size() > 1) {
    std::vector<std::string> choices;
    for (const PhotographLayout& layout : fitting) choices.push_back(options_of(layout));
    return unsettled(fmt::format("{} layouts fit alike: {}", fitting.size(), fmt::join(choices, " | ")));
  }
  PhotographLayout layout = fitting.front();
  const std::vector<LayoutSpan> spans = spans_of(layout, monitor);
  reasons.push_back(words_of(layout, spans, files));
  const absl::Status settled = layout.code == PatternCode::kPhaseShift
                                   ? settle_fringes(view, spans, monitor, facts, layout, reasons)
                                   : settle_bars(view, spans, layout, reasons);
  GW_RETURN_IF_ERROR(settled);
  reasons.push_back("this is " + options_of(layout));
  return layout;
}

}  // namespace

LayoutGuess guess_layout(const StackSamples& samples, const std::vector<std::string>& files,
                         const v1::Monitor& monitor, const FringeFacts& facts) {
  LayoutGuess result{.reasons = {}, .layout = absl::InternalError("")};
  const PatternView view(samples);
  result.reasons.push_back(fmt::format("{} photographs of {}x{} px; {:.1f} % of the frame sees the patterns",
                                       files.size(), samples.width_px, samples.height_px,
                                       100.0 * view.lit_share()));
  if (view.lit_share() < kMinLit) {
    result.layout =
        unsettled(fmt::format("the patterns are seen by less than {} % of the frame", 100.0 * kMinLit));
  } else {
    result.layout = guess(view, files, monitor, facts, result.reasons);
  }
  return result;
}

}  // namespace glasswing
