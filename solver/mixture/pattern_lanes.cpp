#include "solver/mixture/pattern_lanes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/footprint/wave_answer.h"

namespace glasswing {
namespace {

size_t padded(size_t count) {
  return (count + PatternLanes::kPad - 1) / PatternLanes::kPad * PatternLanes::kPad;
}

// What of a footprint of weight 1 lies on lit pixels.
NormalShare share_of(std::span<const ReachedPixel> pixels, const LitArea& lit) {
  NormalShare sum{};
  for (const ReachedPixel& pixel : pixels) {
    const double place_px = (lit.horizontal ? pixel.y_px : pixel.x_px) - lit.offset_px;
    if (lit.bars && !is_lit(lit, static_cast<std::int64_t>(std::floor(place_px / lit.bar_px)))) continue;
    sum = sum_of(sum, 1.0, pixel.part);
  }
  return sum;
}

}  // namespace

PatternLanes::PatternLanes(const PatternAnswers& answers) : answers_(answers) {
  using Kind = ShownPattern::Kind;
  const std::vector<ShownPattern>& patterns = answers.patterns();
  const auto count_of = [&](Kind kind) {
    return static_cast<size_t>(std::ranges::count(patterns, kind, &ShownPattern::kind));
  };
  wave_end_ = padded(count_of(Kind::kWave));
  stripe_end_ = wave_end_ + padded(count_of(Kind::kStripe));
  black_lane_ = stripe_end_ + count_of(Kind::kArea);
  size_ = stripe_end_ + padded(count_of(Kind::kArea) + 1);
  for (std::vector<double>* const all : {&by_x_, &by_y_, &from_}) all->resize(stripe_end_);
  for (std::vector<float>* const all : {&xx_, &xy_, &yy_, &height_, &fx_, &fy_}) all->resize(stripe_end_);
  own_px2_.resize(stripe_end_, 1.0f);
  size_t wave = 0, stripe = wave_end_, area = stripe_end_;
  for (size_t i = 0; i < patterns.size(); ++i) {
    const ShownPattern& pattern = patterns[i];
    if (pattern.kind == Kind::kArea) {
      lane_.push_back(area++);
      areas_.push_back(i);
      continue;
    }
    const bool is_wave = pattern.kind == Kind::kWave;
    const size_t k = is_wave ? wave++ : stripe++;
    lane_.push_back(k);
    constexpr double kTau = 2.0 * std::numbers::pi;
    if (is_wave) most_turn_ = std::max(most_turn_, kTau * kTau * std::abs(pattern.fx * pattern.fy));
    by_x_[k] = is_wave ? pattern.fx : pattern.axis.cos_phi;
    by_y_[k] = is_wave ? pattern.fy : pattern.axis.sin_phi;
    from_[k] = is_wave ? pattern.phase_rad / kTau : pattern.r_px;
    // Of a wave the exponent and the slopes of its size, of a stripe the variance.
    const double share = is_wave ? -0.5 * kTau * kTau : 1.0;
    xx_[k] = static_cast<float>(share * by_x_[k] * by_x_[k]);
    xy_[k] = static_cast<float>(2.0 * share * by_x_[k] * by_y_[k]);
    yy_[k] = static_cast<float>(share * by_y_[k] * by_y_[k]);
    own_px2_[k] = static_cast<float>(pattern.axis.sigma_px * pattern.axis.sigma_px + kFlatPixel_px2);
    height_[k] =
        static_cast<float>(is_wave ? 0.5 * sinc(pattern.fx) * sinc(pattern.fy) : pattern.axis.sigma_px);
    fx_[k] = static_cast<float>(is_wave ? -kTau * pattern.fx : pattern.axis.cos_phi);
    fy_[k] = static_cast<float>(is_wave ? -kTau * pattern.fy : pattern.axis.sin_phi);
  }
}

void PatternLanes::answer(const Footprint& mode, bool through_pixels, const float* scale,
                          float* columns) const {
  if (answers_.cut(mode, through_pixels)) return answer_cut(mode, through_pixels, scale, columns);
  Footprint seen = mode;
  internal::SeenSlopes slopes;
  if (through_pixels) {
    const SeenAxis x = seen_through_pixels(mode.x_px, mode.xx_px2),
                   y = seen_through_pixels(mode.y_px, mode.yy_px2);
    seen = seen_through_pixels(mode, x, y);
    slopes = {.centre_by_centre_x = static_cast<float>(x.centre_by_centre),
              .centre_by_variance_x = static_cast<float>(x.centre_by_variance),
              .variance_by_centre_x = static_cast<float>(x.variance_by_centre),
              .variance_by_variance_x = static_cast<float>(x.variance_by_variance),
              .centre_by_centre_y = static_cast<float>(y.centre_by_centre),
              .centre_by_variance_y = static_cast<float>(y.centre_by_variance),
              .variance_by_centre_y = static_cast<float>(y.variance_by_centre),
              .variance_by_variance_y = static_cast<float>(y.variance_by_variance)};
  }
  internal::answer_waves(lanes(), seen, slopes, 0, wave_end_, size_, scale, columns);
  internal::answer_stripes(lanes(), seen, slopes, wave_end_, stripe_end_, size_, scale, columns);
  LitShare share(mode, answers_.extent());
  answer_areas([&](const LitArea& lit) { return share.of(lit); }, mode, scale, columns);
}

internal::WaveLanes PatternLanes::lanes() const {
  return {.by_x = by_x_.data(),
          .by_y = by_y_.data(),
          .from = from_.data(),
          .xx = xx_.data(),
          .xy = xy_.data(),
          .yy = yy_.data(),
          .own_px2 = own_px2_.data(),
          .height = height_.data(),
          .fx = fx_.data(),
          .fy = fy_.data()};
}

template <typename ShareOf>
void PatternLanes::answer_areas(const ShareOf& share_of, const Footprint& mode, const float* scale,
                                float* columns) const {
  for (size_t p = 0; p < kColumns; ++p)
    std::fill_n(columns + p * size_ + stripe_end_, size_ - stripe_end_, 0.0f);
  for (const size_t area : areas_) {
    const NormalShare own = share_of(answers_.patterns()[area].lit);
    const size_t k = lane_[area];
    const double by = scale[k], light = by * mode.weight;
    const std::array<double, kColumns> at{light * own.share, by * own.share,    light * own.by_x,
                                          light * own.by_y,  light * own.by_xx, light * own.by_xy,
                                          light * own.by_yy};
    for (size_t p = 0; p < kColumns; ++p) columns[p * size_ + k] = static_cast<float>(at[p]);
  }
}

bool PatternLanes::cut_in_lanes(const Footprint& mode) const {
  // As in wave_answer.cpp: where edges of both axes cut, Plackett's identity is of no use beyond this.
  constexpr double kMaxTurn = 6.0, kWaveReach = 5.0;
  const auto cut_across = [](double centre_px, double variance_px2, double size_px) {
    const double reach_px = kWaveReach * std::sqrt(std::max(variance_px2, 0.01));
    return centre_px < reach_px || size_px - centre_px < reach_px;
  };
  const MonitorExtent& extent = answers_.extent();
  const bool both = cut_across(mode.x_px, mode.xx_px2, extent.width_px) &&
                    cut_across(mode.y_px, mode.yy_px2, extent.height_px);
  return stripe_end_ == wave_end_ && (!both || std::abs(mode.xy_px2) * most_turn_ <= kMaxTurn);
}

void PatternLanes::answer_cut(const Footprint& mode, bool through_pixels, const float* scale,
                              float* columns) const {
  const MonitorExtent& extent = answers_.extent();
  if (narrow(mode) && stripe_end_ == wave_end_) {
    const std::vector<ReachedPixel> pixels = reached_pixels(mode, extent);
    internal::answer_reached_waves(lanes(), mode.weight, pixels, share_of(pixels, {}), wave_end_, size_,
                                   scale, columns);
    return answer_areas([&](const LitArea& lit) { return share_of(pixels, lit); }, mode, scale, columns);
  }
  if (cut_in_lanes(mode)) {
    LitShare share(mode, extent);
    internal::answer_cut_waves(lanes(), mode, extent, share.of({}), wave_end_, size_, scale, columns);
    return answer_areas([&](const LitArea& lit) { return share.of(lit); }, mode, scale, columns);
  }
  const size_t count = lane_.size();
  std::vector<double> exact(kColumns * count);
  answers_.of(mode, through_pixels, exact.data(), static_cast<std::ptrdiff_t>(count));
  std::fill_n(columns, kColumns * size_, 0.0f);
  for (size_t p = 0; p < kColumns; ++p) {
    for (size_t i = 0; i < count; ++i)
      columns[p * size_ + lane_[i]] = static_cast<float>(exact[p * count + i]) * scale[lane_[i]];
  }
}

}  // namespace glasswing
