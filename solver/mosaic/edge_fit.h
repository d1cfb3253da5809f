// A straight edge between paths of light, from the parts of the pixels around that a path takes,
//
//   part_c(q) = ramp(n . q - d_c),    ramp(t) = clamp(1/2 + t / (|n_x| + |n_y|), 0, 1)
//
// the part of a square pixel on one side of a line, except for its corners. The sites of a mosaic give few
// samples of a channel; together they determine the edge's direction, which is the same in all. Dispersion
// moves it from channel to channel: each has its own d, drawn towards that of the pixel's own channel.
#pragma once

#include <span>

namespace glasswing {

struct EdgeSample {
  int dx = 0, dy = 0, channel = 0;  // picture px from the pixel
  double part = 0.0;                // 0 to 1
};

// How far from the pixel samples may be along x and y, px.
inline constexpr int kEdgeReach = 2;

// The part of the pixel at (0, 0) in channel `wanted`, by least squares over the samples, the nearer the
// more. `own`: the channel that was measured there.
double part_by_edge(std::span<const EdgeSample> samples, int own, int wanted);

}  // namespace glasswing
