#include "core/calibration/band_light.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace glasswing {
namespace {

constexpr size_t kGroups = 64;
// Of the light's swing: no panel's rise is closer to a straight line.
constexpr double kUneven = 0.01;

}  // namespace

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}
void centre(std::vector<double>& values) {
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  for (double& value : values) value -= mean;
}

std::vector<Track> tracks_of(const LightRecord& record) {
  const nanoseconds origin = record.shown.front().scanout_start;
  const size_t rows = record.frames.front().row_mean.size();
  const size_t groups = std::min(rows, kGroups);
  std::vector<Track> tracks(groups);
  for (size_t g = 0; g < groups; ++g) {
    const size_t first = g * rows / groups, last = (g + 1) * rows / groups;  // exclusive
    const double middle_row = 0.5 * static_cast<double>(first + last - 1);
    const double row_share = rows > 1 ? middle_row / static_cast<double>(rows - 1) : 0.0;
    for (const LightFrame& frame : record.frames) {
      const double start = seconds_of(frame.start - origin) + row_share * seconds_of(frame.readout);
      const auto begin = frame.row_mean.begin();
      tracks[g].start.push_back(start);
      tracks[g].end.push_back(start + seconds_of(frame.exposure));
      tracks[g].light.push_back(std::accumulate(begin + static_cast<std::ptrdiff_t>(first),
                                                begin + static_cast<std::ptrdiff_t>(last), 0.0) /
                                static_cast<double>(last - first));
    }
    centre(tracks[g].light);
    tracks[g].square = dot(tracks[g].light, tracks[g].light);
  }
  return tracks;
}

Band::Band(const LightRecord& record, size_t band) {
  bool lit = false;
  for (const BandChange& change : record.shown) {
    const bool now = change.lit == band;
    if (now == lit) continue;
    at_.push_back(seconds_of(change.scanout_start - record.shown.front().scanout_start));
    sign_.push_back(now ? 1.0 : -1.0);
    lit = now;
  }
  sum_.assign(at_.size() + 1, 0.0);
  moment_ = sum_;
  for (size_t k = 0; k < at_.size(); ++k) {
    sum_[k + 1] = sum_[k] + sign_[k];
    moment_[k + 1] = moment_[k] + sign_[k] * at_[k];
  }
}

std::vector<double> Band::seen_by(const Track& track, double centre, double settle) const {
  std::vector<double> seen(track.start.size());
  size_t done_from = 0, done_until = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    const double from = track.start[i], until = track.end[i];
    seen[i] = (integral(until - centre, settle, done_until) - integral(from - centre, settle, done_from)) /
              (until - from);
  }
  return seen;
}

// The integral of the light up to `t`, with each change half done at its own time. `t` must not decrease from
// call to call; `done` carries the position.
double Band::integral(double t, double settle, size_t& done) const {
  while (done < at_.size() && at_[done] <= t - 0.5 * settle) ++done;
  double light = t * sum_[done] - moment_[done];
  for (size_t k = done; k < at_.size() && at_[k] < t + 0.5 * settle; ++k) {
    const double under_way = t + 0.5 * settle - at_[k];
    light += sign_[k] * 0.5 * under_way * under_way / settle;  // settle > 0: at_[k] is past t - settle / 2
  }
  return light;
}

Left left_by(const std::vector<Band>& bands, const std::vector<Track>& tracks,
             const std::vector<double>& delays, double settle) {
  double all = 0.0, changed = 0.0;
  size_t count = 0, changed_count = 0;
  for (const Track& track : tracks) {
    std::vector<double> left = track.light;
    std::vector<bool> changes(left.size(), false);
    std::vector<std::vector<double>> columns;  // orthonormal
    const auto without = [](std::vector<double>& values, const std::vector<double>& column) {
      const double part = dot(values, column);
      for (size_t i = 0; i < values.size(); ++i) values[i] -= part * column[i];
    };
    for (size_t b = 0; b < bands.size(); ++b) {
      std::vector<double> seen = bands[b].seen_by(track, delays[b], settle);
      for (size_t i = 0; i < seen.size(); ++i)
        changes[i] = changes[i] || (seen[i] > 1e-6 && seen[i] < 1.0 - 1e-6);
      centre(seen);
      for (const std::vector<double>& column : columns) without(seen, column);
      const double length = std::sqrt(dot(seen, seen));
      if (length < 1e-6) continue;
      for (double& value : seen) value /= length;
      without(left, seen);
      columns.push_back(std::move(seen));
    }
    for (size_t i = 0; i < left.size(); ++i) {
      all += left[i] * left[i];
      ++count;
      if (!changes[i]) continue;
      changed += left[i] * left[i];
      ++changed_count;
    }
  }
  const auto n = static_cast<double>(count);
  const auto fitted = static_cast<double>(tracks.size() * (1 + bands.size()) + bands.size() + 1);
  const double mean = all / n,
               mean_changed = changed_count > 0 ? changed / static_cast<double>(changed_count) : 0.0;
  double light = 0.0;
  for (const Track& track : tracks) light += track.square;
  return {.square = all,
          .variance =
              std::max({mean, mean_changed, kUneven * kUneven * light / n}) * n / std::max(n - fitted, 1.0)};
}

}  // namespace glasswing
