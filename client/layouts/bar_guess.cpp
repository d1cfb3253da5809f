#include "client/layouts/bar_guess.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace glasswing {
namespace {

constexpr double kMaxSurveyed = 0.05;  // edges per pixel; with more, a blurred edge reaches the next
constexpr double kClear = 0.6;         // contrast, without complements
constexpr int kMinEdges = 10;          // that a decision needs
constexpr int kMinDirected = 5;        // of the coarsest bars, one per line
constexpr double kMajority = 0.75;

// Coarse to fine.
std::vector<BarShots> waves_of(const LayoutSpan& span, bool pairs) {
  std::vector<BarShots> waves;
  for (int i = span.first; i < span.first + span.count; i += pairs ? 2 : 1)
    waves.push_back({.lit = i, .complement = pairs ? i + 1 : -1});
  return waves;
}

// What the edges of all waves say about the code: each pair of neighbouring waves has a vote, so that a bad
// photograph, which is in two pairs, is outvoted.
struct EdgeSurvey {
  int edges = 0;
  double binary = 0.0, gray = 0.0, inverted_gray = 0.0;  // votes
  double share_of_binary = 0.0;                          // of all edges
};

EdgeSurvey survey(const PatternView& view, const std::array<std::vector<BarShots>, 2>& waves, bool pairs) {
  EdgeSurvey result;
  double also_edges = 0.0;
  for (size_t axis = 0; axis < 2; ++axis) {
    for (size_t i = 0; i + 1 < waves[axis].size(); ++i) {
      const PatternView::Look &coarse = view.look(waves[axis][i].lit),
                              &fine = view.look(waves[axis][i + 1].lit);
      if (!coarse.has_bars() || !fine.has_bars() || fine.density[axis] > kMaxSurveyed) continue;
      if (!pairs && fine.high - fine.low < kClear) continue;
      const PatternView::EdgeCounts counts = view.edges(waves[axis][i], waves[axis][i + 1], axis);
      if (counts.decided() == 0) continue;
      const double total = counts.decided(), weight = std::min(1.0, total / kMinEdges);
      result.edges += counts.decided();
      also_edges += counts.also_edge;
      if (counts.also_edge > kMajority * total) result.binary += weight;
      if (counts.lit > kMajority * total) result.gray += weight;
      if (counts.dark > kMajority * total) result.inverted_gray += weight;
    }
  }
  result.share_of_binary = also_edges / std::max(1, result.edges);
  return result;
}

// 1: the coarsest bars are dark, then lit, along the pictures' axis; -1: lit, then dark; 0: not seen. In a
// Gray code the next finer bars are dark, lit, dark: they give no information.
int direction_of(const PatternView& view, const std::vector<BarShots>& waves, size_t axis) {
  if (waves.empty()) return 0;
  const PatternView::EdgeCounts counts = view.edges(waves.front(), waves.front(), axis);
  const int edges = counts.rising + counts.falling;
  if (edges < kMinDirected) return 0;
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
  if (direction[0] < 0 && direction[1] < 0) text += ": the camera is upside down";
  return text;
}

}  // namespace

absl::StatusOr<BarsSeen> settle_bars(const PatternView& view, const std::vector<LayoutSpan>& spans,
                                     PhotographLayout& layout, std::vector<std::string>& reasons) {
  BarsSeen bars;
  const bool pairs = layout.complements != Complements::kNone;
  for (const LayoutSpan& span : spans) {
    if (span.block == LayoutBlock::kColumns || span.block == LayoutBlock::kRows)
      bars.waves[span.axis()] = waves_of(span, pairs);
  }
  const EdgeSurvey seen = survey(view, bars.waves, pairs);
  const double gray_votes = seen.gray + seen.inverted_gray;
  const bool binary = seen.binary > gray_votes;
  if (seen.edges < kMinEdges || std::max(seen.binary, gray_votes) < kMajority * (seen.binary + gray_votes) ||
      seen.binary + gray_votes == 0.0) {
    return absl::InvalidArgumentError(fmt::format(
        "the bars may be a Gray code or a binary code: of {} places where bars have an edge, {:.0f} % are "
        "also edges of the next finer ones (Gray: 0, binary: 100); pass --layout opencv-graycode or --layout "
        "binary, with --order and --inverse",
        seen.edges, 100.0 * seen.share_of_binary));
  }
  layout.code = binary ? PatternCode::kBinary : PatternCode::kGray;
  reasons.push_back(fmt::format("of {} edges of bars {:.0f} % are also edges of the next finer bars: {}",
                                seen.edges, 100.0 * seen.share_of_binary,
                                binary ? "a binary code" : "a Gray code, not a binary one"));
  if (pairs) reasons.push_back("the photographs come in pairs of complements");
  const bool inverted = !binary && seen.inverted_gray > seen.gray;
  if (inverted && !pairs) {
    return absl::InvalidArgumentError(
        "the bars are the complements of a Gray code, without the code itself; pass --list");
  }
  if (inverted) layout.complements = Complements::kBefore;
  for (size_t axis = 0; axis < 2; ++axis) {
    if (inverted) {
      for (BarShots& wave : bars.waves[axis]) std::swap(wave.lit, wave.complement);
    }
    bars.direction[axis] = direction_of(view, bars.waves[axis], axis);
  }
  if (binary && bars.direction[0] + bars.direction[1] < 0 && bars.direction[0] * bars.direction[1] >= 0) {
    return absl::InvalidArgumentError(
        fmt::format("{}, unless lit bars of the binary code mean 0: if the first bar was dark, pass "
                    "{}; otherwise pass --list",
                    direction_words(bars.direction), options_of(layout)));
  }
  reasons.push_back(direction_words(bars.direction));
  return bars;
}

}  // namespace glasswing
