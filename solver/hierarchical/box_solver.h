// Solves rows of a stack of frames by one box a monitor and pixel.
#pragma once

#include <span>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/surroundings.h"
#include "solver/hierarchical/box_fit.h"
#include "solver/method/method.h"

namespace glasswing {

class BoxSolver {
 public:
  // Both must outlive it. `partial_cover`: alpha may be less than 1 within the silhouette.
  BoxSolver(const FrameStack& stack, const BoxLayout& layout, bool partial_cover,
            double silhouette_tolerance);

  // Row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

 private:
  // One channel of one pixel before one pattern.
  struct Sample {
    float radiance = 0.0f, variance = 0.0f;
    bool saturated = false;
  };

  void load_row(int y);
  std::vector<Sample> load(int y, const Shot& shot) const;
  // A sample's, by pixel, from how much waves and complements that follow each other add up to: F twice and R
  // once.
  std::vector<double> estimate_noise() const;
  // What pixel x of the row saw, with noise so many times the camera's; true if something was saturated.
  bool gather(int x, double noise_factor);
  void add_straight(std::span<const BackgroundPoint> background);
  void write(int x, int y, std::span<const BackgroundPoint> background, const BoxFit& fit, double noise_sd,
             Matte& matte) const;

  const FrameStack& stack_;
  const BoxLayout& layout_;
  const bool partial_cover_;
  const int width_;
  Surroundings surroundings_;
  BoxFitter fitter_;
  // Of the row in hand, [x][channel].
  std::vector<Sample> black_;
  std::vector<std::vector<std::vector<Sample>>> samples_;  // [monitor][pattern]
  BoxPixel pixel_;
};

}  // namespace glasswing
