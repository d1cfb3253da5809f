#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/ramp/colour_manifold_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "solver/ramp/colour_manifold_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using internal::ManifoldTable;
using D = hn::CappedTag<float, 16>;
using Places = hn::RebindToSigned<D>;
using V = hn::Vec<D>;
static_assert(ColourManifold::Colours::kMax % 16 == 0);

V Dot(const std::array<float, 3>& row, const V* light) {
  const D d;
  return hn::MulAdd(hn::Set(d, row[0]), light[0],
                    hn::MulAdd(hn::Set(d, row[1]), light[1], hn::Mul(hn::Set(d, row[2]), light[2])));
}

// Gathers one of the four numbers of nodes.
V Part(const float* numbers, hn::Vec<Places> node, int part) {
  const Places places;
  return hn::GatherIndex(D(), numbers, hn::Add(hn::ShiftLeft<2>(node), hn::Set(places, part)));
}

// Bilinear interpolation.
V Between(const float* numbers, int row, hn::Vec<Places> node, int part, V across, V down) {
  const float* const low = numbers + size_t{4} * static_cast<size_t>(row);
  const V a = Part(numbers, node, part), b = Part(numbers, node, part + 4);
  const V c = Part(low, node, part), e = Part(low, node, part + 4);
  const V above = hn::MulAdd(across, hn::Sub(b, a), a), below = hn::MulAdd(across, hn::Sub(e, c), c);
  return hn::MulAdd(down, hn::Sub(below, above), above);
}

void Find(const ManifoldTable& table, ColourManifold::Colours& colours, size_t at) {
  const D d;
  const Places places;
  const V zero = hn::Zero(d);
  V light[3];
  for (size_t c = 0; c < 3; ++c) light[c] = hn::LoadU(d, &colours.light[c][at]);
  const V level = Dot(table.level, light);
  const V per_level = hn::Div(hn::Set(d, 1.0f), level);
  const V top_a = hn::Mul(Dot(table.to_a, light), per_level);
  const V top_b = hn::Mul(Dot(table.to_b, light), per_level);
  const auto cells = [&](V top, size_t axis) {
    const V place = hn::Mul(hn::Sub(top, hn::Set(d, table.from[axis])), hn::Set(d, table.scale[axis]));
    // NaN is treated as 0.
    return hn::Min(hn::IfThenElseZero(hn::Gt(place, zero), place), hn::Set(d, table.most));
  };
  const V x = cells(top_a, 0), y = cells(top_b, 1);
  const auto column = hn::ConvertTo(places, x), row = hn::ConvertTo(places, y);
  const auto node = hn::Add(hn::Mul(row, hn::Set(places, table.row)), column);
  const V across = hn::Sub(x, hn::ConvertTo(d, column)), down = hn::Sub(y, hn::ConvertTo(d, row));
  V found[3];
  for (int part = 0; part < 3; ++part)
    found[part] = Between(table.nodes, table.row, node, part, across, down);
  const auto on_monitor =
      hn::And(hn::And(hn::Ge(found[0], zero), hn::Le(found[0], hn::Set(d, table.width_px))),
              hn::And(hn::Ge(found[1], zero), hn::Le(found[1], hn::Set(d, table.height_px))));
  if (!hn::AllTrue(d, on_monitor)) {
    for (int part = 0; part < 3; ++part) {
      const V held = Between(table.held, table.row, node, part, across, down);
      found[part] = hn::IfThenElse(on_monitor, found[part], held);
    }
  }
  hn::StoreU(found[0], d, &colours.x_px[at]);
  hn::StoreU(found[1], d, &colours.y_px[at]);
  hn::StoreU(hn::Mul(found[2], level), d, &colours.rho[at]);

  // Covariance of (a, b), then of c, of light on the plane n . C = 2.
  V aa = zero, ab = zero, bb = zero;
  for (size_t c = 0; c < 3; ++c) {
    const V variance = hn::LoadU(d, &colours.variance[c][at]), of_level = hn::Set(d, table.level[c]);
    const V da = hn::NegMulAdd(top_a, of_level, hn::Set(d, table.to_a[c])),
            db = hn::NegMulAdd(top_b, of_level, hn::Set(d, table.to_b[c]));
    aa = hn::MulAdd(variance, hn::Mul(da, da), aa);
    ab = hn::MulAdd(variance, hn::Mul(da, db), ab);
    bb = hn::MulAdd(variance, hn::Mul(db, db), bb);
  }
  const V x_a = Part(table.slopes, node, 0), x_b = Part(table.slopes, node, 1),
          y_a = Part(table.slopes, node, 2), y_b = Part(table.slopes, node, 3);
  const auto sum = [](V a, V b, V e, V f) { return hn::MulAdd(a, b, hn::Mul(e, f)); };
  const V xa = sum(x_a, aa, x_b, ab), xb = sum(x_a, ab, x_b, bb), ya = sum(y_a, aa, y_b, ab),
          yb = sum(y_a, ab, y_b, bb);
  const V xx = sum(xa, x_a, xb, x_b), xy = sum(xa, y_a, xb, y_b), yy = sum(ya, y_a, yb, y_b);
  const V determinant = hn::NegMulAdd(xy, xy, hn::Mul(xx, yy));
  const V share = hn::IfThenElseZero(hn::Gt(determinant, zero), hn::Div(hn::Mul(level, level), determinant));
  hn::StoreU(hn::Mul(yy, share), d, &colours.information_per_px2[0][at]);
  hn::StoreU(hn::Neg(hn::Mul(xy, share)), d, &colours.information_per_px2[1][at]);
  hn::StoreU(hn::Mul(xx, share), d, &colours.information_per_px2[2][at]);
}

void FindColours(const ManifoldTable& table, ColourManifold::Colours& colours, size_t count) {
  for (size_t at = 0; at < count; at += hn::Lanes(D())) Find(table, colours, at);
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(FindColours);

void internal::find_colours(const ManifoldTable& table, ColourManifold::Colours& colours, size_t count) {
  HWY_DYNAMIC_DISPATCH(FindColours)(table, colours, count);
}

}  // namespace glasswing
#endif
