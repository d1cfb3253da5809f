// The noise of a row of samples where nobody knows the camera's: bars and their complement give together what
// white and black do,
//   e = I + I' - white - black,    sd(e) = 2 sd of a sample
// whatever a pixel sees. The median of |e| over the row's pixels, channels and bars lets pixels be wrong that
// something else changed.
#pragma once

#include <vector>

#include "solver/method/method.h"

namespace glasswing {

class WaveNoise {
 public:
  // Takes frames of one exposure, that of the first of the manifest's square waves.
  explicit WaveNoise(const v1::CaptureManifest& manifest);

  bool known() const { return !sums_.empty(); }
  std::vector<int> frames() const;
  // Standard deviation, radiance; at least the quantisation of 16 bits. Only where known().
  double of_row(const FrameStack& stack, int y) const;

 private:
  struct Sum {
    int bars = -1, complement = -1, white = -1, black = -1;  // places in the manifest
  };
  std::vector<Sum> sums_;
};

}  // namespace glasswing
