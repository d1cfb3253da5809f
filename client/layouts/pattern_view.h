// What the lines of a stack show of its patterns. A pixel's value in a photograph is its code between the
// pixel's own dark and lit code in the stack, 0 to 1, so what the patterns fall on does not count. Dark and
// lit are a tenth of the photographs from the lowest and highest: a few bad ones do not decide.
#pragma once

#include <array>
#include <complex>
#include <utility>
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

  int photographs() const { return static_cast<int>(looks_.size()); }
  // The share of pixels that see the patterns: whose codes change by a quarter of what they change by at the
  // brightest pixels, and by 8 codes of 255.
  double lit_share() const { return lit_share_; }

  // A photograph as a whole.
  struct Look {
    double low = 0.0, high = 0.0;     // 5th and 95th percentile of the values
    double between = 0.0;             // share of values in the middle half between them
    std::array<double, 2> edges{};    // on a line, along x and along y: changes between light and dark
    std::array<double, 2> density{};  // a pixel
    bool has_bars() const { return high - low >= kMinContrast && between < kMaxBetween; }
  };
  static constexpr double kMinContrast = 0.3, kMaxBetween = 0.6;
  const Look& look(int photograph) const { return looks_[photograph]; }

  // Mean of |a + b - 1|, each between its own dark and light: 0 for complements, 0.5 for unlike bars.
  double complement_error(int a, int b) const;

  // At the edges of `coarse` along an axis, what the next finer bars do.
  struct EdgeCounts {
    int rising = 0, falling = 0;           // edges of the coarse bars towards larger x or y
    int also_edge = 0, lit = 0, dark = 0;  // the finer ones change, are lit or dark on both sides
    int decided() const { return also_edge + lit + dark; }
  };
  EdgeCounts edges(const BarShots& coarse, const BarShots& fine, size_t axis) const;

  // Photographs first to first + steps - 1 as steps of one wave.
  struct Fringe {
    double residual = 0.0;          // share of the modulation's energy that no sinusoid explains
    double mean_spread = 0.0;       // standard deviation over pixels of the mean of the steps
    double amplitude = 0.0;         // its mean; 0.5 of waves from black to white
    double amplitude_spread = 0.0;  // ... of the amplitude, as a share of its mean
    double few_phases = 0.0;        // share of pixels that have one of the tenth of all phases that most have
    double least_variance = 0.0;    // of a step, in the largest one of a step
    double least_sum = 0.0;  // variance of the sum of neighbouring steps, in the sum of their variances
    std::array<double, 2> coherence{};  // of neighbours' phases, along x and y: 1 if they turn alike
    std::array<double, 2> turn_rad{};   // mean change of the phase from pixel to pixel, along x and along y
  };
  // `left_out`: a photograph that does not count; -1: none. Needs steps of four others, or three in all.
  Fringe fringe(int first, int steps, int left_out = -1) const;
  // By how much the phase of one wave turns from pixel to pixel more than that of another, along an axis.
  double beat_rad(int first, int other, int steps, size_t axis) const;

  // Of a wave at the edges of bars along an axis: the mean of e^(i phase), and of e^(2 i phase).
  struct EdgePhases {
    std::complex<double> once, twice;
    int count = 0;
  };
  EdgePhases phases_at_edges(const BarShots& bars, int first, int steps, size_t axis) const;

 private:
  static constexpr size_t kNear = 33;
  struct Lines {
    SampledLines values;
    std::vector<char> lit;
  };
  Look look_at(size_t photograph) const;
  float value(const Lines& lines, const BarShots& shots, size_t at) const;
  // Between the photograph's own dark and light.
  double own_value(const Lines& lines, int photograph, size_t at) const;
  // Whether an edge of bars lies between `from` + kReach_px and the place after it: -1 falling, 1 rising, 0
  // none.
  int edge_at(const Lines& lines, const BarShots& bars, size_t from) const;
  std::vector<std::complex<double>> phasors(const Lines& lines, int first, int steps) const;

  void gather(size_t axis);
  void correlate();
  // Of the values of two photographs that are near one another, over the gathered pixels along x.
  double covariance(int a, int b) const;

  // Lit pixels of the lines that have most of them, photographs side by side.
  struct Gathered {
    std::vector<float> values;
    std::vector<char> follows;  // by pixel: it is the neighbour of the one before
  };

  std::array<Lines, 2> lines_;  // along x, along y
  std::array<Gathered, 2> gathered_;
  std::vector<std::array<double, kNear>> covariances_;  // by photograph and distance
  double lit_share_ = 0.0;
  std::vector<Look> looks_;
};

}  // namespace glasswing
