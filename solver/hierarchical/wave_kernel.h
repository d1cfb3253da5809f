// The vector kernels of WaveAxis.
#pragma once

#include <array>
#include <cstddef>

namespace glasswing::internal {

inline constexpr size_t kWaveLanes = 8;  // waves are padded with weight 0 to a multiple of this

// The four pairs of two cells for the low end and two for the high end, in this order: (0, 0), (0, 1), (1,
// 0), (1, 1). By wave: the minimum of P in each cell, and `stride` later the maximum; P at the first point of
// the low cells and at the last of the high ones.
struct CellPairs {
  std::array<const float*, 2> low{}, high{}, first{}, last{};
  std::array<float, 4> shortest{}, longest{};  // distance of the ends, in grid steps
};

// Lower bounds of the cost with ends in those cells. v lies between the minimum and maximum of P(b) - P(a)
// over the shortest and longest distance, and the interval contains no more of the other sign than the hull
// of both cells.
std::array<float, 4> bounds_of(const CellPairs& pairs, const float* u, const float* weight, size_t stride);

// Two positions between points of the table of sums: P at the point before, `stride` later at the next, and
// the fraction in between.
struct PlacePair {
  const float *low = nullptr, *high = nullptr;
  float low_part = 0.0f, high_part = 0.0f;
  float distance = 1.0f;  // in grid steps
};

// sum_k w_k (u_k - v_k)^2 of the interval between them.
float cost_of(const PlacePair& pair, const float* u, const float* weight, size_t stride);

// Three positions of each end of an interval: P at the points before, `stride` later at the next, and the
// fractions in between.
struct PlaceGrid {
  std::array<const float*, 3> low{}, high{};
  std::array<float, 3> low_part{}, high_part{};
  std::array<float, 9> distance{};  // in grid steps, [low][high]; pairs at no distance have no cost
};

// The costs of the nine intervals, [low][high].
std::array<float, 9> costs_of(const PlaceGrid& grid, const float* u, const float* weight, size_t stride);

// Square waves that continue beyond the monitor, by wave.
struct SoftWaves {
  const float *bar_px = nullptr, *offset_px = nullptr;
};

// A Gaussian's means of them and their derivatives (WaveAxis::soft_means). The centre's whole and fractional
// pixels are separate so that floats are precise enough far from 0.
struct SoftPlace {
  float whole_px = 0.0f, part_px = 0.0f, sigma_px = 1.0f;
};
void soft_means_of(const SoftWaves& waves, const SoftPlace& place, size_t stride, float* v, float* by_t,
                   float* by_sigma);

// The normal equations of the residuals u - v of such means in the centre t and sigma s.
struct SoftSums {
  float cost = 0.0f, t = 0.0f, s = 0.0f, tt = 0.0f, ts = 0.0f, ss = 0.0f;
};
SoftSums soft_sums_of(const SoftWaves& waves, const SoftPlace& place, const float* u, const float* weight,
                      size_t stride);

}  // namespace glasswing::internal
