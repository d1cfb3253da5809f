#include "client/layouts/bar_guess.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace glasswing {
namespace {

constexpr double kResolved = 0.6;   // share of values between dark and lit; bars with more are blurred
constexpr double kSharp = 0.35;     // the coarser half of all bars has less
constexpr double kAlongAxis = 2.0;  // edges along the own axis, in those along the other
constexpr double kComplement =
    0.25;                       // error of complements; other neighbours differ from 1 on half of all pixels
constexpr double kFiner = 1.4;  // edges, in those of the next coarser bars
constexpr double kMinEdgesOfLine = 2.0;  // with fewer their number is chance
constexpr double kMaxEdges = 0.05;       // a pixel; with more a blurred edge reaches the next
constexpr int kMinEdges = 20;            // that a decision needs
constexpr double kMajority = 0.75;

bool resolved(const PatternView& view, int photograph) {
  return view.look(photograph).between < kResolved;
}

// Coarse to fine.
std::vector<BarShots> waves_of(const PhotographLayout& layout, const LayoutSpan& span) {
  std::vector<BarShots> waves;
  const bool pairs = layout.complements != Complements::kNone;
  for (int i = span.first; i < span.first + span.count; i += pairs ? 2 : 1) {
    waves.push_back({.lit = i, .complement = pairs ? i + 1 : -1});
    if (layout.complements == Complements::kBefore) std::swap(waves.back().lit, waves.back().complement);
  }
  return waves;
}

bool run_across(const PatternView& view, const LayoutSpan& span) {
  double own = 0.0, other = 0.0;
  for (int i = span.first; i < span.first + span.count; ++i) {
    if (!resolved(view, i)) continue;
    own += view.look(i).edges[span.axis()];
    other += view.look(i).edges[1 - span.axis()];
  }
  return own > kAlongAxis * other;
}

// Whether each wave of this sequence has clearly more edges than the one before.
bool becomes_finer(const PatternView& view, const std::vector<BarShots>& waves, const LayoutSpan& span) {
  for (size_t i = 0; i + 1 < waves.size(); ++i) {
    const int coarse = waves[i].lit, fine = waves[i + 1].lit;
    const double before = view.look(coarse).edges[span.axis()], after = view.look(fine).edges[span.axis()];
    if (!resolved(view, coarse) || !resolved(view, fine)) continue;
    if (std::max(view.edges_of_line(coarse, span.axis()), view.edges_of_line(fine, span.axis())) <
        kMinEdgesOfLine)
      continue;
    if (after < kFiner * before) return false;
  }
  return true;
}

std::string against_complements(const PatternView& view, const PhotographLayout& layout,
                                const LayoutSpan& span, const std::vector<std::string>& files) {
  const auto complements = [&](int i) { return view.complement_error(i, i + 1) < kComplement; };
  if (layout.complements != Complements::kNone) {
    for (int i = span.first; i < span.first + span.count; i += 2) {
      if (resolved(view, i) && resolved(view, i + 1) && !complements(i)) {
        return fmt::format("{} and {} are no complements", files[static_cast<size_t>(i)],
                           files[static_cast<size_t>(i + 1)]);
      }
    }
    return "";
  }
  int alike = 0, neighbours = 0;
  for (int i = span.first; i + 1 < span.first + span.count; ++i) {
    if (!resolved(view, i) || !resolved(view, i + 1)) continue;
    ++neighbours;
    alike += complements(i) ? 1 : 0;
  }
  return 2 * alike < neighbours ? "" : fmt::format("neighbours among {} are complements", span.range(files));
}

// What the edges of all waves say of the code, and those of the coarsest of each axis of its direction.
struct EdgeSurvey {
  PatternView::EdgeCounts all;
  std::array<PatternView::EdgeCounts, 2> coarsest;
  int count() const { return all.also_edge + all.lit + all.dark; }
};

EdgeSurvey survey(const PatternView& view, const std::vector<LayoutSpan>& spans,
                  const PhotographLayout& layout) {
  EdgeSurvey result;
  for (const LayoutSpan& span : spans) {
    if (span.block == LayoutBlock::kWhite || span.block == LayoutBlock::kBlack) continue;
    const std::vector<BarShots> waves = waves_of(layout, span);
    for (size_t i = 0; i + 1 < waves.size(); ++i) {
      const PatternView::Look& fine = view.look(waves[i + 1].lit);
      if (fine.edges[span.axis()] > kMaxEdges || !resolved(view, waves[i + 1].lit)) break;
      const PatternView::EdgeCounts counts = view.edges(waves[i], waves[i + 1], span.axis());
      if (i == 0) result.coarsest[span.axis()] = counts;
      result.all.also_edge += counts.also_edge;
      result.all.lit += counts.lit;
      result.all.dark += counts.dark;
    }
  }
  return result;
}

// 1: the coarsest bars are dark, then lit, along the pictures' axis; -1: lit, then dark; 0: not seen.
int direction_of(const PatternView::EdgeCounts& counts) {
  const int edges = counts.rising + counts.falling;
  if (edges < kMinEdges) return 0;
  if (counts.rising > kMajority * edges) return 1;
  return counts.falling > kMajority * edges ? -1 : 0;
}

std::string direction_words(const std::array<int, 2>& direction) {
  const auto words = [](int sign, const char* rises, const char* falls) {
    return sign == 0 ? "is not seen" : sign > 0 ? rises : falls;
  };
  std::string text = fmt::format("the direction across x {}, across y {}",
                                 words(direction[0], "is to the right", "is to the left"),
                                 words(direction[1], "is down", "is up"));
  if (direction[0] * direction[1] < 0) text += ": a mirrored view";
  if (direction[0] < 0 && direction[1] < 0) text += ": the camera lies upside down";
  return text;
}

}  // namespace

std::string against_bars(const PatternView& view, const PhotographLayout& layout, const LayoutSpan& span,
                         const std::vector<std::string>& files) {
  std::vector<BarShots> waves = waves_of(layout, span);
  if (!run_across(view, span)) {
    return fmt::format("{} are no {} bars", span.range(files), span.axis() == 0 ? "vertical" : "horizontal");
  }
  if (const std::string against = against_complements(view, layout, span, files); !against.empty())
    return against;
  if (becomes_finer(view, waves, span)) {
    for (size_t i = 0; i < (waves.size() + 1) / 2; ++i) {
      if (view.look(waves[i].lit).between > kSharp)
        return files[static_cast<size_t>(waves[i].lit)] + " shows no sharp bars";
    }
    return "";
  }
  std::ranges::reverse(waves);
  return fmt::format("the bars of {} {}", span.range(files),
                     becomes_finer(view, waves, span)
                         ? "become coarser from one to the next, and layouts go from coarse to fine"
                         : "do not become finer from one to the next");
}

absl::Status settle_bars(const PatternView& view, const std::vector<LayoutSpan>& spans,
                         PhotographLayout& layout, std::vector<std::string>& reasons) {
  const EdgeSurvey seen = survey(view, spans, layout);
  const double share = seen.all.also_edge / std::max(1.0, static_cast<double>(seen.count()));
  const bool binary = share > kMajority;
  if (seen.count() < kMinEdges || (!binary && share > 1.0 - kMajority)) {
    return absl::InvalidArgumentError(
        fmt::format("whether the bars are a Gray code or a binary one is not settled: of {} places where "
                    "bars have an edge, "
                    "{:.0f} % are edges of the next finer ones too (Gray: 0, binary: 100); pass --layout "
                    "opencv-graycode or "
                    "--layout binary, with --order and --inverse",
                    seen.count(), 100.0 * share));
  }
  layout.code = binary ? PatternCode::kBinary : PatternCode::kGray;
  reasons.push_back(fmt::format("of {} edges of bars {:.0f} % are edges of the next finer bars too: {}",
                                seen.count(), 100.0 * share,
                                binary ? "a binary code" : "a Gray code, no binary one"));
  if (layout.complements != Complements::kNone)
    reasons.push_back("the photographs come in pairs of complements");
  const bool inverted = !binary && seen.all.dark > seen.all.lit;
  if (inverted && layout.complements == Complements::kNone) {
    return absl::InvalidArgumentError(
        "the bars are the complements of a Gray code, without the code itself; pass --list");
  }
  if (inverted) layout.complements = Complements::kBefore;
  std::array<int, 2> direction{};
  for (size_t axis = 0; axis < 2; ++axis)
    direction[axis] = direction_of(seen.coarsest[axis]) * (inverted ? -1 : 1);
  if (binary && direction[0] + direction[1] < 0 && direction[0] * direction[1] >= 0) {
    return absl::InvalidArgumentError(
        fmt::format("{}, or else lit bars of the binary code stand for 0; if the first bar was dark, pass "
                    "{}, else --list",
                    direction_words(direction), options_of(layout)));
  }
  reasons.push_back(direction_words(direction));
  return absl::OkStatus();
}

}  // namespace glasswing
