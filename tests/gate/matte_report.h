// What a matte itself says, held against the truth: composites average over modes that a user keeps. Reports
// flags, modes a pixel, phantom light, widths, stated errors, and how often these hold.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing::gate {

// A footprint of a pixel's channel: its light, and its mean, px.
struct TrueMode {
  int texture = 0;
  double weight = 0.0, x_px = 0.0, y_px = 0.0;
};
// Strongest first; empty: not known.
using Truth = std::function<std::vector<TrueMode>(int x, int y, int channel)>;

struct MatteReport {
  int object = 0;   // pixels
  int flagged = 0;  // of them; and by reason
  int not_converged = 0, saturated = 0, poor_fit = 0, no_data = 0;
  int lanes = 0;     // of object pixels
  int phantoms = 0;  // lanes without a flag and with a mode off its monitor, less certain than it is heavy
  double phantom_light = 0.0;          // their weights, a lane
  std::array<double, 9> with_modes{};  // the share of lanes with so many modes
  std::array<double, 9> truly_with{};  // and in truth
  // Of the strongest modes: at half, 99 % and all of them.
  struct Quantiles {
    double median = 0.0, most = 0.0, max = 0.0;  // most: 99 %
  };
  Quantiles sigma_px, centre_sd_px, error_px;  // error_px: the true ones, of each coordinate
  double unknown = 0.0;                        // the share whose error is not known
  // Of the strongest modes of lanes that are not flagged: how often x and y lie within so many stated errors,
  // and the rms of errors in stated ones.
  double within_one = 0.0, within_two = 0.0, rms_z = 0.0;
  double weight_within_one = 0.0, weight_rms_z = 0.0;

  double flagged_share() const { return object > 0 ? static_cast<double>(flagged) / object : 0.0; }
  // Two modes and more.
  double many() const;
  double truly_many() const;
  std::string text() const;
};

// Of the pixels that show the object. Places are those that flat pixels tell of: a footprint's own, where the
// truth gives that. `channel`: only that one; -1: all.
MatteReport report_on(const Matte& matte, const Truth& truth, int channel = -1);

}  // namespace glasswing::gate
