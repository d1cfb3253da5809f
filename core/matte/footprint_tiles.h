// A mode as weights of samples of a pyramid, elliptical weighted averages (Greene and Heckbert 1986) on the
// level that suits the footprint's narrowest part.
//
// On flat pixels the exact weight of pixel k is a_k, the integral of G over it: a Gaussian of covariance
// Sigma + I/12 at the pixels' middles, but for terms of fourth order. Weights b_j of samples of level l are
// worth weights sum_j b_j h_l(k - 2^l j) of pixels, h_l being the level's filter, so b is a Gaussian of what
// is left of the covariance, in samples^2 of the level,
//
//   B_l = (Sigma + I/12 - 5 I (4^l - 1)/12) / 4^l = (Sigma + I/2) / 4^l - 5 I/12
//
// sampled and scaled to the sum 1. The highest level is taken on which no row or column cuts from B a
// Gaussian of less variance than kMinVariance. What is narrower even on the picture itself is integrated
// over its pixels.
//
// Weights of upright footprints are products of one of columns and one of rows; oriented ones have columns of
// their own in each row, since a cut of a Gaussian is a Gaussian whose middle moves from row to row.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/matte/matte.h"
#include "core/matte/pyramid.h"

namespace glasswing {

class FootprintTiles {
 public:
  // No footprint has many more tiles than `max_tiles`: it goes to higher levels instead, where it is widened
  // to what these can show. A long and thin one at 45 degrees has a tile a row.
  FootprintTiles(const PyramidShape& shape, int max_tiles) : shape_(shape), max_tiles_(max_tiles) {}

  // Appends them and returns how many they are. `channel` is where their samples begin.
  int add(const Mode& mode, int channel, std::vector<std::uint16_t>& words);
  // Of an upright box (kBoxFootprint), from the picture itself.
  int add_box(const Mode& mode, int channel, std::vector<std::uint16_t>& words);
  // Few enough pixels that a table of sums would take no less time.
  static bool is_small_box(const Mode& mode);

  // The highest level that a tile was of.
  int highest_level() const { return highest_level_; }

 private:
  struct Place {
    int level = 0;
    double x = 0, y = 0, xx = 0, xy = 0, yy = 0;  // samples of the level; B
  };
  // Weights of neighbours, the first of which is sample `first`.
  struct Taps {
    int first = 0;
    std::vector<float> weights;
    bool empty() const { return weights.empty(); }
  };
  struct Tap {
    int x, y;
    double weight;
  };

  Place place_of(const Mode& mode) const;
  void sample(double centre, double variance, double reach, int extent, Taps& taps) const;
  void integrate(double centre, double variance, int extent, Taps& taps) const;
  void add_product(const PyramidShape::Level& level, double weight, int channel);
  void add_oriented(const Place& place, double weight, int channel);
  void add_thin(const Mode& mode, int channel);
  void add_row(const PyramidShape::Level& level, int x, int y, std::span<const float> across, double weight,
               int channel);

  const PyramidShape& shape_;
  const int max_tiles_;
  int highest_level_ = 0;
  // Of the footprint at hand.
  double reach_ = 0.0, thin_reach_ = 0.0;  // sigmas
  Taps across_, down_;
  std::vector<Tap> thin_;
  std::vector<std::uint16_t>* words_ = nullptr;
  int count_ = 0;
};

}  // namespace glasswing
