// Decodes where along one axis of a monitor a pixel looks, and how wide its view is, from square waves of
// several bar widths.
//
// A wave s(t) = +-1, +1 on the first bar, constant on each flat monitor pixel, is seen through a footprint g
// of centre c and standard deviation sigma, clipped at the monitor's edges 0 and W, as
//   v = \int_0^W g(t; c, sigma) s(t) dt / \int_0^W g(t; c, sigma) dt
// which is measured as (I - I_complement) / (white - black). (Zongker et al. 1999 encode extents this way;
// Chuang et al. 2000, section 3.1, use such waves for the silhouette.)
#pragma once

#include <span>
#include <vector>

namespace glasswing {

struct AxisFit {
  double centre_px = 0.0;     // on the monitor
  double sigma_px = 0.0;      // of the footprint itself: the model includes flat pixels
  double centre_sd_px = 0.0;  // of the estimate; within the finest bar if nothing narrows it further
  double log_sigma_sd = 0.0;  // of ln sigma
  double inside = 1.0;        // the share of the footprint on the monitor
  double chi_square = 0.0;    // of the waves
  bool ambiguous = false;     // another place explains the waves about as well
};

class BarDecoder {
 public:
  // Model error of v: footprints are symmetric, but not exactly Gaussian.
  static constexpr double kShapeSd = 0.002;

  // Bar widths descend and are at least 1 px. Monitor pixel i is lit where floor((i + 1/2) / width) is even.
  BarDecoder(std::span<const double> bar_widths_px, int extent_px);

  struct Sample {
    double value = 0.0;  // v
    double sd = 1.0;     // of its noise, > 0
  };
  // The prior. It decides only what the waves do not determine: the position inside the finest bar, and which
  // of several periods.
  struct Guess {
    double centre_px = 0.0;
    double sigma_px = 0.3;  // > 0; correct within a small factor
  };
  // Narrows the position coarse to fine down to the first wave without a clear sign, then fits all waves by
  // least squares from every remaining position. Takes one sample per wave.
  AxisFit fit(std::span<const Sample> samples, const Guess& guess) const;

  // v and its derivatives with respect to c and ln sigma.
  struct Value {
    double v = 0.0, by_centre = 0.0, by_log_sigma = 0.0;
  };
  Value value(size_t wave, double centre_px, double sigma_px) const;
  // The share of a footprint that lies on the monitor.
  Value inside(double centre_px, double sigma_px) const;

  // The sigma of a footprint of this variance that value() accepts.
  static double shown_sigma_px(double variance_px2);

  size_t wave_count() const { return waves_.size(); }
  double finest_bar_px() const { return waves_.empty() ? extent_px_ : waves_.back().bar_px; }

 private:
  struct Wave {
    double bar_px = 0.0;
    bool regular = true;           // all bars have the same width, a whole number of pixels
    std::vector<double> edges_px;  // 0, the sign changes, the extent
    double sum_px = 0.0;           // \int_0^extent s
    size_t bar_at(double t_px) const;
  };
  struct Start {
    double centre_px = 0.0, sigma_px = 0.0, cost = 0.0;
  };
  struct Interval {
    double low_px = 0.0, high_px = 0.0;
  };
  struct Problem {
    std::vector<Sample> samples;
    Guess guess;
  };
  struct Normal;

  // Chi-square of the waves and the prior. May stop early once it exceeds `enough`.
  double cost(const Problem& problem, double centre_px, double sigma_px, double enough) const;
  Normal normal_at(const Problem& problem, double centre_px, double sigma_px) const;
  std::vector<Interval> descend(const Problem& problem, size_t* stopped) const;
  std::vector<Start> starts(const Problem& problem) const;
  AxisFit refine(const Problem& problem, const Start& start, double* total) const;

  double extent_px_ = 0.0;
  std::vector<Wave> waves_;
};

}  // namespace glasswing
