#include "solver/gaussian/mode_search.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace glasswing {
namespace {

constexpr int kMaxMeetings = 12;
constexpr int kFirstIterations = 6;  // of each start, before choosing among them
constexpr int kIterations = 80;

struct Meeting {
  Footprint mode;
  double score = 0.0;
};

std::vector<StripeAxis> axes_of(const SampleLayout& layout) {
  std::vector<StripeAxis> axes;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) axes.push_back(sweep.axis);
  return axes;
}

double centre_of(const Footprint& mode, const StripeAxis& axis) {
  return mode.x_px * axis.cos_phi + mode.y_px * axis.sin_phi;
}

// The light of a peak: R, if it belongs to one mode (amplitude sigma_r = R sigma_s in every sweep).
double light_of(const Peak& peak, const StripeAxis& axis) {
  return peak.amplitude * peak.sigma_px / axis.sigma_px;
}

// Crossings of a peak of one sweep with a peak of another where every further sweep has a peak too. In two of
// them it may be hidden in the flank of a much brighter one.
bool meet(std::span<const StripeAxis> axes, std::span<const Peaks> peaks, size_t first, const Peak& a,
          size_t second, const Peak& b, Meeting* meeting) {
  const double determinant =
      axes[first].cos_phi * axes[second].sin_phi - axes[first].sin_phi * axes[second].cos_phi;
  const double x = (a.centre_px * axes[second].sin_phi - b.centre_px * axes[first].sin_phi) / determinant;
  const double y = (b.centre_px * axes[first].cos_phi - a.centre_px * axes[second].cos_phi) / determinant;
  std::array<Peak, 16> chosen;
  std::array<StripeAxis, 16> seen;
  size_t count = 0;
  int hidden_count = 0;
  const double light_a = light_of(a, axes[first]), light_b = light_of(b, axes[second]);
  double misses = 0.0, least = std::min(light_a, light_b);
  for (size_t s = 0; s < axes.size(); ++s) {
    const double at = x * axes[s].cos_phi + y * axes[s].sin_phi;
    const Peak* nearest = s == first ? &a : s == second ? &b : nullptr;
    double miss = 0.0;
    bool hidden = false;
    if (nearest == nullptr) {
      miss = INFINITY;
      for (const Peak& peak : peaks[s].all()) {
        // A peak of two modes lies between them.
        const double distance = std::abs(peak.centre_px - at) / peak.sigma_px;
        if (distance < miss) miss = distance, nearest = &peak;
        hidden = hidden || (distance < 3.5 && light_of(peak, axes[s]) > 4.0 * std::max(light_a, light_b));
      }
    }
    if (nearest == nullptr || miss > 1.2) {
      if (!hidden || ++hidden_count > 2) return false;
      misses += 1.0;
      continue;
    }
    misses += miss * miss;
    least = std::min(least, light_of(*nearest, axes[s]));
    chosen[count] = *nearest;
    seen[count++] = axes[s];
  }
  if (count >= 3) {
    meeting->mode = intersect({seen.data(), count}, {chosen.data(), count}).mode;
  } else {
    // Two widths do not determine Sigma: assume a round one.
    const auto spread = [&](size_t i) {
      return chosen[i].sigma_px * chosen[i].sigma_px - seen[i].sigma_px * seen[i].sigma_px;
    };
    const double own = std::max(0.5 * (spread(0) + spread(1)) - kFlatPixel_px2, 0.01);
    meeting->mode = {.weight = 0.0, .x_px = x, .y_px = y, .xx_px2 = own, .xy_px2 = 0.0, .yy_px2 = own};
  }
  meeting->mode.weight = least;
  meeting->score = least * std::exp(-2.0 * misses);
  return std::isfinite(meeting->score) && meeting->mode.weight > 0.0;
}

std::vector<Meeting> meetings_of(std::span<const StripeAxis> axes, std::span<const Peaks> peaks) {
  std::vector<Meeting> meetings;
  if (axes.size() > 16) return meetings;
  for (size_t i = 0; i < axes.size(); ++i) {
    for (size_t j = i + 1; j < axes.size(); ++j) {
      const double sine = axes[i].cos_phi * axes[j].sin_phi - axes[i].sin_phi * axes[j].cos_phi;
      if (std::abs(sine) < 0.5) continue;
      for (const Peak& a : peaks[i].all()) {
        for (const Peak& b : peaks[j].all()) {
          Meeting meeting;
          if (meet(axes, peaks, i, a, j, b, &meeting)) meetings.push_back(meeting);
        }
      }
    }
  }
  std::sort(meetings.begin(), meetings.end(),
            [](const Meeting& a, const Meeting& b) { return a.score > b.score; });
  std::vector<Meeting> distinct;
  for (const Meeting& meeting : meetings) {
    const double near_px = 0.35 * axes.front().sigma_px;
    const bool seen = std::any_of(distinct.begin(), distinct.end(), [&](const Meeting& other) {
      const double dx = meeting.mode.x_px - other.mode.x_px, dy = meeting.mode.y_px - other.mode.y_px;
      return dx * dx + dy * dy < near_px * near_px;
    });
    if (!seen) distinct.push_back(meeting);
    if (distinct.size() == kMaxMeetings) break;
  }
  return distinct;
}

// \int of the product of two Gaussian peaks, per sqrt(2 pi).
double overlap(const Peak& a, const Peak& b) {
  const double variance = a.sigma_px * a.sigma_px + b.sigma_px * b.sigma_px;
  const double distance = a.centre_px - b.centre_px;
  return a.amplitude * b.amplitude * a.sigma_px * b.sigma_px / std::sqrt(variance) *
         std::exp(-0.5 * distance * distance / variance);
}

Peak peak_of(const Footprint& mode, const StripeAxis& axis) {
  const double sigma = std::sqrt(answered_variance(mode, axis));
  return {.amplitude = axis.sigma_px / sigma, .centre_px = centre_of(mode, axis), .sigma_px = sigma};
}

// Chooses the k meeting points whose footprints, with the best weights, explain the peaks best.
class SubsetChoice {
 public:
  SubsetChoice(std::span<const StripeAxis> axes, std::span<const Peaks> peaks,
               const std::vector<Meeting>& meetings)
      : meetings_(meetings), count_(static_cast<int>(meetings.size())) {
    std::vector<std::vector<Peak>> shapes;
    for (const Meeting& meeting : meetings) {
      std::vector<Peak>& shape = shapes.emplace_back();
      for (const StripeAxis& axis : axes) shape.push_back(peak_of(meeting.mode, axis));
    }
    for (int i = 0; i < count_; ++i) {
      for (size_t s = 0; s < axes.size(); ++s) {
        const Peak& own = shapes[i][s];
        for (const Peak& peak : peaks[s].all()) data_[i] += overlap(own, peak);
        for (int j = 0; j <= i; ++j) gram_(i, j) += overlap(own, shapes[j][s]);
      }
      for (int j = 0; j < i; ++j) gram_(j, i) = gram_(i, j);
    }
  }

  // False: no such set has only positive weights.
  bool best(int size, Footprints* modes) {
    if (size > count_) return false;
    size_ = size;
    best_score_ = 0.0;
    extend(0, 0);
    if (best_score_ <= 0.0) return false;
    *modes = {};
    for (int k = 0; k < size; ++k) {
      Footprint mode = meetings_[best_[k]].mode;
      mode.weight = best_weights_[k];
      modes->push_back(mode);
    }
    return true;
  }

 private:
  void extend(int chosen, int from) {
    if (chosen == size_) {
      score();
      return;
    }
    for (int i = from; i <= count_ - (size_ - chosen); ++i) {
      current_[chosen] = i;
      extend(chosen + 1, i + 1);
    }
  }

  void score() {
    // Unused rows stay those of the identity.
    Eigen::Matrix4d gram = Eigen::Matrix4d::Identity();
    Eigen::Vector4d data = Eigen::Vector4d::Zero();
    for (int a = 0; a < size_; ++a) {
      data[a] = data_[current_[a]];
      for (int b = 0; b < size_; ++b) gram(a, b) = gram_(current_[a], current_[b]);
      gram(a, a) *= 1.0 + 1e-6;
    }
    const Eigen::Vector4d weights = gram.llt().solve(data);
    for (int a = 0; a < size_; ++a) {
      if (!(weights[a] > 0.0)) return;
    }
    const double explained = weights.dot(data);
    if (!(explained > best_score_)) return;
    best_score_ = explained;
    best_ = current_;
    best_weights_ = weights;
  }

  const std::vector<Meeting>& meetings_;
  int count_;
  Eigen::Matrix<double, kMaxMeetings, kMaxMeetings> gram_ =
      Eigen::Matrix<double, kMaxMeetings, kMaxMeetings>::Zero();
  Eigen::Matrix<double, kMaxMeetings, 1> data_ = Eigen::Matrix<double, kMaxMeetings, 1>::Zero();
  int size_ = 0;
  double best_score_ = 0.0;
  std::array<int, kMaxFootprints> current_{}, best_{};
  Eigen::Vector4d best_weights_;
};

// The two highest maxima of a residual above `floor`, with the stripe's own width.
Peaks rises_of(const float* residual, const SampleLayout& layout, const SampleLayout::Sweep& sweep,
               double floor) {
  Peaks rises;
  const float* offset_px = layout.offset_px.data() + sweep.first;
  const auto smooth = [&](int i) {
    const int before = std::max(i - 1, 0), after = std::min(i + 1, sweep.count - 1);
    return 0.25 * (residual[before] + 2.0 * residual[i] + residual[after]);
  };
  double before = -INFINITY, here = smooth(0);
  for (int i = 0; i < sweep.count; ++i) {
    const double after = i + 1 < sweep.count ? smooth(i + 1) : -INFINITY;
    if (here > before && here >= after && here > floor) {
      const Peak rise{.amplitude = here,
                      .centre_px = sweep.first_r_px + offset_px[i],
                      .sigma_px = 1.1 * sweep.axis.sigma_px};
      if (rises.count < 2) {
        rises.peaks[rises.count++] = rise;
      } else if (here > rises.peaks[1].amplitude) {
        rises.peaks[1] = rise;
      }
      if (rises.count == 2 && rises.peaks[1].amplitude > rises.peaks[0].amplitude)
        std::swap(rises.peaks[0], rises.peaks[1]);
    }
    before = here;
    here = after;
  }
  return rises;
}

int max_peaks(std::span<const Peaks> peaks) {
  int most = 0;
  for (const Peaks& sweep : peaks) most = std::max(most, sweep.count);
  return most;
}

// With noise alone chi2 is n - p in units of its variance, and the products of neighbouring residuals sum to
// 0 except for what the fit absorbed: a mode's basis is smooth, with neighbours correlated by 0.8. Their
// variances are 2n and n, independent. A missing mode adds nearly as much to the products as to chi2, so the
// most sensitive sum weights the products 1.6 to 1. Explained: below three standard deviations of that sum.
bool is_explained(const JointFit& fit, double noise_sd) {
  constexpr double kSmooth = 0.8, kProducts = 1.6;
  const double n = std::max(fit.near_count, 1), p = 6.0 * fit.modes.size();
  const double variance = std::max(noise_sd, kMinNoise) * std::max(noise_sd, kMinNoise);
  const double excess = fit.near_chi2 / variance - (n - p),
               products = fit.near_neighbours / variance + kSmooth * p;
  return excess + kProducts * products < 2.5 * std::sqrt((2.0 + kProducts * kProducts) * n);
}

// Converged, and each mode's weight exceeds four of its standard errors.
bool is_sound(const JointFit& fit) {
  for (int m = 0; m < fit.modes.size(); ++m) {
    if (!(fit.modes[m].weight > 4.0 * fit.weight_sd[m])) return false;
  }
  return fit.converged;
}

class Search {
 public:
  Search(const PixelSamples& samples, const MonitorExtent& extent, double noise_sd, JointWorkspace& workspace)
      : samples_(samples),
        extent_(extent),
        axes_(axes_of(*samples.layout)),
        noise_sd_(std::max(noise_sd, kMinNoise)),
        workspace_(workspace) {}

  JointFit run(std::span<const Peaks> peaks, int max_modes, const JointFit* usual) {
    JointFit best;
    const std::vector<Meeting> meetings = meetings_of(axes_, peaks);
    if (meetings.empty()) return best;
    SubsetChoice subsets(axes_, peaks, meetings);
    if (usual != nullptr) {
      best = *usual;
      evaluate(samples_, best.modes, extent_, workspace_, equations_);
      best.chi2 = equations_.cost, best.near_chi2 = equations_.near_chi2;
      best.near_neighbours = equations_.near_neighbours;
      best.near_count = equations_.near_count;
    } else if (as_many_as_peaks(peaks, max_modes, subsets, &best)) {
      return best;
    }
    while (best.modes.size() < max_modes && may_earn_more(best)) {
      starts_.clear();
      const int size = best.modes.size() + 1;
      Footprints start;
      if (size <= static_cast<int>(meetings.size()) && subsets.best(size, &start)) starts_.push_back(start);
      int worst = 0;
      if (!best.modes.empty()) {
        add_residual_start(best.modes);
        worst = least_explained(best.modes);
        add_split_starts(best.modes, worst);
      }
      if (!add_mode(&best)) {
        starts_.clear();
        for (int m = 0; m < best.modes.size(); ++m) {
          if (m != worst) add_split_starts(best.modes, m);
        }
        if (!add_mode(&best)) break;
      }
      if (explained(best)) break;
    }
    return best;
  }

 private:
  // The usual case: exactly as many modes as some sweep has peaks, and nothing left but noise.
  bool as_many_as_peaks(std::span<const Peaks> peaks, int max_modes, SubsetChoice& subsets, JointFit* fit) {
    Footprints start;
    const int most = max_peaks(peaks);
    if (most > max_modes || !subsets.best(most, &start)) return false;
    *fit = fit_jointly(samples_, start, extent_, {.max_steps = kIterations / 4}, workspace_);
    if (is_sound(*fit) && explained(*fit)) return true;
    *fit = {};
    return false;
  }

  // Near the modes and elsewhere.
  bool explained(const JointFit& fit) const { return is_explained(fit, noise_sd_) && is_dark_elsewhere(fit); }

  bool is_dark_elsewhere(const JointFit& fit) const {
    return fit.chi2 - fit.near_chi2 < 1.5 * noise_sd_ * noise_sd_ * sample_count();
  }

  // Whether a further mode that left nothing but noise would earn its place.
  bool may_earn_more(const JointFit& fit) const {
    if (fit.modes.empty() || !is_dark_elsewhere(fit)) return true;
    JointFit best = fit;
    best.chi2 -= fit.near_chi2;
    best.near_chi2 = 0.0;
    return earns_its_place(fit, best, noise_sd_);
  }

  double sample_count() const {
    double n = 0.0;
    for (const SampleLayout::Sweep& sweep : samples_.layout->sweeps) n += sweep.count;
    return n;
  }

  // A few steps from each start, then the best one to its minimum.
  bool fit_best_start(JointFit* best) {
    bool found = false;
    for (const Footprints& start : starts_) {
      const JointFit fit = fit_jointly(samples_, start, extent_, {.max_steps = kFirstIterations}, workspace_);
      if (!physical(fit) || (found && fit.chi2 >= best->chi2)) continue;
      *best = fit;
      found = true;
    }
    if (found && !best->converged) {
      const JointFit fit =
          fit_jointly(samples_, best->modes, extent_, {.max_steps = kIterations}, workspace_);
      if (physical(fit) && fit.chi2 <= best->chi2) *best = fit;
    }
    return found;
  }

  static bool physical(const JointFit& fit) {
    return std::isfinite(fit.chi2) &&
           std::all_of(fit.modes.begin(), fit.modes.end(), [](const Footprint& m) { return m.weight > 0.0; });
  }

  void add_residual_start(const Footprints& modes) {
    evaluate(samples_, modes, extent_, workspace_, equations_);
    const SampleLayout& layout = *samples_.layout;
    std::vector<Peaks> rises;
    for (const SampleLayout::Sweep& sweep : layout.sweeps) {
      rises.push_back(rises_of(workspace_.residual.data() + sweep.first, layout, sweep, noise_sd_));
    }
    const std::vector<Meeting> meetings = meetings_of(axes_, rises);
    if (meetings.empty()) return;
    Footprints start = modes;
    start.push_back(meetings.front().mode);
    starts_.push_back(start);
  }

  // Takes the best start's fit if its further mode earns its place.
  bool add_mode(JointFit* best) {
    JointFit next;
    if (!fit_best_start(&next)) return false;
    if (!best->modes.empty() && !earns_its_place(*best, next, noise_sd_)) return false;
    *best = next;
    return true;
  }

  // The mode around which most is left. Uses the residual of add_residual_start.
  int least_explained(const Footprints& modes) const {
    int worst = 0;
    double most = -1.0;
    for (int m = 0; m < modes.size(); ++m) {
      const double left = left_round(modes[m]);
      if (left > most) most = left, worst = m;
    }
    return worst;
  }

  void add_split_starts(const Footprints& modes, int worst) {
    for (const SplitAxis axis : {SplitAxis::kWide, SplitAxis::kNarrow}) {
      const auto [half, other] = split(modes[worst], axis);
      Footprints start = modes;
      start[worst] = half;
      start.push_back(other);
      starts_.push_back(start);
    }
  }

  double left_round(const Footprint& mode) const {
    double sum = 0.0;
    for (const SampleLayout::Sweep& sweep : samples_.layout->sweeps) {
      const double centre = centre_of(mode, sweep.axis) - sweep.first_r_px;
      const double reach = 2.0 * std::sqrt(answered_variance(mode, sweep.axis));
      const float* offset_px = samples_.layout->offset_px.data() + sweep.first;
      const float* begin =
          std::lower_bound(offset_px, offset_px + sweep.count, static_cast<float>(centre - reach));
      for (const float* at = begin;
           at != offset_px + sweep.count && static_cast<double>(*at) < centre + reach; ++at) {
        const size_t i = sweep.first + (at - offset_px);
        sum += static_cast<double>(samples_.weight[i] * workspace_.residual[i] * workspace_.residual[i]);
      }
    }
    return sum;
  }

  const PixelSamples& samples_;
  const MonitorExtent& extent_;
  const std::vector<StripeAxis> axes_;
  const double noise_sd_;
  JointWorkspace& workspace_;
  NormalEquations equations_;
  std::vector<Footprints> starts_;
};

// The fit of footprints as stripes see them, with footprints where they are.
JointFit placed(const PixelSamples& samples, const JointFit& seen, const MonitorExtent& extent,
                JointWorkspace& workspace) {
  const auto is_narrow = [](const Footprint& mode) {
    return std::min(mode.xx_px2, mode.yy_px2) < kHidden_px2;
  };
  if (std::none_of(seen.modes.begin(), seen.modes.end(), is_narrow)) return seen;
  // At least an eighth of a stripe: a point within a pixel could not move.
  const double least_px = samples.layout->sweeps.front().axis.sigma_px / 8.0;
  Footprints start = seen.modes;
  for (Footprint& mode : start) mode = with_positive_covariance(mode, least_px * least_px);
  const JointFit fit =
      fit_jointly(samples, start, extent, {.max_steps = kIterations, .near = true}, workspace);
  const bool positive = std::all_of(fit.modes.begin(), fit.modes.end(),
                                    [](const Footprint& mode) { return mode.weight > 0.0; });
  return fit.converged && positive ? fit : seen;
}

}  // namespace

Footprints usual_start(const SampleLayout& layout, std::span<const Peaks> peaks, int max_modes) {
  Footprints start;
  const int most = max_peaks(peaks);
  if (most == 0 || most > max_modes) return start;
  const std::vector<StripeAxis> axes = axes_of(layout);
  if (most == 1) {
    std::vector<Peak> lines;
    for (const Peaks& sweep : peaks) {
      if (sweep.count == 1) lines.push_back(sweep.peaks[0]);
    }
    if (lines.size() < axes.size()) return start;
    const Intersection found = intersect(axes, lines);
    if (found.distance_px <= 0.5 * axes.front().sigma_px) start.push_back(found.mode);
    return start;
  }
  const std::vector<Meeting> meetings = meetings_of(axes, peaks);
  if (most > static_cast<int>(meetings.size())) return start;
  SubsetChoice(axes, peaks, meetings).best(most, &start);
  return start;
}

bool suffices(const JointFit& fit, const JointFit& sweeps, double noise_sd) {
  return is_sound(fit) && is_explained(sweeps, noise_sd);
}

bool needs_more(const JointFit& fit, double noise_sd) {
  return is_sound(fit) && !is_explained(fit, noise_sd);
}

bool earns_its_place(const JointFit& before, const JointFit& after, double noise_sd) {
  const double noise = std::max(noise_sd, kMinNoise), n = std::max(after.near_count, 1),
               least = n * noise * noise;
  // Outside the new fit's reach both residuals are equal.
  const double left_before = before.chi2 - (after.chi2 - after.near_chi2);
  return n * std::log(std::max(left_before, least) / std::max(after.near_chi2, least)) > 4.0 * std::log(n);
}

JointFit find_footprints(const PixelSamples& samples, std::span<const Peaks> peaks,
                         const MonitorExtent& extent, double noise_sd, int max_modes,
                         JointWorkspace& workspace, const JointFit* usual) {
  // Within a pixel neither place nor width of a footprint changes what stripes see: no search leads through
  // it.
  PixelSamples seen = samples;
  seen.placed = false;
  JointFit fit =
      Search(seen, extent, noise_sd, workspace).run(peaks, std::min(max_modes, kMaxFootprints), usual);
  fit = placed(samples, fit, extent, workspace);
  for (int i = 0; i < fit.modes.size(); ++i) {
    int strongest = i;
    for (int m = i + 1; m < fit.modes.size(); ++m) {
      if (fit.modes[m].weight > fit.modes[strongest].weight) strongest = m;
    }
    const auto a = static_cast<size_t>(i), b = static_cast<size_t>(strongest);
    std::swap(fit.modes[i], fit.modes[strongest]);
    std::swap(fit.weight_sd[a], fit.weight_sd[b]);
    std::swap(fit.centre_sd_px[a], fit.centre_sd_px[b]);
  }
  return fit;
}

}  // namespace glasswing
