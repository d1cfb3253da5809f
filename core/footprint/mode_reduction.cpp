#include "core/footprint/mode_reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/footprint/footprint.h"

namespace glasswing {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

double log_area(const Mode& mode) {
  const double xx = double{mode.xx_px2} + kFlatPixel_px2, yy = double{mode.yy_px2} + kFlatPixel_px2,
               xy = double{mode.xy_px2};
  return std::log(std::max(xx * yy - xy * xy, 1e-6 * xx * yy));
}

double loss(const Mode& a, const Mode& b, bool boxes) {
  if (a.texture != b.texture) return kNever;
  const Mode both = merged(a, b, boxes);
  return 0.5 * (double{both.weight} * log_area(both) - double{a.weight} * log_area(a) -
                double{b.weight} * log_area(b));
}

// Of each mode, the best partner among those after it.
struct Partner {
  size_t place = 0;
  double loss = kNever;
};

class Reduction {
 public:
  Reduction(std::vector<Mode>& modes, bool boxes) : modes_(modes), boxes_(boxes), partners_(modes.size()) {
    for (size_t i = 0; i < modes_.size(); ++i) find_partner(i);
  }

  // Merges one pair; false if there is none.
  bool merge() {
    const auto best = std::ranges::min_element(partners_, {}, &Partner::loss);
    if (best == partners_.end() || best->loss == kNever) return false;
    const size_t kept = best - partners_.begin();
    const size_t gone = best->place, last = modes_.size() - 1;
    modes_[kept] = merged(modes_[kept], modes_[gone], boxes_);
    modes_[gone] = modes_[last];
    modes_.pop_back();
    partners_.pop_back();
    for (size_t i = 0; i < modes_.size(); ++i) {
      const size_t place = partners_[i].place;
      if (i == kept || i == gone || place == kept || place == gone || place == last) {
        find_partner(i);
      } else {
        for (const size_t changed : {kept, gone}) {
          if (changed > i && changed < modes_.size()) consider(i, changed);
        }
      }
    }
    return true;
  }

 private:
  void consider(size_t i, size_t other) {
    const double own = loss(modes_[i], modes_[other], boxes_);
    if (own < partners_[i].loss) partners_[i] = {other, own};
  }
  void find_partner(size_t i) {
    partners_[i] = {};
    for (size_t other = i + 1; other < modes_.size(); ++other) consider(i, other);
  }

  std::vector<Mode>& modes_;
  const bool boxes_;
  std::vector<Partner> partners_;
};

}  // namespace

Mode merged(const Mode& a, const Mode& b, bool boxes) {
  const double weight = double{a.weight} + double{b.weight}, of_a = double{a.weight} / weight,
               of_b = double{b.weight} / weight;
  const double dx = double{b.x_px} - double{a.x_px}, dy = double{b.y_px} - double{a.y_px};
  const auto mean = [&](float one, float other) { return of_a * double{one} + of_b * double{other}; };
  Mode both = a;
  both.weight = static_cast<float>(weight);
  both.x_px = static_cast<float>(mean(a.x_px, b.x_px));
  both.y_px = static_cast<float>(mean(a.y_px, b.y_px));
  both.xx_px2 = static_cast<float>(mean(a.xx_px2, b.xx_px2) + of_a * of_b * dx * dx);
  both.xy_px2 = boxes ? 0.0f : static_cast<float>(mean(a.xy_px2, b.xy_px2) + of_a * of_b * dx * dy);
  both.yy_px2 = static_cast<float>(mean(a.yy_px2, b.yy_px2) + of_a * of_b * dy * dy);
  both.weight_sd = a.weight_sd > 0.0f && b.weight_sd > 0.0f ? std::hypot(a.weight_sd, b.weight_sd) : 0.0f;
  // dc = (R_a dc_a + R_b dc_b + (c_a - c) dR_a + (c_b - c) dR_b) / R, rms of x and y.
  const double apart = std::sqrt(0.5 * (dx * dx + dy * dy)) / weight;
  both.centre_sd_px =
      a.centre_sd_px > 0.0f && b.centre_sd_px > 0.0f
          ? static_cast<float>(std::hypot(
                std::hypot(of_a * double{a.centre_sd_px}, of_b * double{b.centre_sd_px}),
                std::hypot(of_b * apart * double{a.weight_sd}, of_a * apart * double{b.weight_sd})))
          : 0.0f;
  return both;
}

void reduce_modes(std::vector<Mode>& modes, int max_modes, bool boxes) {
  std::erase_if(modes, [](const Mode& mode) { return !(mode.weight > 0.0f); });
  if (std::ssize(modes) > max_modes) {
    Reduction reduction(modes, boxes);
    while (std::ssize(modes) > max_modes && reduction.merge()) {
    }
  }
  std::ranges::stable_sort(modes, std::ranges::greater(), &Mode::weight);
}

Mode scaled(Mode mode, float share) {
  mode.weight *= share;
  mode.weight_sd *= share;
  return mode;
}

Matte with_places(const Matte& matte, int modes_per_channel, bool colourless) {
  Matte out(matte.x0_px(), matte.y0_px(), matte.width_px(), matte.height_px(), modes_per_channel, colourless);
  out.metadata = matte.metadata;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      out.foreground(x, y) = matte.foreground(x, y);
      out.coverage(x, y) = matte.coverage(x, y);
      out.flags(x, y) = matte.flags(x, y);
      for (int c = 0; c < (colourless ? 1 : kChannels); ++c) {
        auto place = out.modes(x, y, c).begin();
        for (const Mode& mode : matte.modes(x, y, c)) {
          if (mode.weight > 0.0f) *place++ = mode;
        }
      }
    }
  }
  return out;
}

}  // namespace glasswing
