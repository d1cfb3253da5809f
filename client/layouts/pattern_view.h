// What the lines of a stack show of its patterns. A pixel's value in a photograph is its code between the
// pixel's own lowest and highest code of the whole stack, 0 to 1, so what the patterns fall on does not
// count.
#pragma once

#include <array>
#include <vector>

#include "client/layouts/stack_samples.h"

namespace glasswing {

// A picture of bars, with its complement where there is one; indices of photographs.
struct BarShots {
  int lit = 0, complement = -1;
};

class PatternView {
 public:
  explicit PatternView(const StackSamples& samples);

  // The share of pixels that see the patterns: whose codes change by a quarter of what they change by at the
  // brightest pixels, and by 8 codes of 255.
  double lit_share() const { return lit_share_; }

  // A photograph as a whole.
  struct Look {
    double low = 0.0, high = 0.0;   // 5th and 95th percentile of the values
    double between = 0.0;           // share of values of 0.25 to 0.75
    std::array<double, 2> edges{};  // a pixel, along x and along y: crossings of 0.5
    bool white() const { return low > 0.7; }
    bool black() const { return high < 0.3; }
  };
  const Look& look(int photograph) const { return looks_[static_cast<size_t>(photograph)]; }
  // Crossings on the average line of this direction that a photograph must have for `edges` to count.
  double edges_of_line(int photograph, size_t axis) const;

  // Mean of |a + b - 1| over the values of two photographs: 0 for complements.
  double complement_error(int a, int b) const;

  // At the edges of `coarse` along an axis, what the next finer bars do.
  struct EdgeCounts {
    int rising = 0, falling = 0;           // edges of the coarse bars towards larger x or y
    int also_edge = 0, lit = 0, dark = 0;  // the finer ones change, are lit or dark on both sides
  };
  EdgeCounts edges(const BarShots& coarse, const BarShots& fine, size_t axis) const;

  // Photographs first to first + steps - 1 as steps of one wave.
  struct Fringe {
    double residual = 0.0;             // share of the modulation's energy that no sinusoid explains
    double mean_spread = 0.0;          // standard deviation over pixels of the mean of the steps
    std::array<double, 2> turn_rad{};  // mean change of the phase from pixel to pixel, along x and along y
  };
  Fringe fringe(int first, int steps) const;

 private:
  struct Lines {
    SampledLines values;
    std::vector<char> lit;
  };
  Look look_at(size_t photograph) const;
  float value(const Lines& lines, const BarShots& shots, size_t at) const;

  std::array<Lines, 2> lines_;  // along x, along y
  double lit_share_ = 0.0;
  std::vector<Look> looks_;
};

}  // namespace glasswing
