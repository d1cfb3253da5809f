#include "solver/hierarchical/wave_sums.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

// All unknowns: the boxes' ends, 1 - alpha, and F and R of each channel.
constexpr int kMaxUnknowns = 4 * kMaxModes + 1 + kChannels * (1 + kMaxModes);
using AllMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxUnknowns, kMaxUnknowns>;

}  // namespace

WaveSums::WaveSums(std::span<const BoxMonitor> monitors) : monitors_(monitors) {
  for (const BoxMonitor& monitor : monitors) {
    const auto solids =
        static_cast<size_t>(std::ranges::count(monitor.patterns, BoxPattern::kSolid, &BoxPattern::axis));
    const std::array<size_t, 2>& first =
        axes_.emplace_back(std::array{solids, solids + monitor.waves[0].size()});
    std::vector<size_t>& own = entry_of_.emplace_back();
    for (const BoxPattern& pattern : monitor.patterns) {
      const bool solid = pattern.axis == BoxPattern::kSolid;
      own.push_back(solid ? own.size() : first[pattern.axis] + pattern.wave);
    }
    for (Channel& channel : channels_) channel.entries.emplace_back(first[1] + monitor.waves[1].size());
  }
  for (Channel& channel : channels_) channel.constants.resize(monitors.size());
}

WaveMeans WaveSums::blank_means(size_t monitor) const {
  return WaveMeans(channels_[0].entries[monitor].size(), 1.0);
}

void WaveSums::gather(const BoxPixel& pixel, double misfit) {
  channel_count_ = pixel.channel_count();
  sample_count_ = 0;
  for (size_t c = 0; c < channel_count_; ++c) {
    Channel& channel = channels_[c];
    Total& total = channel.total;
    const double dark = pixel.black.information[c], black = pixel.black.radiance[c];
    total = {.w = dark, .y = dark * black, .yy = dark * black * black};
    sample_count_ += dark > 0.0 ? 1 : 0;
    for (size_t m = 0; m < monitors_.size(); ++m) {
      std::vector<Entry>& entries = channel.entries[m];
      Constant& constant = channel.constants[m];
      std::ranges::fill(entries, Entry{});
      constant = {};
      for (size_t p = 0; p < pixel.samples[m].size(); ++p) {
        const BoxSample& sample = pixel.samples[m][p];
        const double information = sample.information[c];
        if (information <= 0.0) continue;
        ++sample_count_;
        const BoxPattern& pattern = monitors_[m].patterns[p];
        const double own = pattern.axis == BoxPattern::kSolid ? 0.0 : misfit;
        const double w = information / (1.0 + own * information), half = 0.5 * pattern.light[c];
        const double y = sample.radiance[c], b = sample.straight[c], s = pattern.sign;
        Entry& entry = entries[entry_of_[m][p]];
        entry.sw += half * w * s;
        entry.ww += half * half * w;
        entry.wws += half * half * w * s;
        entry.sy += half * w * s * y;
        entry.sb += half * w * s * b;
        constant.w += half * w;
        constant.y += half * w * y;
        constant.b += half * w * b;
        total.w += w;
        total.y += w * y;
        total.b += w * b;
        total.yy += w * y * y;
        total.by += w * b * y;
        total.bb += w * b * b;
      }
    }
  }
}

void WaveSums::observe(const BoxFit& fit, size_t m, size_t axis, std::vector<WaveAxis::Seen>& seen) const {
  seen.resize(monitors_[m].waves[axis].size());
  for (size_t k = 0; k < seen.size(); ++k) {
    double top = 0.0, bottom = 0.0;
    for (size_t c = 0; c < channel_count_; ++c) {
      const Entry& entry = channels_[c].entries[m][axes_[m][axis] + k];
      const double r = fit.boxes[m].weight[c];
      top += r * (entry.sy - fit.foreground[c] * entry.sw - fit.straight * entry.sb - r * entry.wws);
      bottom += r * r * entry.ww;
    }
    const double u = bottom > 0.0 ? top / bottom : 0.0;
    seen[k] = {.u = static_cast<float>(u), .weight = static_cast<float>(bottom)};
  }
}

WaveSums::Normal WaveSums::normal_of(size_t c, std::span<const WaveMeans> v, const BoxFit& fit) const {
  const Channel& channel = channels_[c];
  Normal normal;
  normal.total = channel.total;
  double trace = channel.total.w;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    if (!fit.boxes[m].seen) continue;
    normal.free[m] = true;
    const Constant& constant = channel.constants[m];
    const std::vector<Entry>& entries = channel.entries[m];
    double h = constant.w, hh = 0.0, hy = constant.y, hb = constant.b;
    for (size_t i = 0; i < entries.size(); ++i) {
      const Entry& entry = entries[i];
      const double own = v[m][i];
      h += own * entry.sw;
      hh += entry.ww + own * (2.0 * entry.wws + own * entry.ww);
      hy += own * entry.sy;
      hb += own * entry.sb;
    }
    normal.cross.r[m] = h;
    normal.hh[m] = hh;
    normal.hy[m] = hy;
    normal.hb[m] = hb;
    trace += hh;
  }
  normal.ridge = 1e-12 * trace + 1e-30;
  return normal;
}

// Eliminates each R first.
WaveSums::Light WaveSums::solve(const Normal& normal, const Light& right) const {
  Light light;
  double top = right.f, bottom = normal.total.w + normal.ridge;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    if (!normal.free[m]) continue;
    const double share = normal.cross.r[m] / (normal.hh[m] + normal.ridge);
    top -= share * right.r[m];
    bottom -= share * normal.cross.r[m];
  }
  light.f = top / std::max(bottom, normal.ridge);
  for (size_t m = 0; m < monitors_.size(); ++m) {
    if (normal.free[m])
      light.r[m] = (right.r[m] - normal.cross.r[m] * light.f) / (normal.hh[m] + normal.ridge);
  }
  return light;
}

// 1 - alpha with F and R eliminated.
double WaveSums::fit_straight(std::span<const Normal> normals) const {
  double top = 0.0, bottom = 0.0, whole = 0.0;
  for (const Normal& normal : normals) {
    const Light taken = solve(normal, {.f = normal.total.b, .r = normal.hb});
    top += normal.total.by - taken.f * normal.total.y;
    bottom += normal.total.bb - taken.f * normal.total.b;
    whole += normal.total.bb;
    for (size_t m = 0; m < monitors_.size(); ++m) {
      top -= taken.r[m] * normal.hy[m];
      bottom -= taken.r[m] * normal.hb[m];
    }
  }
  return bottom > 1e-9 * whole ? std::clamp(top / bottom, 0.0, 1.0) : 0.0;
}

double WaveSums::chi_square(const Normal& normal, const Light& light, double straight) const {
  const Total& total = normal.total;
  double sum = total.yy + light.f * (light.f * total.w - 2.0 * total.y) +
               straight * (straight * total.bb + 2.0 * (light.f * total.b - total.by));
  for (size_t m = 0; m < monitors_.size(); ++m) {
    const double r = light.r[m];
    sum +=
        r * (r * normal.hh[m] + 2.0 * (light.f * normal.cross.r[m] + straight * normal.hb[m] - normal.hy[m]));
  }
  return std::max(sum, 0.0);
}

void WaveSums::fit_light(std::span<const WaveMeans> v, bool straight_is_free, BoxFit& fit) const {
  std::array<Normal, kChannels> normals;
  std::array<Light, kChannels> lights;
  for (size_t c = 0; c < channel_count_; ++c) normals[c] = normal_of(c, v, fit);
  const std::span<const Normal> own(normals.data(), channel_count_);
  for (bool again = true; again;) {
    again = false;
    if (straight_is_free) fit.straight = fit_straight(own);
    for (size_t c = 0; c < channel_count_; ++c) {
      Normal& normal = normals[c];
      Light right{.f = normal.total.y - fit.straight * normal.total.b};
      for (size_t m = 0; m < monitors_.size(); ++m) right.r[m] = normal.hy[m] - fit.straight * normal.hb[m];
      lights[c] = solve(normal, right);
      for (size_t m = 0; m < monitors_.size(); ++m) {
        if (lights[c].r[m] >= 0.0) continue;
        normal.free[m] = false;
        again = true;
      }
    }
  }
  fit.chi_square = 0.0;
  fit.sample_count = sample_count_;
  fit.foreground = {};
  for (PixelBox& box : fit.boxes) box.weight = {};
  for (size_t c = 0; c < channel_count_; ++c) {
    fit.foreground[c] = lights[c].f;
    for (size_t m = 0; m < monitors_.size(); ++m) fit.boxes[m].weight[c] = lights[c].r[m];
    fit.chi_square += chi_square(normals[c], lights[c], fit.straight);
  }
}

void WaveSums::estimate_errors(std::span<const WaveMeans> v, std::span<const Slopes> slopes,
                               std::span<const std::array<double, 2>> finest_bars_px, BoxFit& fit) const {
  const auto ends = static_cast<Eigen::Index>(4 * monitors_.size()), straight = ends;
  const auto light_count = static_cast<Eigen::Index>(1 + monitors_.size());
  const Eigen::Index count = ends + 1 + static_cast<Eigen::Index>(channel_count_) * light_count;
  AllMatrix matrix = AllMatrix::Zero(count, count);  // its lower triangle
  const auto foreground_of = [&](size_t c) { return ends + 1 + static_cast<Eigen::Index>(c) * light_count; };
  for (size_t c = 0; c < channel_count_; ++c) {
    const Eigen::Index foreground = foreground_of(c);
    const Normal normal = normal_of(c, v, fit);
    matrix(foreground, foreground) = normal.total.w;
    if (fit.straight > 0.0) {
      matrix(straight, straight) += normal.total.bb;
      matrix(foreground, straight) = normal.total.b;
    }
    for (size_t m = 0; m < monitors_.size(); ++m) {
      if (!fit.boxes[m].seen) continue;
      const Eigen::Index weight = foreground + 1 + static_cast<Eigen::Index>(m);
      matrix(weight, weight) = normal.hh[m];
      matrix(weight, foreground) = normal.cross.r[m];
      if (fit.straight > 0.0) matrix(weight, straight) = normal.hb[m];
      for (size_t i = axes_[m][0]; i < v[m].size(); ++i) {
        const auto low = static_cast<Eigen::Index>(4 * m + (i < axes_[m][1] ? 0 : 2));
        const Entry& entry = channels_[c].entries[m][i];
        const double r = fit.boxes[m].weight[c];
        for (Eigen::Index end = 0; end < 2; ++end) {
          const double by = r * slopes[m][i][end];
          matrix(foreground, low + end) += by * entry.sw;
          matrix(weight, low + end) += by * (entry.wws + v[m][i] * entry.ww);
          if (fit.straight > 0.0) matrix(straight, low + end) += by * entry.sb;
          for (Eigen::Index other = 0; other <= end; ++other)
            matrix(low + end, low + other) += by * r * slopes[m][i][other] * entry.ww;
        }
      }
    }
  }
  for (Eigen::Index end = 0; end < ends; ++end) {
    const double bar_px = finest_bars_px[end / 4][end / 2 % 2];
    matrix(end, end) += 12.0 / (bar_px * bar_px);
  }
  // Undetermined unknowns keep no standard error.
  for (Eigen::Index i = ends; i < count; ++i) {
    if (matrix(i, i) <= 0.0) matrix(i, i) = 1.0;
  }
  const AllMatrix covariance = matrix.ldlt().solve(AllMatrix::Identity(count, count));
  if (fit.straight > 0.0) fit.straight_sd = std::sqrt(std::max(covariance(straight, straight), 0.0));
  for (size_t m = 0; m < monitors_.size(); ++m) {
    PixelBox& box = fit.boxes[m];
    if (!box.seen) continue;
    for (size_t c = 0; c < channel_count_; ++c) {
      const Eigen::Index weight = foreground_of(c) + 1 + static_cast<Eigen::Index>(m);
      box.weight_sd[c] = std::sqrt(std::max(covariance(weight, weight), 0.0));
    }
    double variance = 0.0;  // of both coordinates of the centre
    for (Eigen::Index low = static_cast<Eigen::Index>(4 * m); low < static_cast<Eigen::Index>(4 * m + 4);
         low += 2)
      variance +=
          0.25 * (covariance(low, low) + covariance(low + 1, low + 1) + 2.0 * covariance(low, low + 1));
    box.centre_sd_px = std::sqrt(std::max(0.5 * variance, 0.0));
  }
}

}  // namespace glasswing
