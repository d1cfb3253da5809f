#include "solver/alpha/alpha_method.h"

#include <algorithm>
#include <cmath>

#include "core/base/status.h"
#include "core/method/methods.h"
#include "solver/background/surroundings.h"

namespace glasswing {
namespace {

constexpr double kPoorNoise = 4.0, kPoorLight = 0.05;  // a residual above both, of full scale, is poor
constexpr double kMinInside = 0.05;

class AlphaSolver {
 public:
  // Keeps references to the stack and the layout.
  AlphaSolver(const FrameStack& stack, const BackingLayout& layout, int backings, const Vlahos& constants,
              double silhouette_tolerance)
      : stack_(stack),
        layout_(layout),
        backings_(backings),
        constants_(constants),
        surroundings_(stack, layout.stage, silhouette_tolerance),
        samples_(layout.backings.size()) {}

  void solve_row(int y, Matte& matte) {
    const std::vector<bool> object = surroundings_.settle_row(y, {}, matte).object;
    for (int x = 0; x < matte.width_px(); ++x) {
      if (object[x]) solve_pixel(x, y, matte);
    }
  }

 private:
  // Returns whether a sample is saturated.
  bool gather(int x, int y) {
    bool saturated = false;
    for (size_t s = 0; s < samples_.size(); ++s) {
      for (int c = 0; c < kChannels; ++c) {
        const size_t index = stack_.sample_index(x, y, c), channel = static_cast<size_t>(c);
        const MergedSample object = merge(stack_, layout_.backings[s].object, index, surroundings_.noise());
        const MergedSample empty = merge(stack_, layout_.backings[s].empty, index, surroundings_.noise());
        samples_[s].object[channel] = object.radiance;
        samples_[s].empty[channel] = empty.radiance;
        samples_[s].variance[channel] = object.variance + empty.variance;
        saturated = saturated || object.saturated || empty.saturated;
      }
    }
    return saturated;
  }

  // One channel of the empty stage: its light without the monitor, and the light that radiance 1 adds, by
  // least squares over the backings. If these do not differ in the channel, all light is assumed to come from
  // the monitor.
  struct Line {
    double dark = 0.0, slope = 0.0;
    bool known = false;
  };
  Line line_of(size_t c) const {
    double light = 0.0, seen = 0.0, square = 0.0, product = 0.0;
    for (size_t s = 0; s < samples_.size(); ++s) {
      const double own = layout_.backings[s].light[c];
      light += own;
      seen += samples_[s].empty[c];
      square += own * own;
      product += own * samples_[s].empty[c];
    }
    const auto count = static_cast<double>(samples_.size());
    const double spread = square - light * light / count;
    if (spread > 1e-9) {
      const double slope = (product - light * seen / count) / spread;
      return {.dark = (seen - slope * light) / count, .slope = std::max(slope, 0.0), .known = true};
    }
    if (light > 0.0) return {.dark = 0.0, .slope = seen / light, .known = true};
    return {.dark = seen / count, .slope = 0.0, .known = false};
  }

  void solve_pixel(int x, int y, Matte& matte) {
    std::uint8_t& flags = matte.flags(x, y);
    if (gather(x, y)) flags |= kFlagSaturated;
    const Cover cover = backings_ == 2 ? triangulate(samples_) : key_out(samples_.front(), constants_);
    const double noise_sd = std::sqrt(surroundings_.noise().variance(0.0));
    if (cover.rms > std::max(kPoorNoise * noise_sd, kPoorLight)) flags |= kFlagPoorFit;
    matte.coverage(x, y) = static_cast<float>(1.0 - cover.straight);
    std::array<Line, kChannels> lines;
    double slopes = 0.0, known = 0.0;
    for (size_t c = 0; c < kChannels; ++c) {
      lines[c] = line_of(c);
      slopes += lines[c].known ? lines[c].slope : 0.0;
      known += lines[c].known ? 1.0 : 0.0;
    }
    const BackgroundPoint& point = surroundings_.background(x, y)[layout_.texture];
    const double inside = std::max(point.axis[0].inside * point.axis[1].inside, kMinInside);
    for (int c = 0; c < kChannels; ++c) {
      const size_t channel = c;
      // A channel in which no backing has light is assumed to be like the others.
      const double slope = lines[channel].known ? lines[channel].slope : slopes / std::max(known, 1.0);
      matte.foreground(x, y)[channel] =
          static_cast<float>(cover.foreground[channel] + cover.straight * lines[channel].dark);
      if (!point.seen || cover.straight * slope <= 0.0) continue;
      Mode& mode = matte.modes(x, y, c)[0] = point.mode(c, layout_.texture);
      mode.weight = static_cast<float>(cover.straight * slope / inside);
      mode.weight_sd = static_cast<float>(cover.straight_sd * slope / inside);
    }
  }

  const FrameStack& stack_;
  const BackingLayout& layout_;
  const int backings_;
  const Vlahos constants_;
  Surroundings surroundings_;
  std::vector<BackingSample> samples_;
};

class PreparedAlpha final : public PreparedMethod {
 public:
  PreparedAlpha(v1::MatteMetadata metadata, BackingLayout layout, int backings, const Vlahos& constants,
                double silhouette_tolerance)
      : metadata_(std::move(metadata)),
        layout_(std::move(layout)),
        backings_(backings),
        constants_(constants),
        silhouette_tolerance_(silhouette_tolerance),
        needed_(frames_of(layout_)) {}

  const std::vector<int>& frames_needed() const override { return needed_; }

  absl::StatusOr<Matte> solve(const FrameStack& rows) const override {
    Matte matte = blank_matte(rows, metadata_, std::clamp(metadata_.monitors_size(), 1, kMaxModes));
    AlphaSolver solver(rows, layout_, backings_, constants_, silhouette_tolerance_);
    for (int y = 0; y < rows.row_count; ++y) solver.solve_row(y, matte);
    return matte;
  }

 private:
  const v1::MatteMetadata metadata_;
  const BackingLayout layout_;
  const int backings_;
  const Vlahos constants_;
  const double silhouette_tolerance_;
  const std::vector<int> needed_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Method>> AlphaMethod::create(const MethodOptions& options) {
  GW_ASSIGN_OR_RETURN(const OptionValues values, OptionValues::read("alpha", options));
  auto method = std::make_unique<AlphaMethod>();
  method->options_ = options;
  method->backings_ = values.whole("backings");
  method->constants_.a1 = values.number("a1");
  method->constants_.a2 = values.number("a2");
  method->silhouette_tolerance_ = values.number("silhouette_tolerance");
  return method;
}

absl::StatusOr<std::unique_ptr<PreparedMethod>> AlphaMethod::prepare(
    const v1::CaptureManifest& manifest) const {
  GW_ASSIGN_OR_RETURN(BackingLayout layout, lay_out_backings(manifest, backings_));
  Vlahos constants = constants_;
  constants.key = layout.key;
  return std::make_unique<PreparedAlpha>(metadata_of(manifest, "alpha", options_), std::move(layout),
                                         backings_, constants, silhouette_tolerance_);
}

}  // namespace glasswing
