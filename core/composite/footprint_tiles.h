// Converts a mode to weights of pyramid samples: elliptical weighted averages (Greene and Heckbert 1986) on
// the level that suits the footprint's narrowest part.
//
// For constant pixels the exact weight of pixel k is a_k, the integral of G over it: a Gaussian of covariance
// Sigma + I/12 at the pixels' centres, up to terms of fourth order. Weights b_j of samples of level l are
// equivalent to weights sum_j b_j h_l(k - 2^l j) of pixels, with h_l the level's filter, so b is a Gaussian
// of the remaining covariance, in samples^2 of the level,
//
//   B_l = (Sigma + I/12 - 5 I (4^l - 1)/12) / 4^l = (Sigma + I/2) / 4^l - 5 I/12
//
// sampled and scaled to the sum 1. The level is the highest on which no cut of B along a row or column has a
// variance below kMinVariance. Footprints narrower than that on the picture itself are integrated over its
// pixels.
//
// Weights of upright footprints are products of column weights and row weights; oriented ones have column
// weights for each row, since a cut of a Gaussian is a Gaussian whose centre moves from row to row.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/composite/pyramid.h"
#include "core/composite/tile_kernel.h"
#include "core/matte/matte.h"

namespace glasswing {

class FootprintTiles {
 public:
  // A footprint that would need more than about `max_tiles` tiles moves to higher levels, and is widened to
  // what these can represent. A long and thin one at 45 degrees needs a tile per row.
  FootprintTiles(const PyramidShape& shape, int max_tiles) : shape_(shape), max_tiles_(max_tiles) {}

  // Appends the tiles of a mode to `words` and returns their number. `channel` is the channel they sample.
  int add(const Mode& mode, int channel, std::vector<std::uint16_t>& words);
  // The same for an upright box (kBoxFootprint), on the picture itself.
  int add_box(const Mode& mode, int channel, std::vector<std::uint16_t>& words);
  // The same for a pyramid's coefficients, as points of the picture's meshes.
  int add_pyramid(const PyramidFootprint& pyramid, int channel, std::vector<std::uint16_t>& words);
  // True if the box covers so few pixels that a summed-area table would not be faster.
  static bool is_small_box(const Mode& mode);

  // The highest level used by a tile, and the highest mesh, -1: none.
  int highest_level() const { return highest_level_; }
  int highest_mesh() const { return highest_mesh_; }

 private:
  struct Placement {
    int level = 0;
    double x = 0, y = 0, xx = 0, xy = 0, yy = 0;  // in samples of the level; xx, xy, yy: B
    float weight = 0.0f;
  };
  // Weights of consecutive samples from `first` on.
  struct Taps {
    int first = 0;
    std::vector<float> weights;
    bool empty() const { return weights.empty(); }
  };
  struct Tap {
    int x, y;
    double weight;
  };

  Placement place(const Mode& mode) const;
  class Gaussian;
  void sample(double centre, Gaussian gaussian, double reach, int extent, Taps& taps) const;
  void integrate(double centre, double variance, int extent, Taps& taps) const;
  void add_product(const PyramidShape::Level& level, double weight, int channel);
  void add_oriented(const Placement& placed, double weight, int channel);
  // A footprint on the picture itself, narrow along u for each v: x and y, or the other way round.
  struct Thin {
    double u = 0.0, v = 0.0, sigma = 0.0;  // centre; sigma along v
    double slope = 0.0, cut = 0.0;         // by which u moves with v, and its variance for one v
    int u_extent = 0, v_extent = 0;
  };
  void add_thin(const Mode& mode, int channel);
  void add_panels(const Thin& thin);
  void add_lines(const Thin& thin);
  void add_tap(size_t begin, int u, int v, double weight);
  void add_row(const PyramidShape::Level& level, int x, int y, std::span<const float> across, double weight,
               int channel);

  const PyramidShape& shape_;
  const int max_tiles_;
  int highest_level_ = 0, highest_mesh_ = -1;
  // State of the footprint being added.
  double reach_ = 0.0, thin_reach_ = 0.0;  // sigmas
  Taps across_, down_;
  RowCuts cuts_;
  std::vector<Tap> thin_;
  std::vector<Point> points_;
  std::vector<std::uint16_t>* words_ = nullptr;
  int count_ = 0;
};

}  // namespace glasswing
