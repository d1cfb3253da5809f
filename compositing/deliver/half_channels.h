// Determines which channels of a matte can be stored in 16 bits without loss of quality.
//
// A half has 11 significant bits: |half(v) - v| <= 2^-11 |v| from 6e-5 to 65504, and 2^-25 below. All light
// of a composite is a sum of F and of weights times pictures, none of them negative except where noise takes
// F below 0. So halves change a composite, in the camera's channels, by at most 2^-11 = 4.9e-4 of the light
// that adds up to it, whatever the number of modes. Places need more: 2^-11 of a monitor 3840 px wide is two
// pixels. So do covariances: 2^-11 of the variance along a footprint 50 px long exceeds the whole variance
// across it.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/matte/matte_layers.h"

namespace glasswing {

inline constexpr float kHalfError = 1.0f / 2048.0f;  // relative
inline constexpr float kLeastHalfError = 1.0f / 33554432.0f;

// The layer of a channel: "F" of "foreground.F.R", "preview" of "R".
std::string_view layer_of(std::string_view channel);

// Finds the channels whose samples all stay, as halves, within what their layer allows: light and standard
// errors within the bounds above (an error that is known stays known), everything else exactly.
class HalfChannels {
 public:
  // None yet; `parts` as matte_parts().
  explicit HalfChannels(const std::vector<ExrPart>& parts);

  // Examines `rows` rows of a block.
  void look(const MatteBlock& block, int rows, int width_px);
  // Merges the results of another.
  void join(const HalfChannels& other);

  bool is_half(size_t part, size_t channel) const { return good_[part][channel]; }
  // Layers that have halves, without the parts' numbers: "weight", "F".
  std::vector<std::string> layers() const;

 private:
  std::vector<std::vector<std::string>> names_;
  std::vector<std::vector<bool>> good_;
};

}  // namespace glasswing
