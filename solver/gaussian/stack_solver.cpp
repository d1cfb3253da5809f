#include "solver/gaussian/stack_solver.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr int kStretch = SampleTile::kMostBlocks * kBlockLanes;
constexpr double kLeastStep = 1.0 / 65535.0;
constexpr double kUsualNoise = 0.003;
constexpr float kLeastFloor = 0.0015f;  // of full scale: fainter crests are stray light

Mode mode_of(const JointFit& fit, int m, int texture) {
  const Footprint& footprint = fit.modes[m];
  const auto known = [](double sd) { return std::isfinite(sd) ? static_cast<float>(sd) : 0.0f; };
  return {.weight = static_cast<float>(footprint.weight),
          .x_px = static_cast<float>(footprint.x_px),
          .y_px = static_cast<float>(footprint.y_px),
          .xx_px2 = static_cast<float>(footprint.xx_px2),
          .xy_px2 = static_cast<float>(footprint.xy_px2),
          .yy_px2 = static_cast<float>(footprint.yy_px2),
          .texture = texture,
          .weight_sd = known(fit.weight_sd[static_cast<size_t>(m)]),
          .centre_sd_px = known(fit.centre_sd_px[static_cast<size_t>(m)])};
}

// Whether the steps are all alike, to a hundredth.
bool is_even(const std::vector<double>& r_px) {
  const double step_px = (r_px.back() - r_px.front()) / static_cast<double>(r_px.size() - 1);
  for (size_t i = 1; i < r_px.size(); ++i) {
    if (std::abs(r_px[i] - r_px[i - 1] - step_px) > 0.01 * step_px) return false;
  }
  return true;
}

}  // namespace

StackSolver::StackSolver(const FrameStack& stack, const StackLayout& layout, int most_modes,
                         double silhouette_tolerance)
    : stack_(stack),
      layout_(layout),
      most_modes_(most_modes),
      lane_count_(stack.manifest.camera().width_px() * kChannels),
      noise_known_(stack.manifest.camera().read_sd() > 0.0 || stack.manifest.camera().gain() > 0.0),
      noise_(sample_noise(stack.manifest.camera(), kUsualNoise)),
      silhouette_(silhouette_tolerance),
      empty_(lay_out_empty_stage(stack.manifest)),
      tile_(layout) {
  for (size_t s = 0; s < layout.sweeps.size(); ++s) {
    const SweepLayout& sweep = layout.sweeps[s];
    if (textures_.empty() || textures_.back().texture != sweep.texture) {
      const v1::Monitor& monitor = stack.manifest.monitors(sweep.texture);
      textures_.push_back({.texture = sweep.texture,
                           .extent = {.width_px = static_cast<double>(monitor.width_px()),
                                      .height_px = static_cast<double>(monitor.height_px())},
                           .samples = {},
                           .sweeps = {},
                           .even = {}});
    }
    textures_.back().sweeps.push_back(s);
    textures_.back().samples.add(
        {.cos_phi = sweep.cos_phi, .sin_phi = sweep.sin_phi, .sigma_px = sweep.sigma_px}, sweep.r_px);
    Grid grid{.even = is_even(sweep.r_px),
              .step_px = 0.0,
              .count = static_cast<int>(sweep.r_px.size()),
              .samples = {}};
    const double length_px = sweep.r_px.back() - sweep.r_px.front();
    if (!grid.even) {
      grid.step_px = 0.5 * sweep.sigma_px;
      grid.count = static_cast<int>(length_px / grid.step_px) + 1;
      grid.samples.resize(static_cast<size_t>(grid.count) * kBlockLanes);
    } else {
      grid.step_px = length_px / static_cast<double>(grid.count - 1);
    }
    grids_.push_back(std::move(grid));
  }
  for (Texture& texture : textures_) {
    const bool even =
        std::all_of(texture.sweeps.begin(), texture.sweeps.end(), [&](size_t s) { return grids_[s].even; });
    if (!even || texture.sweeps.size() > PlainPixel::kMostSweeps) continue;
    for (size_t k = 0; k < texture.sweeps.size(); ++k) {
      texture.even.push_back(
          {.axis = texture.samples.sweeps[k].axis, .step_px = grids_[texture.sweeps[k]].step_px});
    }
  }
  for (const EmptyMonitor& monitor : empty_) background_.emplace_back(monitor, noise_);
  plain_.resize(textures_.size());
  noise_sd_.resize(static_cast<size_t>(lane_count_));
  object_.resize(static_cast<size_t>(lane_count_ / kChannels));
}

float StackSolver::black(int y, int lane) const {
  const auto at = static_cast<size_t>(y) * static_cast<size_t>(lane_count_) + static_cast<size_t>(lane);
  double sum = 0.0, weight = 0.0;
  for (const ExposedFrame& exposed : layout_.black) {
    const double own = 1.0 / (exposed.scale * exposed.scale);
    sum += own * exposed.scale * stack_.rows[static_cast<size_t>(exposed.frame)][at] / 65535.0;
    weight += own;
  }
  return static_cast<float>(sum / weight);
}

void StackSolver::estimate_row_noise(int y) {
  for (int first = 0; first < lane_count_; first += kStretch) {
    const int count = std::min(kStretch, lane_count_ - first);
    tile_.load(stack_, y, first, count, noise_);
    for (int block = 0; block < tile_.block_count(); ++block) {
      std::array<float, kBlockLanes> sum{};
      for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
        const auto own = estimate_noise({.y = tile_.samples(block, s),
                                         .count = static_cast<int>(layout_.sweeps[s].r_px.size()),
                                         .first_r_px = 0.0,
                                         .step_px = 1.0});
        for (size_t lane = 0; lane < kBlockLanes; ++lane) sum[lane] += own[lane];
      }
      for (int lane = 0; lane < std::min(kBlockLanes, count - block * kBlockLanes); ++lane) {
        noise_sd_[static_cast<size_t>(first + block * kBlockLanes + lane)] =
            sum[static_cast<size_t>(lane)] / static_cast<float>(layout_.sweeps.size());
      }
    }
  }
}

void StackSolver::find_silhouette(int y) {
  std::vector<SilhouetteTest::Pair> pairs;
  for (int x = 0; x < lane_count_ / kChannels; ++x) {
    pairs.clear();
    for (const StackLayout::Pair& pair : layout_.pairs) {
      for (int c = 0; c < kChannels; ++c) {
        pairs.push_back({.object = static_cast<double>(stack_.at(pair.object, x, y, c)),
                         .empty = static_cast<double>(stack_.at(pair.empty, x, y, c))});
      }
    }
    SampleNoise noise = noise_;
    if (!noise_known_) {
      double variance = 0.0;
      for (int c = 0; c < kChannels; ++c) {
        const auto sd = static_cast<double>(noise_sd_[static_cast<size_t>(x * kChannels + c)]);
        variance += sd * sd / kChannels;
      }
      noise.read_sd = std::sqrt(std::max(variance, kLeastStep * kLeastStep));
    }
    object_[static_cast<size_t>(x)] = silhouette_.test(pairs, noise).object;
  }
}

void StackSolver::map_background(int x, int y, Matte& matte) {
  std::array<size_t, kChannels> slot{};
  for (size_t m = 0; m < background_.size(); ++m) {
    gather(stack_, empty_[m], x, y, empty_pixel_);
    const StraightView straight = straight_view(stack_.manifest.camera(), empty_[m], x, stack_.first_row + y);
    const BackgroundPoint point = background_[m].point(empty_pixel_, straight);
    if (!point.seen) continue;
    if (point.ambiguous) matte.flags(x, y) |= kFlagPoorFit;
    for (int c = 0; c < kChannels; ++c) {
      size_t& place = slot[static_cast<size_t>(c)];
      if (place < matte.modes(x, y, c).size())
        matte.modes(x, y, c)[place++] = point.mode(c, empty_[m].texture);
    }
  }
}

void StackSolver::solve_row(int y, Matte& matte) {
  if (noise_known_) {
    for (int lane = 0; lane < lane_count_; ++lane) {
      noise_sd_[static_cast<size_t>(lane)] =
          static_cast<float>(std::sqrt(noise_.variance(static_cast<double>(black(y, lane)))));
    }
  } else {
    estimate_row_noise(y);
  }
  find_silhouette(y);
  for (int x = 0; x < matte.width_px(); ++x) {
    const bool object = object_[static_cast<size_t>(x)];
    matte.coverage(x, y) = object ? 1.0f : 0.0f;
    for (int c = 0; c < kChannels; ++c) {
      matte.foreground(x, y)[static_cast<size_t>(c)] = black(y, x * kChannels + c);
    }
    if (!object) map_background(x, y, matte);
  }
  for (int first = 0; first < lane_count_; first += kStretch) {
    const int count = std::min(kStretch, lane_count_ - first);
    const auto begin = object_.begin() + first / kChannels,
               end = object_.begin() + (first + count - 1) / kChannels + 1;
    if (std::find(begin, end, true) == end) continue;
    tile_.load(stack_, y, first, count, noise_);
    for (int block = 0; block < tile_.block_count(); ++block) {
      solve_block(y, block, first + block * kBlockLanes, matte);
    }
  }
}

void StackSolver::solve_block(int y, int block, int first_lane, Matte& matte) {
  unsigned lanes = 0;
  std::array<float, kBlockLanes> dark{}, reach{};
  for (int lane = 0; lane < kBlockLanes && first_lane + lane < lane_count_; ++lane) {
    const int x = (first_lane + lane) / kChannels;
    if (!object_[static_cast<size_t>(x)]) continue;
    lanes |= 1u << lane;
    dark[static_cast<size_t>(lane)] = black(y, first_lane + lane);
    reach[static_cast<size_t>(lane)] =
        std::max(3.0f * noise_sd_[static_cast<size_t>(first_lane + lane)], 2e-5f);
  }
  if (lanes == 0) return;
  // The light without the stripes: the black frame, and with it all samples that no stripe reached.
  dark = tile_.median_near(block, dark, reach);
  for (float& r : reach) r *= 0.67f;
  baseline_ = tile_.median_near(block, dark, reach);
  std::array<float, kBlockLanes> floor{}, noise{};
  for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
    float* samples = tile_.samples(block, s);
    const SweepLayout& sweep = layout_.sweeps[s];
    for (size_t i = 0; i < sweep.r_px.size(); ++i) {
      std::array<float, 3> scale;
      for (size_t c = 0; c < 3; ++c)
        scale[c] = sweep.peak[i][c] > 0.0 ? static_cast<float>(1.0 / sweep.peak[i][c]) : 0.0f;
      std::array<float, kBlockLanes> by_lane;
      for (size_t lane = 0; lane < kBlockLanes; ++lane)
        by_lane[lane] = scale[(static_cast<size_t>(first_lane) + lane) % 3];
      for (size_t lane = 0; lane < kBlockLanes; ++lane) {
        float& sample = samples[i * kBlockLanes + lane];
        sample = (sample - baseline_[lane]) * by_lane[lane];
      }
    }
  }
  for (int lane = 0; lane < kBlockLanes && first_lane + lane < lane_count_; ++lane) {
    const auto l = static_cast<size_t>(lane);
    noise[l] = noise_sd_[static_cast<size_t>(first_lane + lane)];
    floor[l] = std::max(3.5f * noise[l], kLeastFloor);
  }
  find_crests(block, floor, noise, lanes);
  for (size_t t = 0; t < textures_.size(); ++t) fit_plain_lanes(t, block, lanes);
  for (int lane = 0; lane < kBlockLanes; ++lane) {
    if ((lanes >> lane & 1u) == 0) continue;
    const int x = (first_lane + lane) / kChannels, channel = (first_lane + lane) % kChannels;
    matte.foreground(x, y)[static_cast<size_t>(channel)] = baseline_[static_cast<size_t>(lane)];
    solve_lane(block, lane, x, y, channel, matte);
  }
}

void StackSolver::find_crests(int block, const std::array<float, kBlockLanes>& floor,
                              const std::array<float, kBlockLanes>& noise, unsigned lanes) {
  std::vector<SweepBlock> blocks;
  for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
    const SweepLayout& sweep = layout_.sweeps[s];
    Grid& grid = grids_[s];
    const float* samples = tile_.samples(block, s);
    if (!grid.even) {
      size_t before = 0;
      for (int i = 0; i < grid.count; ++i) {
        const double r = sweep.r_px.front() + i * grid.step_px;
        while (before + 2 < sweep.r_px.size() && sweep.r_px[before + 1] <= r) ++before;
        const auto part =
            static_cast<float>((r - sweep.r_px[before]) / (sweep.r_px[before + 1] - sweep.r_px[before]));
        for (size_t lane = 0; lane < kBlockLanes; ++lane) {
          const float a = samples[before * kBlockLanes + lane],
                      b = samples[(before + 1) * kBlockLanes + lane];
          grid.samples[static_cast<size_t>(i) * kBlockLanes + lane] = a + part * (b - a);
        }
      }
      samples = grid.samples.data();
    }
    blocks.push_back(
        {.y = samples, .count = grid.count, .first_r_px = sweep.r_px.front(), .step_px = grid.step_px});
  }
  finder_.find(blocks, floor, noise, lanes, crests_);
}

void StackSolver::fit_plain_lanes(size_t t, int block, unsigned lanes) {
  const Texture& texture = textures_[t];
  plain_[t].fill(std::nullopt);
  if (texture.even.empty() || tile_.weighted()) return;
  plain_lanes_.clear();
  plain_pixels_.clear();
  plain_fits_.clear();
  std::array<StripeAxis, PlainPixel::kMostSweeps> axes;
  std::array<Crest, PlainPixel::kMostSweeps> crests;
  const size_t count = texture.sweeps.size();
  for (size_t k = 0; k < count; ++k) axes[k] = texture.even[k].axis;
  for (int lane = 0; lane < kBlockLanes; ++lane) {
    if ((lanes >> lane & 1u) == 0) continue;
    bool single = true;
    for (size_t k = 0; k < count && single; ++k) {
      const Crests& found = crests_[texture.sweeps[k]][static_cast<size_t>(lane)];
      single = found.count == 1;
      crests[k] = found.crests[0];
    }
    if (!single) continue;
    double distance_px = 0.0;
    const Footprint start = intersect({axes.data(), count}, {crests.data(), count}, &distance_px);
    if (distance_px > 0.5 * axes[0].sigma_px || near_edge(start, texture.extent)) continue;
    PlainPixel pixel;
    for (size_t k = 0; k < count && single; ++k) {
      const size_t s = texture.sweeps[k];
      const double step_px = texture.even[k].step_px, first_r_px = texture.samples.sweeps[k].first_r_px;
      const double centre = start.x_px * axes[k].cos_phi + start.y_px * axes[k].sin_phi;
      const int middle = static_cast<int>(std::lround((centre - first_r_px) / step_px));
      const int half =
          static_cast<int>(std::ceil(4.7 * std::sqrt(answered_variance(start, axes[k])) / step_px));
      single = middle >= half && middle + half < grids_[s].count && half <= kMostHalf;
      if (!single) break;
      pixel.windows[k] = {.middle = tile_.samples(block, s) + middle * kBlockLanes + lane,
                          .stride = kBlockLanes,
                          .half = half};
      pixel.middle_r_px[k] = first_r_px + middle * step_px;
    }
    if (!single) continue;
    plain_lanes_.push_back(lane);
    plain_pixels_.push_back(pixel);
    plain_fits_.emplace_back().mode = start;
  }
  fit_plain(texture.even, plain_pixels_, plain_fits_);
  for (size_t i = 0; i < plain_fits_.size(); ++i) {
    const PlainFit& fit = plain_fits_[i];
    if (!fit.settled || near_edge(fit.mode, texture.extent)) continue;
    JointFit joint;
    joint.chi2 = joint.near_chi2 = fit.chi2;
    joint.near_count = fit.sample_count;
    joint.converged = true;
    joint.modes.push_back(fit.mode);
    const double sd = std::sqrt(fit.chi2 / std::max(fit.sample_count - 6, 1));
    joint.weight_sd[0] = fit.weight_sd * sd;
    joint.centre_sd_px[0] = fit.centre_sd_px * sd;
    plain_[t][static_cast<size_t>(plain_lanes_[i])] = joint;
  }
}

JointFit StackSolver::search(const Texture& texture, int block, int lane, int channel, double noise_sd,
                             int most_modes, std::uint8_t& flags) {
  const auto l = static_cast<size_t>(lane), c = static_cast<size_t>(channel);
  const double dark_variance = noise_.variance(static_cast<double>(baseline_[l]));
  samples_.layout = &texture.samples;
  samples_.y.assign(static_cast<size_t>(texture.samples.padded_count()), 0.0f);
  samples_.weight.assign(samples_.y.size(), 0.0f);
  std::vector<Crests> crests;
  double usable = 0.0;
  for (size_t k = 0; k < texture.sweeps.size(); ++k) {
    const size_t s = texture.sweeps[k];
    const SweepLayout& sweep = layout_.sweeps[s];
    const auto first = static_cast<size_t>(texture.samples.sweeps[k].first);
    const float* samples = tile_.samples(block, s);
    const float* weights = tile_.weighted() ? tile_.weights(block, s) : nullptr;
    for (size_t i = 0; i < sweep.r_px.size(); ++i) {
      const float value = samples[i * kBlockLanes + l];
      const double peak = sweep.peak[i][c];
      double weight = weights != nullptr ? static_cast<double>(weights[i * kBlockLanes + l]) : 1.0;
      if (weight == 0.0) flags |= kFlagSaturated;
      if (peak <= 0.0) weight = 0.0;
      // As one frame of the reference exposure would have it; brackets bring their own.
      if (noise_.gain > 0.0 && layout_.one_frame_a_shot) {
        weight *= dark_variance /
                  noise_.variance(static_cast<double>(baseline_[l]) + static_cast<double>(value) * peak);
      }
      samples_.y[first + i] = value;
      samples_.weight[first + i] = static_cast<float>(weight * peak * peak);
      usable += weight > 0.0 ? 1.0 : 0.0;
    }
    crests.push_back(crests_[s][l]);
  }
  if (usable == 0.0) flags |= kFlagNoData;
  return find_footprints(samples_, crests, texture.extent, noise_sd, most_modes, workspace_);
}

void StackSolver::solve_lane(int block, int lane, int x, int y, int channel, Matte& matte) {
  const auto l = static_cast<size_t>(lane);
  const auto noise_sd = static_cast<double>(noise_sd_[static_cast<size_t>(x * kChannels + channel)]);
  std::uint8_t flags = matte.flags(x, y);
  std::vector<Mode> found;
  size_t lit_textures = 0;
  for (const Texture& texture : textures_) {
    lit_textures += std::all_of(texture.sweeps.begin(), texture.sweeps.end(),
                                [&](size_t s) { return crests_[s][l].count > 0; })
                        ? 1
                        : 0;
  }
  for (const Texture& texture : textures_) {
    const int most = std::max(1, most_modes_ / static_cast<int>(std::max<size_t>(lit_textures, 1)));
    const std::optional<JointFit>& plain = plain_[static_cast<size_t>(&texture - textures_.data())][l];
    const bool done = plain && (most == 1 || is_explained(*plain, noise_sd)) && noise_.gain == 0.0;
    const JointFit fit = done ? *plain : search(texture, block, lane, channel, noise_sd, most, flags);
    double strongest = 0.0;
    for (int m = 0; m < fit.modes.size(); ++m) {
      found.push_back(mode_of(fit, m, texture.texture));
      strongest = std::max(strongest, fit.modes[m].weight);
    }
    if (!fit.modes.empty() && !fit.converged) flags |= kFlagNotConverged;
    const double rms = std::sqrt(fit.near_chi2 / std::max(fit.near_count, 1));
    if (rms > std::max(4.0 * noise_sd, 0.1 * strongest)) flags |= kFlagPoorFit;
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Mode& a, const Mode& b) { return a.weight > b.weight; });
  const std::span<Mode> modes = matte.modes(x, y, channel);
  std::copy_n(found.begin(), std::min(found.size(), modes.size()), modes.begin());
  matte.flags(x, y) = flags;
}

}  // namespace glasswing
