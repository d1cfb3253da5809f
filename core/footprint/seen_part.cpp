#include "core/footprint/seen_part.h"

#include <Eigen/Core>

#include "core/footprint/normal_rectangle.h"

namespace glasswing {
namespace {

constexpr double kLeastShare = 1e-6;      // below it the share has too few digits
constexpr double kPixelPx2 = 1.0 / 12.0;  // of a point, whose light fills a pixel

}  // namespace

Footprint seen_part(const Footprint& footprint, const MonitorExtent& extent) {
  Eigen::Matrix2d sigma;
  sigma << footprint.xx_px2 + kPixelPx2, footprint.xy_px2, footprint.xy_px2, footprint.yy_px2 + kPixelPx2;
  const NormalShare share =
      NormalOnRectangles(
          {.x = footprint.x_px, .y = footprint.y_px, .xx = sigma(0, 0), .xy = sigma(0, 1), .yy = sigma(1, 1)})
          .share({.left = 0.0, .top = 0.0, .right = extent.width_px, .bottom = extent.height_px});
  Footprint seen = footprint;
  if (!(share.share > kLeastShare)) {
    seen.weight = 0.0;
    return seen;
  }
  Eigen::Matrix2d by_sigma;
  by_sigma << share.by_xx, 0.5 * share.by_xy, 0.5 * share.by_xy, share.by_yy;
  const Eigen::Vector2d moved = sigma * Eigen::Vector2d(share.by_x, share.by_y) / share.share;
  const Eigen::Matrix2d part =
      sigma + 2.0 / share.share * sigma * by_sigma * sigma - moved * moved.transpose();
  seen.weight *= share.share;
  seen.x_px += moved.x();
  seen.y_px += moved.y();
  seen.xx_px2 = part(0, 0);
  seen.xy_px2 = part(0, 1);
  seen.yy_px2 = part(1, 1);
  return with_positive_covariance(seen, 0.0);
}

}  // namespace glasswing
