#include "solver/corrections/knock_date.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr int kDatedRows = 48, kDatedColumns = 256;
constexpr size_t kWindow =
    6;  // frames whose fifth difference is next to nothing where light follows smoothly
constexpr std::array<double, kWindow> kDifference{-1.0, 5.0, -10.0, 10.0, -5.0, 1.0};
constexpr double kAgainst = 0.01;  // of the worst
constexpr double kClearly = 0.3;   // of the cost of other dates

// Consecutive frames of evenly spaced stripes.
using StripeRun = std::vector<int>;

bool are_alike(const v1::Frame& a, const v1::Frame& b) {
  const v1::Stimulus &own = a.stimulus(), &other = b.stimulus();
  return a.object() == b.object() && a.exposure_ms() == b.exposure_ms() && own.panel() == other.panel() &&
         own.phi_deg() == other.phi_deg() && own.sigma_px() == other.sigma_px() &&
         own.peak() == other.peak() && std::ranges::equal(own.colour(), other.colour());
}

std::vector<StripeRun> stripe_runs(const v1::CaptureManifest& manifest, const std::vector<int>& order,
                                   const std::vector<int>& frames) {
  std::vector<StripeRun> runs;
  double step_px = 0.0;
  bool broken = true;
  for (const int f : order) {
    const v1::Frame& own = manifest.frames(f);
    if (kind_of(own.stimulus()) != StimulusKind::kStripe || !std::ranges::binary_search(frames, f)) {
      broken = true;
      continue;
    }
    const v1::Frame* const last = broken ? nullptr : &manifest.frames(runs.back().back());
    const double from_last_px = last == nullptr ? 0.0 : own.stimulus().r_px() - last->stimulus().r_px();
    if (last == nullptr || !are_alike(own, *last) ||
        (runs.back().size() > 1 && std::abs(from_last_px - step_px) > 1e-3 * std::abs(step_px))) {
      runs.push_back({f});
    } else {
      step_px = from_last_px;
      runs.back().push_back(f);
    }
    broken = false;
  }
  return runs;
}

// Light of a row, by frame of the sweep and sampled lane; NaN where it is saturated.
absl::StatusOr<std::vector<std::vector<float>>> light_of(const LightReader& read, int y,
                                                         const StripeRun& sweep) {
  std::vector<int> ascending = sweep;
  std::ranges::sort(ascending);
  GW_ASSIGN_OR_RETURN(const FrameStack row, read(y, ascending));
  const int step = row.width_px / kDatedColumns + 1;
  std::vector<std::vector<float>> light(sweep.size());
  for (size_t i = 0; i < sweep.size(); ++i) {
    const auto codes = row.rows[sweep[i]];
    for (int x = 0; x < row.width_px; x += step) {
      for (const int c : row.channels(x, 0)) {
        const std::uint16_t code = codes[row.sample_index(x, 0, c)];
        light[i].push_back(code >= kSaturatedCode ? NAN : row.radiance(code));
      }
    }
  }
  return light;
}

// Adds, for each frame of the sweep, by how much smoother light is if frames are moved back from there on
// than if all or none of them are.
void add_scores(const std::vector<std::vector<float>>& still, const std::vector<std::vector<float>>& moved,
                std::vector<double>& scores) {
  for (size_t lane = 0; lane < still.front().size(); ++lane) {
    for (size_t first = 0; first + kWindow <= still.size(); ++first) {
      std::array<double, kWindow + 1> before{}, after{};  // sums of the differences' parts
      for (size_t i = 0; i < kWindow; ++i) {
        before[i + 1] = before[i] + kDifference[i] * still[first + i][lane];
        after[i + 1] = after[i] + kDifference[i] * moved[first + i][lane];
      }
      const double all = after[kWindow], none = before[kWindow];
      if (std::isnan(all) || std::isnan(none)) continue;
      for (size_t i = 1; i < kWindow; ++i) {
        const double from_here = before[i] + all - after[i];
        scores[first + i] += 0.5 * (all * all + none * none) - from_here * from_here;
      }
    }
  }
}

struct Candidate {
  int frame = 0;
  double score = 0.0;
};

// The clearest; otherwise, of those without contrary evidence, for example where stripes are not seen, the
// one nearest to `guess`.
int date_among(const std::vector<Candidate>& candidates, int guess) {
  std::vector<double> sizes;
  for (const Candidate& own : candidates) sizes.push_back(std::abs(own.score));
  const auto best = std::ranges::max_element(candidates, {}, &Candidate::score);
  if (best->score > kClearly * median(sizes)) return best->frame;
  const double against = -kAgainst * std::ranges::max(sizes);
  const auto at = std::ranges::find(candidates, guess, &Candidate::frame);
  auto nearest = candidates.end();
  for (auto own = candidates.begin(); own != candidates.end(); ++own) {
    if (own->score < against) continue;
    if (nearest == candidates.end() || std::abs(own - at) < std::abs(nearest - at)) nearest = own;
  }
  return nearest == candidates.end() ? guess : nearest->frame;
}

}  // namespace

absl::StatusOr<int> knock_date(const v1::CaptureManifest& manifest, const std::vector<int>& order,
                               const std::vector<int>& frames, int frame, const LightReader& still,
                               const LightReader& moved) {
  const std::vector<StripeRun> runs = stripe_runs(manifest, order, frames);
  const auto own = std::ranges::find_if(
      runs, [&](const StripeRun& sweep) { return std::ranges::find(sweep, frame) != sweep.end(); });
  if (own == runs.end()) return frame;
  std::vector<Candidate> candidates;
  for (auto run = own == runs.begin() ? own : std::prev(own); run != std::next(own); ++run) {
    std::vector<double> scores(run->size(), 0.0);
    const int height = manifest.camera().height_px(), rows = std::min(height, kDatedRows);
    for (int i = 0; i < rows && run->size() >= kWindow; ++i) {
      const int y = (2 * i + 1) * height / (2 * rows);
      GW_ASSIGN_OR_RETURN(const auto as_it_is, light_of(still, y, *run));
      GW_ASSIGN_OR_RETURN(const auto moved_back, light_of(moved, y, *run));
      add_scores(as_it_is, moved_back, scores);
    }
    for (size_t i = 0; i < run->size(); ++i) candidates.push_back({.frame = (*run)[i], .score = scores[i]});
  }
  return date_among(candidates, frame);
}

}  // namespace glasswing
