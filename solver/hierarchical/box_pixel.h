// A pixel's samples of square waves, and the boxes that explain them.
#pragma once

#include <array>
#include <vector>

#include "solver/background/empty_stage.h"
#include "solver/hierarchical/wave_axis.h"

namespace glasswing {

struct BoxSample {
  Samples3 radiance{};
  Samples3 information{};  // 1 / variance; 0: unknown
  Samples3 straight{};     // B: the pixel's light from the pattern without the object
};

struct BoxPixel {
  BoxSample black;
  std::vector<std::vector<BoxSample>> samples;  // [monitor][pattern] of the layout
  bool has_straight = false;                    // otherwise alpha is 1
  // All channels are equal, as in a picture without colour, with the same noise: the first stands for all.
  bool gray = false;
  size_t channel_count() const { return gray ? 1 : kChannels; }
};

inline constexpr size_t kMaxHalos = 4;
inline constexpr size_t kMaxParts = 1 + kMaxHalos;  // a soft box and its halos

struct PixelBox {
  bool seen = false;  // if not, weights are 0 and the box is meaningless
  std::array<Interval, 2> side;
  Samples3 weight{}, weight_sd{};        // R, of box and halos
  std::array<double, kMaxHalos> halo{};  // g, by width
  bool soft = false;                     // a Gaussian with halos; the sides are those of the nearest box
  double core() const;                   // 1 - sum of g
  std::array<double, 2> decoded_px{};    // of a soft one, which stays close to it
  double centre_sd_px = 0.0;             // rms of x and y
  bool misread = false;                  // another reading of the waves is about as likely, or none sound
};

struct BoxFit {
  std::vector<PixelBox> boxes;  // by monitor of the layout
  Samples3 foreground{};
  double straight = 0.0;      // 1 - alpha
  double straight_sd = 0.0;   // its standard error
  bool cover_unsure = false;  // alpha may be off by 0.1
  double chi_square = 0.0;    // of this many samples
  int sample_count = 0;
  double rms = 0.0;  // of the residual, radiance
};

}  // namespace glasswing
