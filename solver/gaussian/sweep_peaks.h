// The peaks of one pixel's response to one sweep (Chuang et al. 2000, section 3.2), each with a Gaussian
// fitted to its own surroundings:  y(r) = amplitude exp(-(r - centre)^2 / (2 sigma^2)).
#pragma once

#include <span>
#include <vector>

namespace glasswing {

struct Peak {
  double amplitude = 0.0;
  double centre_px = 0.0;
  double sigma_px = 0.0;
};

// The highest `most` peaks above `floor` after smoothing, highest first. `r_px` ascends; `y` is without
// baseline.
std::vector<Peak> find_peaks(std::span<const double> r_px, std::span<const double> y, double floor, int most);

// Noise of equally spaced samples of something smooth: from the median of their second differences, so that
// peaks do not count.
double noise_of(std::span<const double> y);

}  // namespace glasswing
