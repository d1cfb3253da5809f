// Solves rows of a stack by one box per monitor and pixel.
#pragma once

#include <span>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/surroundings.h"
#include "solver/hierarchical/box_fit.h"
#include "solver/method/method.h"

namespace glasswing {

// The modes of a channel: a box for each monitor, its halos, and the background straight behind.
int modes_needed(int monitors, bool partial_cover);

class BoxSolver {
 public:
  // Keeps references to both. `partial_cover`: alpha may be less than 1 within the silhouette.
  BoxSolver(const FrameStack& stack, const BoxLayout& layout, bool partial_cover,
            double silhouette_tolerance);

  // Solves row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

 private:
  // One channel of one pixel in one pattern.
  struct Sample {
    float radiance = 0.0f, variance = 0.0f;
    bool saturated = false;
  };

  void load_row(int y);
  void load(int y, const Shot& shot, std::vector<Sample>& row) const;
  // Standard deviation of a sample, by pixel, from the sums of waves and their complements, which all equal 2
  // F + R.
  std::vector<double> estimate_noise() const;
  // The same of a whole row without complements, from the residuals of the better fits.
  double estimate_noise_by_fits(const std::vector<bool>& object);
  // Loads pixel x of the row with its variance scaled by `noise_factor`; returns whether a sample was
  // saturated.
  bool gather(int x, double noise_factor);
  void add_straight(std::span<const BackgroundPoint> background);
  // Among places that all waves show equally, takes the one nearest to the background straight behind the
  // pixel, if that is known. It stays a guess: `misread`.
  void choose_places(std::span<const BackgroundPoint> background, BoxFit& fit) const;
  void write(int x, int y, std::span<const BackgroundPoint> background, const BoxFit& fit, double noise_sd,
             Matte& matte) const;

  const FrameStack& stack_;
  const BoxLayout& layout_;
  const bool partial_cover_;
  const bool has_complements_;
  const int width_;
  Surroundings surroundings_;
  BoxFitter fitter_;
  // Of the current row, [x][channel].
  std::vector<Sample> black_;
  std::vector<std::vector<std::vector<Sample>>> samples_;  // [monitor][pattern]
  BoxPixel pixel_;
  Samples3 saturated_light_{};  // of channels without any other sample; else 0
};

}  // namespace glasswing
