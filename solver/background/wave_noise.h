// Measures the noise of a row of samples if the camera's is unknown. Bars and their complement add up to
// white plus black,
//   e = I + I' - white - black,    sd(e) = 2 sd of a sample
// for any view. The median of |e| over the row's pixels, channels and bars tolerates pixels that changed for
// other reasons.
#pragma once

#include <vector>

#include "solver/method/method.h"

namespace glasswing {

class WaveNoise {
 public:
  WaveNoise() = default;  // not known
  // Uses frames of one exposure, that of the manifest's first square wave.
  explicit WaveNoise(const v1::CaptureManifest& manifest);

  bool known() const { return !sums_.empty(); }
  std::vector<int> frames() const;
  // Standard deviation, radiance; at least the quantisation of 16 bits. Requires known().
  double of_row(const FrameStack& stack, int y) const;

 private:
  struct Sum {
    int bars = -1, complement = -1, white = -1, black = -1;  // indices in the manifest
  };
  std::vector<Sum> sums_;
};

}  // namespace glasswing
