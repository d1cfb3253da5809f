#include "solver/frames/lit_view.h"

#include <cmath>
#include <numbers>

#include "core/footprint/footprint.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr double kClear_px = 1.5, kClearSigmas = 3.0;  // from a bar's edge: a flat pixel, and a small knock
constexpr size_t kMaxPixels = 1500;  // of a monitor: more tell gains no better than the model is right

// From the monitor's edge: what the camera's pixel sees, and a knock beyond it.
bool is_inside(const StagePoint& place, const EmptyMonitor& monitor) {
  const double x = 3.0 * std::sqrt(place.xx_px2) + 2.0, y = 3.0 * std::sqrt(place.yy_px2) + 2.0;
  return place.x_px > x && place.x_px < monitor.width_px - x && place.y_px > y &&
         place.y_px < monitor.height_px - y;
}

}  // namespace

LitView::LitView(const SessionSamples& samples, const std::vector<bool>& beside, const EmptyMonitor& monitor,
                 const SmoothStage& stage) {
  for (size_t p = 0; p < samples.pixels.size(); ++p) {
    if (!beside[p]) continue;
    const double x = samples.pixels[p].x + 0.5, y = samples.pixels[p].y + 0.5;
    LitPixel pixel{.pixel = p, .place = stage.map.at(x, y), .seen = {}};
    if (!is_inside(pixel.place, monitor)) continue;
    pixel.seen = seen_through_pixels({.weight = 1.0,
                                      .x_px = pixel.place.x_px,
                                      .y_px = pixel.place.y_px,
                                      .xx_px2 = pixel.place.xx_px2,
                                      .xy_px2 = pixel.place.xy_px2,
                                      .yy_px2 = pixel.place.yy_px2});
    const StagePoint right = stage.map.at(x + 0.5, y), left = stage.map.at(x - 0.5, y);
    const StagePoint below = stage.map.at(x, y + 0.5), above = stage.map.at(x, y - 0.5);
    pixel.x_by_x = right.x_px - left.x_px;
    pixel.y_by_x = right.y_px - left.y_px;
    pixel.x_by_y = below.x_px - above.x_px;
    pixel.y_by_y = below.y_px - above.y_px;
    pixels_.push_back(pixel);
  }
  const size_t step = pixels_.size() / kMaxPixels + 1;
  for (size_t i = 0; i * step < pixels_.size(); ++i) pixels_[i] = pixels_[i * step];
  pixels_.resize((pixels_.size() + step - 1) / step);
}

std::optional<LitView::Picture> LitView::Picture::of(const v1::Stimulus& stimulus) {
  Picture picture;
  for (int c = 0; c < kChannels; ++c) picture.level_[c] = colour_of(stimulus, c);
  switch (kind_of(stimulus)) {
    case StimulusKind::kSolid:
      return picture;
    case StimulusKind::kSquare: {
      picture.kind_ = Kind::kBars;
      picture.vertical_ = stimulus.orient() == "vertical_bars";
      picture.inverse_ = stimulus.inverse();
      if (stimulus.offset_px() != 0.0 || !(stimulus.bar_width_px() >= 1.0)) return std::nullopt;
      picture.bar_px_ = stimulus.bar_width_px();
      return picture;
    }
    case StimulusKind::kStripe:
      picture.kind_ = Kind::kStripe;
      picture.cos_phi_ = std::cos(stimulus.phi_deg() * std::numbers::pi / 180.0);
      picture.sin_phi_ = std::sin(stimulus.phi_deg() * std::numbers::pi / 180.0);
      picture.sigma_px_ = stimulus.sigma_px();
      picture.r_px_ = stimulus.r_px();
      for (double& level : picture.level_) level *= stimulus.peak();
      return picture;
    default:
      return std::nullopt;
  }
}

ShownLight LitView::Picture::at(const LitPixel& pixel, double dx_px, double dy_px) const {
  // What moved by (dx, dy) in the picture shows what lay at the place before.
  const double x_px = pixel.place.x_px - pixel.x_by_x * dx_px - pixel.x_by_y * dy_px;
  const double y_px = pixel.place.y_px - pixel.y_by_x * dx_px - pixel.y_by_y * dy_px;
  if (kind_ == Kind::kSolid) return {.h = 1.0};
  if (kind_ == Kind::kBars) {
    const double t_px = vertical_ ? x_px : y_px,
                 sigma_px = std::sqrt(vertical_ ? pixel.place.xx_px2 : pixel.place.yy_px2);
    const double bar = std::floor(t_px / bar_px_), past_px = t_px - bar * bar_px_;
    if (std::min(past_px, bar_px_ - past_px) < kClear_px + kClearSigmas * sigma_px) return {.h = NAN};
    return {.h = (static_cast<int>(bar) % 2 == 0) != inverse_ ? 1.0 : 0.0};
  }
  const Footprint& seen = pixel.seen;
  const double variance_px2 = cos_phi_ * cos_phi_ * seen.xx_px2 + 2.0 * cos_phi_ * sin_phi_ * seen.xy_px2 +
                              sin_phi_ * sin_phi_ * seen.yy_px2 + sigma_px_ * sigma_px_ + kFlatPixel_px2;
  const double away_px = r_px_ - cos_phi_ * (x_px + seen.x_px - pixel.place.x_px) -
                         sin_phi_ * (y_px + seen.y_px - pixel.place.y_px);
  if (away_px * away_px > 50.0 * variance_px2) return {};
  const double h = sigma_px_ / std::sqrt(variance_px2) * std::exp(-0.5 * away_px * away_px / variance_px2);
  const double by_place = h * away_px / variance_px2;
  return {.h = h, .by_x = by_place * cos_phi_, .by_y = by_place * sin_phi_};
}

}  // namespace glasswing
