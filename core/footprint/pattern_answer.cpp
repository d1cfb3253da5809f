#include "core/footprint/pattern_answer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>

#include "core/footprint/cut_footprint.h"
#include "core/footprint/wave_answer.h"

namespace glasswing {
namespace {

using Slope = std::array<double, 6>;
constexpr double kSlightCut = 2.5;  // standard deviations
constexpr double kFar = 50.0;       // square standard deviations: exp(-25) is below the rounding of float

// One parameter slightly increased, for derivatives without a closed form.
Footprint moved(Footprint mode, size_t parameter, double by) {
  (parameter == 1   ? mode.x_px
   : parameter == 2 ? mode.y_px
   : parameter == 3 ? mode.xx_px2
   : parameter == 4 ? mode.xy_px2
                    : mode.yy_px2) += by;
  return mode;
}

bool is_cut(const Footprint& mode, const MonitorExtent& extent) {
  const double reach_x = kSlightCut * std::sqrt(std::max(mode.xx_px2, 0.0)),
               reach_y = kSlightCut * std::sqrt(std::max(mode.yy_px2, 0.0));
  return mode.x_px < reach_x || mode.y_px < reach_y || mode.x_px > extent.width_px - reach_x ||
         mode.y_px > extent.height_px - reach_y;
}

struct Answer {
  double value = 0.0;
  Slope slope{};
};

Answer of_area(LitShare& share, const Footprint& mode, const LitArea& lit) {
  const NormalShare part = share.of(lit);
  const double weight = mode.weight;
  return {.value = weight * part.share,
          .slope = {part.share, weight * part.by_x, weight * part.by_y, weight * part.by_xx,
                    weight * part.by_xy, weight * part.by_yy}};
}

// No edge cuts `seen`.
Answer of_stripe(const Footprint& seen, const StripeAxis& axis, double r_px) {
  const double c = axis.cos_phi, s = axis.sin_phi, variance = answered_variance(seen, axis);
  const double offset = r_px - seen.x_px * c - seen.y_px * s;
  const double unit = axis.sigma_px / std::sqrt(variance) * std::exp(-0.5 * offset * offset / variance);
  const double value = seen.weight * unit, by_centre = value * offset / variance,
               by_variance = value * (offset * offset / variance - 1.0) / (2.0 * variance);
  return {.value = value,
          .slope = {unit, by_centre * c, by_centre * s, by_variance * c * c, 2.0 * by_variance * c * s,
                    by_variance * s * s}};
}

Answer of_cut_stripe(const Footprint& mode, const StripeAxis& axis, double r_px,
                     const MonitorExtent& extent) {
  constexpr double kStep_px = 1e-3;
  Answer answer;
  Footprint unit = mode;
  unit.weight = 1.0;
  answer.slope[0] = response(unit, axis, r_px, extent);
  answer.value = mode.weight * answer.slope[0];
  for (size_t p = 1; p < 6; ++p)
    answer.slope[p] = (response(moved(mode, p, kStep_px), axis, r_px, extent) - answer.value) / kStep_px;
  return answer;
}

// response() of a footprint that an edge cuts, for stripe after stripe of an axis.
class CutStripes {
 public:
  CutStripes(const Footprint& mode, const MonitorExtent& extent) : mode_(mode), extent_(extent) {
    if (narrow(mode)) pixels_ = reached_pixels(mode, extent);
  }

  double answer(const StripeAxis& axis, double r_px) {
    if (!narrow(mode_)) {
      const bool is_same = cut_ && axis.cos_phi == axis_.cos_phi && axis.sin_phi == axis_.sin_phi &&
                           axis.sigma_px == axis_.sigma_px;
      if (!is_same) cut_.emplace(mode_, axis, extent_);
      axis_ = axis;
      return mode_.weight * cut_->answer(r_px);
    }
    double share = 0.0;
    for (const ReachedPixel& pixel : pixels_) {
      const double offset = pixel.x_px * axis.cos_phi + pixel.y_px * axis.sin_phi - r_px;
      share += pixel.part.share * std::exp(-0.5 * offset * offset / (axis.sigma_px * axis.sigma_px));
    }
    return mode_.weight * share;
  }

 private:
  const Footprint mode_;
  const MonitorExtent extent_;
  std::vector<ReachedPixel> pixels_;  // of a narrow footprint
  StripeAxis axis_;
  std::optional<CutFootprint> cut_;  // of a wider one, for this axis
};

}  // namespace

PatternAnswers::PatternAnswers(std::vector<ShownPattern> patterns, const MonitorExtent& extent)
    : patterns_(std::move(patterns)), extent_(extent) {
  for (const ShownPattern& pattern : patterns_)
    phases_.push_back({std::cos(pattern.phase_rad), std::sin(pattern.phase_rad)});
}

void PatternAnswers::of_wave(const Footprint& mode, size_t first, size_t last, bool cut, double level,
                             double* columns, std::ptrdiff_t stride) const {
  const double fx = patterns_[first].fx, fy = patterns_[first].fy;
  WaveAnswer wave;
  if (cut) {
    wave = answer_of(mode, fx, fy, extent_);
  } else {
    const double wx = 2.0 * std::numbers::pi * fx, wy = 2.0 * std::numbers::pi * fy;
    const double turned = wx * wx * mode.xx_px2 + 2.0 * wx * wy * mode.xy_px2 + wy * wy * mode.yy_px2;
    const std::complex<double> unit =
        std::polar(sinc(fx) * sinc(fy) * std::exp(-0.5 * turned), wx * mode.x_px + wy * mode.y_px);
    wave.value = mode.weight * unit;
    const std::complex<double> turn(-wave.value.imag(), wave.value.real());
    wave.slope = {unit,
                  wx * turn,
                  wy * turn,
                  -0.5 * wx * wx * wave.value,
                  -wx * wy * wave.value,
                  -0.5 * wy * wy * wave.value};
  }
  for (size_t i = first; i < last; ++i) {
    const auto [c, s] = phases_[i];
    const auto seen = [c = c, s = s](const std::complex<double>& z) {
      return 0.5 * (z.real() * c + z.imag() * s);
    };
    double* const at = columns + (i - first);
    at[0] = 0.5 * level + seen(wave.value);
    for (std::ptrdiff_t p = 0; p < 6; ++p) at[(p + 1) * stride] = seen(wave.slope[p]);
  }
}

size_t PatternAnswers::end_of_wave(size_t first) const {
  size_t last = first;
  while (last < patterns_.size() && patterns_[last].kind == ShownPattern::Kind::kWave &&
         patterns_[last].fx == patterns_[first].fx && patterns_[last].fy == patterns_[first].fy)
    ++last;
  return last;
}

bool PatternAnswers::cut(const Footprint& mode, bool through_pixels) const {
  return near_edge(mode, extent_) && (through_pixels || is_cut(mode, extent_));
}

void PatternAnswers::of(const Footprint& mode, bool through_pixels, double* columns,
                        std::ptrdiff_t stride) const {
  const bool cut = this->cut(mode, through_pixels);
  LitShare share(mode, extent_);
  // The derivatives of H(0).
  const Answer level = of_area(share, mode, {});
  const bool narrow = !cut && through_pixels;
  const Footprint seen = narrow ? seen_through_pixels(mode) : mode;
  const auto put = [&](size_t i, const Answer& answer) {
    columns[i] = answer.value;
    for (std::ptrdiff_t p = 0; p < 6; ++p)
      columns[static_cast<std::ptrdiff_t>(i) + (p + 1) * stride] = answer.slope[p];
  };
  for (size_t i = 0; i < patterns_.size();) {
    const ShownPattern& pattern = patterns_[i];
    if (pattern.kind == ShownPattern::Kind::kArea) {
      put(i, of_area(share, mode, pattern.lit));
      ++i;
      continue;
    }
    size_t last = i + 1;
    if (pattern.kind == ShownPattern::Kind::kStripe) {
      put(i, cut ? of_cut_stripe(mode, pattern.axis, pattern.r_px, extent_)
                 : of_stripe(seen, pattern.axis, pattern.r_px));
    } else {
      last = end_of_wave(i);
      of_wave(seen, i, last, cut, level.value, columns + i, stride);
      for (size_t k = i; k < last; ++k) {
        for (std::ptrdiff_t p = 0; p < 6; ++p)
          columns[static_cast<std::ptrdiff_t>(k) + (p + 1) * stride] += 0.5 * level.slope[p];
      }
    }
    i = last;
  }
  if (!narrow) return;
  const SeenAxis x = seen_through_pixels(mode.x_px, mode.xx_px2),
                 y = seen_through_pixels(mode.y_px, mode.yy_px2);
  for (size_t i = 0; i < patterns_.size(); ++i) {
    if (patterns_[i].kind == ShownPattern::Kind::kArea) continue;
    double* const at = columns + i;
    const double by_x = at[2 * stride], by_y = at[3 * stride], by_xx = at[4 * stride], by_yy = at[6 * stride];
    at[2 * stride] = by_x * x.centre_by_centre + by_xx * x.variance_by_centre;
    at[3 * stride] = by_y * y.centre_by_centre + by_yy * y.variance_by_centre;
    at[4 * stride] = by_x * x.centre_by_variance + by_xx * x.variance_by_variance;
    at[5 * stride] *= x.centre_by_centre * y.centre_by_centre;
    at[6 * stride] = by_y * y.centre_by_variance + by_yy * y.variance_by_variance;
  }
}

void PatternAnswers::values(const Footprint& mode, double* column) const {
  const bool cut = this->cut(mode, true);
  const Footprint seen = cut ? mode : seen_through_pixels(mode);
  LitShare share(mode, extent_);
  const double level = mode.weight * share.of({}).share;
  std::optional<CutStripes> stripes;
  if (cut) stripes.emplace(mode, extent_);
  std::vector<double> wave;
  for (size_t i = 0; i < patterns_.size();) {
    const ShownPattern& pattern = patterns_[i];
    if (pattern.kind == ShownPattern::Kind::kWave) {
      const size_t count = end_of_wave(i) - i;
      wave.resize(kColumns * count);
      of_wave(seen, i, i + count, cut, level, wave.data(), static_cast<std::ptrdiff_t>(count));
      std::copy_n(wave.begin(), count, column + i);
      i += count;
      continue;
    }
    if (pattern.kind == ShownPattern::Kind::kArea) {
      column[i] = mode.weight * share.of(pattern.lit).share;
    } else {
      const StripeAxis& axis = pattern.axis;
      const double offset = pattern.r_px - seen.x_px * axis.cos_phi - seen.y_px * axis.sin_phi;
      const bool is_far = offset * offset > kFar * answered_variance(seen, axis);
      column[i] = is_far ? 0.0
                  : cut  ? stripes->answer(axis, pattern.r_px)
                         : of_stripe(seen, axis, pattern.r_px).value;
    }
    ++i;
  }
}

}  // namespace glasswing
