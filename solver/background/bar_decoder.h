// Where along one axis of a monitor a pixel looks, and how wide, from square waves of several bar widths.
//
// A wave s(t) = +-1, +1 on the first bar, constant on each flat monitor pixel, is seen through a footprint g
// of centre c and standard deviation sigma, cut off at the monitor's edges 0 and W, as
//   v = \int_0^W g(t; c, sigma) s(t) dt / \int_0^W g(t; c, sigma) dt
// which is measured as (I - I_complement) / (white - black). (Zongker et al. 1999 code extents so; Chuang et
// al. 2000, section 3.1, use them for the silhouette.)
#pragma once

#include <span>
#include <vector>

namespace glasswing {

struct AxisFit {
  double centre_px = 0.0;     // on the monitor
  double sigma_px = 0.0;      // of the footprint itself: flat pixels are in the model
  double centre_sd_px = 0.0;  // of the estimate; within the finest bar if nothing narrows it further
  double log_sigma_sd = 0.0;  // of ln sigma
  double inside = 1.0;        // the part of the footprint that lies on the monitor
  double chi_square = 0.0;    // of the waves
  bool ambiguous = false;     // another place explains the waves about as well
};

class BarDecoder {
 public:
  // The widths of the bars descend; 1 px is the least. A pixel of the monitor is lit where floor((i + 1/2) /
  // width) is even.
  BarDecoder(std::span<const double> bar_widths_px, int extent_px);

  struct Sample {
    double value = 0.0;  // v
    double sd = 1.0;     // of its noise, > 0
  };
  // What is likely before anything is measured. It decides only what the waves leave open: where inside the
  // finest bar, which of several periods.
  struct Guess {
    double centre_px = 0.0;
    double sigma_px = 0.3;  // > 0; right within a factor of a few
  };
  // Coarse to fine down to the first wave that sees no clear side, then least squares over all waves from
  // every place that is left. One sample a wave.
  AxisFit fit(std::span<const Sample> samples, const Guess& guess) const;

  // v and its slopes by c and by ln sigma.
  struct Value {
    double v = 0.0, by_centre = 0.0, by_log_sigma = 0.0;
  };
  Value value(size_t wave, double centre_px, double sigma_px) const;

  size_t wave_count() const { return waves_.size(); }
  double finest_bar_px() const { return waves_.empty() ? extent_px_ : waves_.back().bar_px; }

 private:
  struct Wave {
    double bar_px = 0.0;
    bool regular = true;           // all bars are that wide: it is a whole number of pixels
    std::vector<double> edges_px;  // 0, where it changes sign, the extent
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

  // The part of a footprint that lies on the monitor.
  Value inside(double centre_px, double sigma_px) const;
  // Chi-square of the waves and of what is likely. It may stop short once it exceeds `enough`.
  double cost(const Problem& problem, double centre_px, double sigma_px, double enough) const;
  Normal normal_at(const Problem& problem, double centre_px, double sigma_px) const;
  std::vector<Interval> descend(const Problem& problem, size_t* stopped) const;
  std::vector<Start> starts(const Problem& problem) const;
  AxisFit refine(const Problem& problem, const Start& start, double* total) const;

  double extent_px_ = 0.0;
  std::vector<Wave> waves_;
};

}  // namespace glasswing
