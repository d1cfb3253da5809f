#include "solver/mosaic/mosaic_matte.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "core/base/for_rows.h"
#include "solver/mosaic/edge_fit.h"

namespace glasswing {
namespace {

constexpr int kReach = kMosaicReach, kSide = 2 * kReach + 1, kSites = kSide * kSide;
static_assert(kReach <= kEdgeReach);
constexpr size_t kMaxPaths = 12;  // of a channel around a pixel
constexpr int kRounds = 6;        // of a robust fit
constexpr double kFirstPx = 6.0,
                 kTighter = 0.4;    // off the plane: of its first round, and from round to round
constexpr double kNearness = 0.35;  // sites count exp(-that r^2), r in px
constexpr double kRidge = 1e-3;     // of slopes: 0 where nothing tells of them
constexpr double kNoLight = 1e-9;
// Between modes of one path: at once, and per pixel of the picture; between those of two channels.
constexpr double kNearPx = 4.0, kFarPx = 6.0, kDispersionPx = 48.0;
constexpr double kOnPlanePx = 0.7, kOnPlane = 0.1;  // places about their plane; the latter in widths
constexpr double kOff = 3.0, kApart = 2.0;      // a path's modes about its plane: in the above, and in widths
constexpr double kWider = 3.0, kWiderPx = 2.0;  // a path's modes than one another
// Paths of two channels are the same by the sites that both take over those that either takes, less their
// distance over kUnlikePx.
constexpr double kUnlikePx = 24.0, kLeastAlike = -0.5;
constexpr double kFaint = 0.01;  // of a site's light: an edge is not worth finding
constexpr double kEven = 0.1;    // sites beside a pixel agree: their light differs by this part of the most

struct Place {
  double x_px = 0.0, y_px = 0.0;
};
double between(const Place& a, const Place& b) {
  return std::hypot(a.x_px - b.x_px, a.y_px - b.y_px);
}
Place place_of(const Mode& mode) {
  return {mode.x_px, mode.y_px};
}
double width_px(const Mode& mode) {
  return std::sqrt(std::max(0.5 * static_cast<double>(mode.xx_px2 + mode.yy_px2), 0.0));
}
double tolerance_px(const Mode& mode) {
  return kOnPlanePx + kOnPlane * width_px(mode);
}

bool are_alike_wide(double a_px, double b_px) {
  return a_px <= kWider * b_px + kWiderPx && b_px <= kWider * a_px + kWiderPx;
}

// The mode that has the light of both, and their mean and spread.
Mode merged(const Mode& a, const Mode& b) {
  const float weight = a.weight + b.weight, share = b.weight / weight;
  const float dx = b.x_px - a.x_px, dy = b.y_px - a.y_px, spread = share * (1.0f - share);
  const auto mean = [share](float from, float to) { return from + share * (to - from); };
  return {.weight = weight,
          .x_px = mean(a.x_px, b.x_px),
          .y_px = mean(a.y_px, b.y_px),
          .xx_px2 = mean(a.xx_px2, b.xx_px2) + spread * dx * dx,
          .xy_px2 = mean(a.xy_px2, b.xy_px2) + spread * dx * dy,
          .yy_px2 = mean(a.yy_px2, b.yy_px2) + spread * dy * dy,
          .texture = a.texture};
}

// A site of the window around a pixel.
struct Site {
  int dx = 0, dy = 0, channel = 0;
  std::span<const Mode> modes;
  double nearness = 1.0;
  std::array<double, kMaxModes> light{};      // by mode: what arrives of it before a white monitor
  double whole = 0.0;                         // of all modes
  std::array<std::int8_t, kMaxModes> path{};  // of its channel, by mode; -1: none yet

  int distance2() const { return dx * dx + dy * dy; }
  bool is_beside(int other_dx, int other_dy) const {
    return std::max(std::abs(dx - other_dx), std::abs(dy - other_dy)) <= 1;
  }
};

// A path of light around a pixel, as one channel sees it: place + slope times the way in the picture.
struct Path {
  int texture = 0;
  Place place;
  std::array<double, 4> slope{};       // monitor px per picture px: x by x, x by y, y by x, y by y
  std::array<double, kSites> light{};  // by site
  double whole = 0.0;                  // the light of a site that it takes wholly

  // How much of a site it takes.
  double part(size_t site) const { return std::min(light[site] / whole, 1.0); }
  Place at(int dx, int dy) const {
    return {place.x_px + slope[0] * dx + slope[1] * dy, place.y_px + slope[2] * dx + slope[3] * dy};
  }
};

// Weighted least squares of a plane through places. Slopes that these do not tell are those of `guess`.
class PlaneFit {
 public:
  explicit PlaneFit(const std::array<double, 4>& guess) : guess_(guess) {}
  void add(int dx, int dy, const Place& place, double weight) {
    const std::array<double, 3> row{1.0, static_cast<double>(dx), static_cast<double>(dy)};
    for (size_t j = 0; j < 3; ++j) {
      for (size_t k = 0; k < 3; ++k) normal_[j][k] += weight * row[j] * row[k];
      right_[j][0] += weight * row[j] * (place.x_px - guess_[0] * dx - guess_[1] * dy);
      right_[j][1] += weight * row[j] * (place.y_px - guess_[2] * dx - guess_[3] * dy);
    }
  }
  void solve(Place& place, std::array<double, 4>& slope) {
    normal_[1][1] += kRidge;
    normal_[2][2] += kRidge;
    for (size_t j = 0; j < 3; ++j) {
      for (size_t k = j + 1; k < 3; ++k) {
        const double factor = normal_[k][j] / normal_[j][j];
        for (size_t l = j; l < 3; ++l) normal_[k][l] -= factor * normal_[j][l];
        for (size_t n = 0; n < 2; ++n) right_[k][n] -= factor * right_[j][n];
      }
    }
    std::array<std::array<double, 2>, 3> found{};
    for (size_t j = 3; j-- > 0;) {
      for (size_t n = 0; n < 2; ++n) {
        double value = right_[j][n];
        for (size_t k = j + 1; k < 3; ++k) value -= normal_[j][k] * found[k][n];
        found[j][n] = value / normal_[j][j];
      }
    }
    place = {found[0][0], found[0][1]};
    slope = {guess_[0] + found[1][0], guess_[1] + found[2][0], guess_[2] + found[1][1],
             guess_[3] + found[2][1]};
  }

 private:
  const std::array<double, 4> guess_;
  std::array<std::array<double, 3>, 3> normal_{};
  std::array<std::array<double, 2>, 3> right_{};
};

// What arrives of each mode that was measured, before a white monitor.
class Lights {
 public:
  Lights(const Matte& matte, const Mosaic& mosaic)
      : width_(static_cast<size_t>(matte.width_px())),
        modes_(static_cast<size_t>(matte.modes_per_channel())) {
    for (int y = 0; y < matte.height_px(); ++y) {
      for (int x = 0; x < matte.width_px(); ++x) {
        for (const Mode& mode : matte.modes(x, y, mosaic.channel(matte.x0_px() + x, matte.y0_px() + y)))
          light_.push_back(mode.weight > 0.0f ? light_of(mode, matte.metadata) : 0.0);
      }
    }
  }
  // By mode.
  const double* of(int x, int y) const { return &light_[(static_cast<size_t>(y) * width_ + x) * modes_]; }

 private:
  static double light_of(const Mode& mode, const v1::MatteMetadata& metadata) {
    const v1::Monitor& monitor = metadata.monitors(mode.texture);
    const auto inside = [](float middle, float variance, int side) {
      const double scale = std::sqrt(0.5 / (variance + 1.0 / 12.0)), at = middle;
      return 0.5 * (std::erf((side - at) * scale) + std::erf(at * scale));
    };
    return mode.weight * inside(mode.x_px, mode.xx_px2, monitor.width_px()) *
           inside(mode.y_px, mode.yy_px2, monitor.height_px());
  }

  const size_t width_, modes_;
  std::vector<double> light_;
};

class Filler {
 public:
  Filler(Matte& matte, const Mosaic& mosaic, const Lights& lights)
      : matte_(matte), mosaic_(mosaic), lights_(lights) {
    for (size_t i = 0; i < nearness_.size(); ++i)
      nearness_[i] = std::exp(-kNearness * static_cast<double>(i));
  }

  void fill(int x, int y) {
    look_around(x, y);
    fill_foreground(x, y);
    if ((matte_.flags(x, y) & kFlagNoData) != 0) return;
    find_paths(own_);
    for (int c = 0; c < kChannels; ++c) {
      if (c != own_) find_paths(c);
    }
    for (int c = 0; c < kChannels; ++c) {
      if (c != own_) fill_modes(c, matte_.modes(x, y, c));
    }
  }

 private:
  int channel(int x, int y) const { return mosaic_.channel(matte_.x0_px() + x, matte_.y0_px() + y); }

  void look_around(int x, int y) {
    own_ = channel(x, y);
    sites_.clear();
    for (int dy = -kReach; dy <= kReach; ++dy) {
      for (int dx = -kReach; dx <= kReach; ++dx) {
        const int at_x = x + dx, at_y = y + dy;
        if (at_x < 0 || at_y < 0 || at_x >= matte_.width_px() || at_y >= matte_.height_px()) continue;
        if ((matte_.flags(at_x, at_y) & kFlagNoData) != 0) continue;
        const int c = channel(at_x, at_y);
        Site& site = sites_.emplace_back(
            Site{.dx = dx, .dy = dy, .channel = c, .modes = std::as_const(matte_).modes(at_x, at_y, c)});
        site.nearness = nearness_[site.distance2()];
        const double* const light = lights_.of(at_x, at_y);
        for (size_t m = 0; m < site.modes.size(); ++m) {
          site.light[m] = light[m];
          site.whole += light[m];
        }
      }
    }
  }

  void fill_foreground(int x, int y) {
    std::array<float, kChannels> sum{}, count{};
    for (const Site& site : sites_) {
      if (!site.is_beside(0, 0)) continue;
      const size_t c = site.channel;
      sum[c] += matte_.foreground(x + site.dx, y + site.dy)[c];
      count[c] += 1.0f;
    }
    for (size_t c = 0; c < kChannels; ++c) {
      if (static_cast<int>(c) != own_ && count[c] > 0.0f) matte_.foreground(x, y)[c] = sum[c] / count[c];
    }
  }

  void find_paths(int c) {
    std::vector<Path>& paths = paths_[c];
    paths.clear();
    order_.clear();
    for (size_t i = 0; i < sites_.size(); ++i) {
      if (sites_[i].channel != c) continue;
      sites_[i].path.fill(-1);
      order_.push_back(i);
    }
    std::ranges::stable_sort(order_, {}, [&](size_t i) { return sites_[i].distance2(); });
    for (const size_t i : order_) {
      for (size_t m = 0; m < sites_[i].modes.size(); ++m) {
        const bool seen = sites_[i].modes[m].weight > 0.0f && sites_[i].path[m] < 0;
        if (seen && paths.size() < kMaxPaths) follow(c, sites_[i], m);
      }
    }
  }

  // Slopes are much the same in all channels; the own channel always has sites in two rows and columns.
  std::array<double, 4> slope_guess(int c, const Mode& mode) const {
    std::array<double, 4> slope{};
    double least_px = kDispersionPx;
    for (const Path& path : paths_[own_]) {
      const double away_px = between(path.place, place_of(mode));
      if (c == own_ || path.texture != mode.texture || away_px >= least_px) continue;
      least_px = away_px;
      slope = path.slope;
    }
    return slope;
  }

  // Follows the path of a mode from site to site.
  void follow(int c, Site& from, size_t seed) {
    std::vector<Path>& paths = paths_[c];
    const Mode& start = from.modes[seed];
    Path path{.texture = start.texture, .place = place_of(start)};
    std::array<const Mode*, kSites> nearest{};
    std::array<double, kSites> trust{};
    for (const size_t i : order_) {
      const Site& site = sites_[i];
      double limit_px = kNearPx + width_px(start) + kFarPx * std::hypot(site.dx - from.dx, site.dy - from.dy);
      for (size_t m = 0; m < site.modes.size(); ++m) {
        const double away_px = between(place_of(site.modes[m]), path.place);
        if (site.path[m] >= 0 || site.modes[m].texture != start.texture || away_px >= limit_px) continue;
        if (!(site.modes[m].weight > 0.0f)) continue;
        if (!are_alike_wide(width_px(site.modes[m]), width_px(start))) continue;
        limit_px = away_px;
        nearest[i] = &site.modes[m];
      }
      trust[i] = nearest[i] != nullptr ? 1.0 : 0.0;
    }
    const double tolerance = tolerance_px(start);
    const std::array<double, 4> guess = slope_guess(c, start);
    double reach_px = kFirstPx;
    for (int round = 0; round < kRounds; ++round, reach_px *= kTighter) {
      PlaneFit fit(guess);
      for (const size_t i : order_) {
        if (trust[i] > 0.0)
          fit.add(sites_[i].dx, sites_[i].dy, place_of(*nearest[i]), trust[i] * sites_[i].nearness);
      }
      fit.solve(path.place, path.slope);
      const double wide_px = std::max(tolerance, reach_px);
      for (const size_t i : order_) {
        if (trust[i] <= 0.0 || &sites_[i] == &from) continue;
        const double miss = between(place_of(*nearest[i]), path.at(sites_[i].dx, sites_[i].dy)) / wide_px;
        trust[i] = 1.0 / ((1.0 + miss * miss) * (1.0 + miss * miss));
      }
    }
    const auto number = static_cast<std::int8_t>(paths.size());
    double sum = 0.0, squares = 0.0;
    for (const size_t i : order_) {
      Site& site = sites_[i];
      const bool own = &site == &from;
      const Place place = path.at(site.dx, site.dy);
      for (size_t m = 0; m < site.modes.size(); ++m) {
        const Mode& mode = site.modes[m];
        if (!(mode.weight > 0.0f) || site.path[m] >= 0 || mode.texture != path.texture) continue;
        // Fits split a path into modes side by side.
        const double near_px = kOff * tolerance_px(mode) + kApart * width_px(mode);
        const bool near =
            between(place_of(mode), place) <= near_px && are_alike_wide(width_px(mode), width_px(start));
        if (!near && !(own && m == seed)) continue;
        site.path[m] = number;
        path.light[i] += site.light[m];
      }
      sum += site.nearness * path.light[i];
      squares += site.nearness * path.light[i] * path.light[i];
    }
    path.whole = std::max(squares / std::max(sum, kNoLight), kNoLight);
    paths.push_back(path);
  }

  // The path of another channel that is the same; null: none is alike.
  const Path* same_path(const Path& path, int c, int other_channel) const {
    const Path* same = nullptr;
    double best = kLeastAlike;
    for (const Path& other : paths_[other_channel]) {
      const double away_px = between(other.place, path.place);
      if (other.texture != path.texture || away_px > kDispersionPx) continue;
      double both = 0.0, either = 0.0;
      for (size_t i = 0; i < sites_.size(); ++i) {
        if (sites_[i].channel != c) continue;
        double beside = 0.0, count = 0.0;
        for (size_t k = 0; k < sites_.size(); ++k) {
          if (sites_[k].channel != other_channel || !sites_[k].is_beside(sites_[i].dx, sites_[i].dy))
            continue;
          beside += other.part(k);
          count += 1.0;
        }
        if (count == 0.0) continue;
        const double here = path.part(i);
        both += sites_[i].nearness * std::min(here, beside / count);
        either += sites_[i].nearness * std::max(here, beside / count);
      }
      const double alike = either > 0.0 ? both / either - away_px / kUnlikePx : -away_px / kUnlikePx;
      if (alike <= best) continue;
      best = alike;
      same = &other;
    }
    return same;
  }

  // How much of the pixel a path of this channel takes.
  double part_of_pixel(const Path& path, int c) const {
    std::array<const Path*, kChannels> same{};
    for (int other = 0; other < kChannels; ++other)
      same[other] = other == c ? &path : same_path(path, c, other);
    std::array<EdgeSample, kSites> samples;
    size_t count = 0;
    for (size_t i = 0; i < sites_.size(); ++i) {
      const Site& site = sites_[i];
      if (const Path* own = same[site.channel]; own != nullptr)
        samples[count++] = {.dx = site.dx, .dy = site.dy, .channel = site.channel, .part = own->part(i)};
    }
    return part_by_edge({samples.data(), count}, own_, c);
  }

  void fill_modes(int c, std::span<Mode> to) {
    found_.clear();
    double least = INFINITY, most = 0.0, sum = 0.0;
    for (const Site& site : sites_) {
      if (site.channel != c || !site.is_beside(0, 0)) continue;
      least = std::min(least, site.whole);
      most = std::max(most, site.whole);
    }
    const std::vector<Path>& paths = paths_[c];
    for (size_t p = 0; p < paths.size(); ++p) sum += carry_over(paths[p], static_cast<std::int8_t>(p), c);
    if (sum > 0.0) {
      const auto scale = static_cast<float>(std::clamp(sum, least, most) / sum);
      for (Mode& mode : found_) mode.weight *= scale;
    }
    store(to);
  }

  // Adds the path's modes at the pixel. Returns their light.
  double carry_over(const Path& path, std::int8_t number, int c) {
    double least = INFINITY, most = 0.0, mean = 0.0, count = 0.0, all = 0.0;
    int nearest = 2 * kSites;
    for (size_t i = 0; i < sites_.size(); ++i) {
      const Site& site = sites_[i];
      if (site.channel != c) continue;
      if (path.light[i] > 0.0) nearest = std::min(nearest, site.distance2());
      if (!site.is_beside(0, 0)) continue;
      least = std::min(least, path.light[i]);
      most = std::max(most, path.light[i]);
      mean += path.light[i];
      all = std::max(all, site.whole);
      count += 1.0;
    }
    if (most <= 0.0) return 0.0;
    const double light = most - least < kEven * most || most < kFaint * all
                             ? mean / count
                             : std::clamp(path.whole * part_of_pixel(path, c), least, most);
    double donated = 0.0;
    for (size_t i = 0; i < sites_.size(); ++i) {
      if (sites_[i].channel == c && sites_[i].distance2() == nearest) donated += path.light[i];
    }
    for (const Site& site : sites_) {
      if (site.channel != c || site.distance2() != nearest) continue;
      for (size_t m = 0; m < site.modes.size(); ++m) {
        if (site.path[m] != number) continue;
        Mode mode = site.modes[m];
        mode.weight *= static_cast<float>(light / std::max(donated, kNoLight));
        mode.x_px -= static_cast<float>(path.slope[0] * site.dx + path.slope[1] * site.dy);
        mode.y_px -= static_cast<float>(path.slope[2] * site.dx + path.slope[3] * site.dy);
        mode.weight_sd = mode.centre_sd_px = 0.0f;  // not known
        if (mode.weight > 0.0f) found_.push_back(mode);
      }
    }
    return light;
  }

  void store(std::span<Mode> to) {
    // Donors' modes of one path lie side by side.
    std::ranges::stable_sort(found_, std::ranges::greater{}, &Mode::weight);
    std::vector<Mode>& kept = kept_;
    kept.clear();
    for (const Mode& mode : found_) {
      const auto same = std::ranges::find_if(kept, [&](const Mode& other) {
        return other.texture == mode.texture && are_alike_wide(width_px(other), width_px(mode)) &&
               between(place_of(other), place_of(mode)) <=
                   kOnPlanePx + 0.5 * (width_px(other) + width_px(mode));
      });
      if (same == kept.end()) {
        kept.push_back(mode);
      } else {
        *same = merged(*same, mode);
      }
    }
    std::ranges::stable_sort(kept, std::ranges::greater{}, &Mode::weight);
    std::ranges::fill(to, Mode{});
    std::copy_n(kept.begin(), std::min(kept.size(), to.size()), to.begin());
  }

  Matte& matte_;
  const Mosaic& mosaic_;
  const Lights& lights_;
  std::array<double, 2 * kReach * kReach + 1> nearness_;  // by squared distance
  int own_ = 0;
  std::vector<Site> sites_;
  std::vector<size_t> order_;
  std::array<std::vector<Path>, kChannels> paths_;
  std::vector<Mode> found_, kept_;
};

}  // namespace

void fill_channels(Matte& matte, const Mosaic& mosaic, int thread_count) {
  const Lights lights(matte, mosaic);
  // What a pixel gets is read by no other.
  for_rows(matte.height_px(), thread_count, [&](int first, int last) {
    Filler filler(matte, mosaic, lights);
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < matte.width_px(); ++x) filler.fill(x, y);
    }
  });
}

Matte rows_of(const Matte& matte, int first, int count) {
  Matte rows(matte.x0_px(), matte.y0_px() + first, matte.width_px(), count, matte.modes_per_channel(),
             matte.is_colourless());
  rows.metadata = matte.metadata;
  for (int y = 0; y < count; ++y) {
    for (int x = 0; x < matte.width_px(); ++x) rows.copy_pixel(matte, x, first + y, x, y);
  }
  return rows;
}

}  // namespace glasswing
