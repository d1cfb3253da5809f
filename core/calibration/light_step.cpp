#include "core/calibration/light_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/calibration/band_light.h"

namespace glasswing {
namespace {

// Seconds since the first change.
constexpr double kEarliest = -0.02, kLatest = 0.25;
constexpr double kMaxError = 1e-3;
constexpr size_t kGroupsPerBand = 4;  // the groups of rows that see the band best are fitted
constexpr size_t kFirstGrid = 33;     // points on each axis of delays, in the first grid
constexpr size_t kSettleGrid = 17;    // points on the axis of settling times
constexpr size_t kGrid = 9;           // points on every other axis
constexpr double kPossible = 16.0;    // sum of squares above the minimum, in sigma^2: 4 standard errors
// Of the light explained by the best lag: another lag that explains more makes it ambiguous.
constexpr double kResembling = 0.7;

nanoseconds time_of(double seconds) {
  return nanoseconds(std::llround(1e9 * seconds));
}

double shortest_hold(const LightRecord& record) {
  nanoseconds shortest = nanoseconds::max();
  for (size_t k = 1; k < record.shown.size(); ++k)
    shortest = std::min(shortest, record.shown[k].scanout_start - record.shown[k - 1].scanout_start);
  return seconds_of(shortest);
}

// The part of a group's sum of squares that one band explains alone. A lit band never darkens it.
double explained(const Track& track, std::vector<double> seen) {
  centre(seen);
  const double square = dot(seen, seen), along = dot(seen, track.light);
  return square > 1e-9 && along > 0.0 ? along * along / square : 0.0;
}

// An upper bound on what noise in this many groups explains by chance, in sigma^2: each group has a mean of 1
// and a variance of 2, and some hundred delays are tried.
double chance(size_t groups) {
  const auto n = static_cast<double>(groups);
  return n + 8.0 * std::sqrt(2.0 * n) + 30.0;
}

// A coarse estimate of one band's delay.
struct Sighting {
  bool seen = false;
  double centre = 0.0;
  double light = 0.0;               // sum of squares that it explains
  std::optional<double> elsewhere;  // another delay that fits nearly as well
  std::vector<size_t> groups;       // that see it best
};

Sighting look_for(const Band& band, const std::vector<Track>& tracks, double hold, double latest) {
  const double step = hold / 8.0;
  std::vector<double> total;
  for (double at = kEarliest; at <= latest; at += step) {
    total.push_back(0.0);
    for (const Track& track : tracks) total.back() += explained(track, band.seen_by(track, at, 0.0));
  }
  const auto at = [&](size_t i) { return kEarliest + static_cast<double>(i) * step; };
  const size_t best = std::max_element(total.begin(), total.end()) - total.begin();
  Sighting sighting{.centre = at(best), .light = total[best], .elsewhere = std::nullopt, .groups = {}};

  double square = 0.0;
  std::vector<std::pair<double, size_t>> by_light;
  for (size_t g = 0; g < tracks.size(); ++g) {
    square += tracks[g].square;
    by_light.emplace_back(explained(tracks[g], band.seen_by(tracks[g], sighting.centre, 0.0)), g);
  }
  const double noise =
      (square - sighting.light) / static_cast<double>(tracks.size() * tracks.front().light.size());
  sighting.seen = sighting.light > noise * chance(tracks.size());
  for (size_t i = 0; i < total.size(); ++i) {
    if ((i + 8 <= best || best + 8 <= i) && total[i] > kResembling * total[best]) sighting.elsewhere = at(i);
  }
  std::sort(by_light.rbegin(), by_light.rend());
  by_light.resize(std::min(by_light.size(), kGroupsPerBand));
  for (const auto& [light, g] : by_light) sighting.groups.push_back(g);
  return sighting;
}

// Subtracts a sighted band from the tracks.
std::vector<Track> without(std::vector<Track> tracks, const Band& band, const Sighting& sighting) {
  for (Track& track : tracks) {
    std::vector<double> seen = band.seen_by(track, sighting.centre, 0.0);
    centre(seen);
    const double square = dot(seen, seen);
    if (square < 1e-9) continue;
    const double part = dot(seen, track.light) / square;
    for (size_t i = 0; i < seen.size(); ++i) track.light[i] -= part * seen[i];
    track.square = dot(track.light, track.light);
  }
  return tracks;
}

struct Axis {
  double low = 0.0, high = 0.0;
  size_t points = kGrid;
  double step() const { return (high - low) / static_cast<double>(points - 1); }
  double at(size_t i) const { return low + step() * static_cast<double>(i); }
  // A closer axis around points `first` to `last`, with a margin of up to two steps on either side, since the
  // possible range may extend between points.
  Axis around(size_t first, size_t last) const {
    const double half = std::max(0.5 * (at(last) - at(first)) + step(), 2.0 * step());
    const double middle = 0.5 * (at(first) + at(last));
    return {.low = middle - half, .high = middle + half};
  }
  // True if hardly narrower than `before`.
  bool settled(const Axis& before) const {
    return points == before.points &&
           (high - low > 0.85 * (before.high - before.low) || before.step() < 1e-7);
  }
};

// The sums of squares for all delays on the axes, one per band; the last band's delay varies fastest.
std::vector<double> sums_of(const std::vector<Band>& bands, const std::vector<Track>& tracks,
                            const std::vector<Axis>& delays, double settle) {
  const size_t firsts = delays[0].points, seconds = bands.size() > 1 ? delays[1].points : 1;
  std::vector<double> sums(firsts * seconds, 0.0);
  for (const Track& track : tracks) {
    std::vector<std::vector<std::vector<double>>> seen(bands.size());
    for (size_t b = 0; b < bands.size(); ++b) {
      for (size_t i = 0; i < delays[b].points; ++i) {
        seen[b].push_back(bands[b].seen_by(track, delays[b].at(i), settle));
        centre(seen[b].back());
      }
    }
    for (size_t i = 0; i < firsts; ++i) {
      const std::vector<double>& a = seen[0][i];
      const double aa = dot(a, a), am = dot(a, track.light);
      for (size_t j = 0; j < seconds; ++j) {
        double& sum = sums[i * seconds + j];
        sum += track.square;
        if (bands.size() == 1) {
          sum -= aa > 1e-9 ? am * am / aa : 0.0;
          continue;
        }
        const std::vector<double>& b = seen[1][j];
        const double bb = dot(b, b), bm = dot(b, track.light), ab = dot(a, b);
        const double det = aa * bb - ab * ab;
        if (det > 1e-9 * aa * bb) sum -= (am * am * bb - 2.0 * am * bm * ab + bm * bm * aa) / det;
      }
    }
  }
  return sums;
}

// The posterior of the delays and, as last element, the settling time.
struct Possible {
  std::array<double, 3> mean{};
  std::array<std::array<double, 3>, 3> covariance{};

  void add(double weight, const std::array<double, 3>& x) {
    for (size_t a = 0; a < 3; ++a) {
      mean[a] += weight * x[a];
      for (size_t b = 0; b < 3; ++b) covariance[a][b] += weight * x[a] * x[b];
    }
  }
  // Call after adding points with weights that sum to 1.
  void finish() {
    for (size_t a = 0; a < 3; ++a) {
      for (size_t b = 0; b < 3; ++b) covariance[a][b] -= mean[a] * mean[b];
    }
  }
};

struct Delays {
  Possible possible;      // raw moments: finish() is not called
  double min_sum = 0.0;   // minimum sum of squares
  double variance = 0.0;  // sigma^2 at the minimum
  std::vector<Axis> axes;
  double log_volume = 0.0;  // of the posterior
};

// For a given settling time: narrows the axes, level by level, to the possible delays.
Delays possible_delays(const std::vector<Band>& bands, const std::vector<Track>& tracks,
                       std::vector<Axis> axes, double settle) {
  const size_t n = axes.size();
  while (true) {
    const std::vector<double> sums = sums_of(bands, tracks, axes, settle);
    const size_t seconds = n > 1 ? axes[1].points : 1;
    const auto indices = [&](size_t cell) { return std::array<size_t, 2>{cell / seconds, cell % seconds}; };
    const size_t best = std::min_element(sums.begin(), sums.end()) - sums.begin();
    std::vector<double> at(n);
    for (size_t a = 0; a < n; ++a) at[a] = axes[a].at(indices(best)[a]);
    Delays found;
    found.min_sum = sums[best];
    found.variance = left_by(bands, tracks, at, settle).variance;

    std::array<size_t, 2> first = indices(best), last = first;
    double total = 0.0;
    for (size_t cell = 0; cell < sums.size(); ++cell) {
      const double above = (sums[cell] - found.min_sum) / found.variance;
      total += std::exp(-0.5 * above);
      if (above > kPossible) continue;
      for (size_t a = 0; a < n; ++a) {
        first[a] = std::min(first[a], indices(cell)[a]);
        last[a] = std::max(last[a], indices(cell)[a]);
      }
    }
    std::vector<Axis> narrower;
    bool settled = true;
    for (size_t a = 0; a < n; ++a) {
      narrower.push_back(axes[a].around(first[a], last[a]));
      settled = settled && narrower[a].settled(axes[a]);
    }
    if (!settled) {
      axes = narrower;
      continue;
    }
    found.axes = axes;
    found.log_volume = std::log(total);
    for (size_t a = 0; a < n; ++a) found.log_volume += std::log(axes[a].step());
    for (size_t cell = 0; cell < sums.size(); ++cell) {
      std::array<double, 3> x{};
      for (size_t a = 0; a < n; ++a) x[a] = axes[a].at(indices(cell)[a]);
      x[2] = settle;
      found.possible.add(std::exp(-0.5 * (sums[cell] - found.min_sum) / found.variance) / total, x);
    }
    return found;
  }
}

// The same for settling times up to `longest`, each with its delays.
Possible possible_steps(const std::vector<Band>& bands, const std::vector<Track>& tracks,
                        std::vector<Axis> delays, double longest) {
  Axis settles{.low = 0.0, .high = longest, .points = kSettleGrid};
  while (true) {
    std::vector<Delays> found;
    for (size_t w = 0; w < settles.points; ++w)
      found.push_back(possible_delays(bands, tracks, delays, settles.at(w)));
    const auto best = std::min_element(
        found.begin(), found.end(), [](const Delays& a, const Delays& b) { return a.min_sum < b.min_sum; });
    const auto above = [&](size_t w) { return (found[w].min_sum - best->min_sum) / best->variance; };
    size_t first = settles.points, last = 0;
    for (size_t w = 0; w < settles.points; ++w) {
      if (above(w) > kPossible) continue;
      first = std::min(first, w);
      last = std::max(last, w);
    }
    Axis narrower = settles.around(first, last);
    narrower.low = std::max(narrower.low, 0.0);
    narrower.points = kSettleGrid;
    if (!narrower.settled(settles)) {
      // A longer settling time moves the middle of a change by at most half of the difference.
      for (size_t a = 0; a < delays.size(); ++a) {
        delays[a] = found[first].axes[a];
        for (size_t w = first; w <= last; ++w) {
          delays[a].low = std::min(delays[a].low, found[w].axes[a].low);
          delays[a].high = std::max(delays[a].high, found[w].axes[a].high);
        }
        delays[a].low -= settles.step();
        delays[a].high += settles.step();
      }
      settles = narrower;
      continue;
    }
    std::vector<double> weights;
    for (size_t w = 0; w < settles.points; ++w)
      weights.push_back(std::exp(-0.5 * above(w) + found[w].log_volume - best->log_volume));
    const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
    Possible possible;
    for (size_t w = 0; w < settles.points; ++w) {
      const Possible& part = found[w].possible;
      for (size_t a = 0; a < 3; ++a) {
        possible.mean[a] += weights[w] / total * part.mean[a];
        for (size_t b = 0; b < 3; ++b)
          possible.covariance[a][b] += weights[w] / total * part.covariance[a][b];
      }
    }
    possible.finish();
    return possible;
  }
}

LightStep::Estimate estimate(const Possible& possible, const std::array<double, 3>& factors) {
  double value = 0.0, variance = 0.0;
  for (size_t a = 0; a < 3; ++a) {
    value += factors[a] * possible.mean[a];
    for (size_t b = 0; b < 3; ++b) variance += factors[a] * factors[b] * possible.covariance[a][b];
  }
  return {.value = time_of(value), .error = time_of(std::sqrt(std::max(variance, 0.0)) + 1e-6)};
}

absl::Status check(const LightRecord& record) {
  const size_t rows = record.frames.empty() ? 0 : record.frames.front().row_mean.size();
  const bool alike = std::all_of(record.frames.begin(), record.frames.end(), [&](const LightFrame& frame) {
    return frame.row_mean.size() == rows && frame.exposure > nanoseconds(0);
  });
  if (rows == 0 || !alike || record.shown.size() < 2 || record.band_height.empty() ||
      record.band_height.size() > 2)
    return absl::InvalidArgumentError(fmt::format(
        "{} frames of {} rows, {} changes and {} bands; they must be frames of one size, 2 changes or more, "
        "and 1 or 2 bands",
        record.frames.size(), rows, record.shown.size(), record.band_height.size()));
  if (record.frames.size() < 16) {
    return absl::FailedPreconditionError(fmt::format(
        "the camera is too slow: it took {} frames while {} changes were shown; it must take 16 or more",
        record.frames.size(), record.shown.size()));
  }
  return absl::OkStatus();
}

// The bands that are seen, the brighter one first, with their sightings and heights.
struct SeenBands {
  std::vector<Band> bands;
  std::vector<Sighting> sightings;
  std::vector<double> heights;
};

absl::StatusOr<SeenBands> sight_bands(const LightRecord& record, const std::vector<Track>& tracks,
                                      double hold) {
  const double latest = kLatest + seconds_of(record.scanout);
  SeenBands seen{.bands = {}, .sightings = {}, .heights = record.band_height};
  for (size_t b = 0; b < record.band_height.size(); ++b) {
    seen.bands.emplace_back(record, b);
    seen.sightings.push_back(look_for(seen.bands[b], tracks, hold, latest));
  }
  if (seen.bands.size() == 2 && seen.sightings[1].light > seen.sightings[0].light) {
    std::swap(seen.bands[0], seen.bands[1]);
    std::swap(seen.sightings[0], seen.sightings[1]);
    std::swap(seen.heights[0], seen.heights[1]);
  }
  const Sighting& brighter = seen.sightings[0];
  if (!brighter.seen) {
    return absl::FailedPreconditionError(
        "no light change was seen: the monitor must be in the camera's view, itself or through the object, "
        "and bright enough for the exposure");
  }
  if (brighter.elsewhere) {
    return absl::FailedPreconditionError(
        fmt::format("the lag is ambiguous: light {:.1f} ms after the scan-out fits nearly as well as {:.1f} "
                    "ms; what is shown must not repeat itself",
                    1e3 * *brighter.elsewhere, 1e3 * brighter.centre));
  }
  if (seen.bands.size() == 2) {
    seen.sightings[1] = look_for(seen.bands[1], without(tracks, seen.bands[0], brighter), hold, latest);
    if (!seen.sightings[1].seen || seen.sightings[1].elsewhere) seen.bands.pop_back();
  }
  return seen;
}

// The tracks that see any of the bands best.
std::vector<Track> best_tracks(const SeenBands& seen, const std::vector<Track>& tracks) {
  std::vector<size_t> groups;
  for (size_t b = 0; b < seen.bands.size(); ++b)
    groups.insert(groups.end(), seen.sightings[b].groups.begin(), seen.sightings[b].groups.end());
  std::sort(groups.begin(), groups.end());
  groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
  std::vector<Track> best;
  for (const size_t g : groups) best.push_back(tracks[g]);
  return best;
}

}  // namespace

absl::StatusOr<LightStep> find_light_step(const LightRecord& record) {
  if (const absl::Status status = check(record); !status.ok()) return status;
  const std::vector<Track> tracks = tracks_of(record);
  const double hold = shortest_hold(record);
  absl::StatusOr<SeenBands> seen = sight_bands(record, tracks, hold);
  if (!seen.ok()) return seen.status();
  std::vector<Band>& bands = seen->bands;
  std::vector<Axis> axes;
  for (size_t b = 0; b < bands.size(); ++b) {
    axes.push_back({.low = seen->sightings[b].centre - hold / 4.0,
                    .high = seen->sightings[b].centre + hold / 4.0,
                    .points = kFirstGrid});
  }
  const std::vector<Track> fitted = best_tracks(*seen, tracks);
  Possible possible = possible_steps(bands, fitted, axes, hold);
  if (bands.size() == 2) {
    // Drop the fainter band unless it explains light that the brighter one alone does not.
    const double settle = possible.mean[2];
    const Left both = left_by(bands, fitted, {possible.mean[0], possible.mean[1]}, settle);
    const Left one = left_by({bands[0]}, fitted, {possible.mean[0]}, settle);
    if (one.square - both.square <= both.variance * chance(fitted.size())) {
      bands.pop_back();
      axes.pop_back();
      possible = possible_steps(bands, fitted, axes, hold);
    }
  }
  LightStep step;
  step.settle = estimate(possible, {0.0, 0.0, 1.0});
  const std::vector<double>& heights = seen->heights;
  if (bands.size() == 2) {
    // The line through both heights, at the first row.
    const double apart = heights[1] - heights[0];
    step.lag = estimate(possible, {heights[1] / apart, -heights[0] / apart, -0.5});
    step.scanout = estimate(possible, {-1.0 / apart, 1.0 / apart, 0.0});
  } else {
    step.lag = estimate(possible, {1.0, 0.0, -0.5});
    step.lag.value -= time_of(heights[0] * seconds_of(record.scanout));
  }
  if (step.lag.error > time_of(kMaxError)) {
    return absl::FailedPreconditionError(
        fmt::format("the camera is too slow or sees too little: the lag is {:.1f} ms, give or take {:.1f}; "
                    "use a longer exposure (up to the time between frames) or a faster camera",
                    1e3 * seconds_of(step.lag.value), 1e3 * seconds_of(step.lag.error)));
  }
  return step;
}

std::vector<std::optional<size_t>> band_sequence() {
  std::vector<int> symbols{0, 0, 0, 1};
  while (symbols.size() < 80) {
    const size_t n = symbols.size();
    symbols.push_back((2 * symbols[n - 3] + symbols[n - 4]) % 3);
  }
  std::vector<std::optional<size_t>> lit;
  for (const int symbol : symbols)
    lit.push_back(symbol == 0 ? std::nullopt : std::optional<size_t>(static_cast<size_t>(symbol - 1)));
  return lit;
}

}  // namespace glasswing
