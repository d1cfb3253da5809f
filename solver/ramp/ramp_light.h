// The light of a frame's samples minus the stage's own, r, g, b by rows. Computed on access: most samples are
// read only once.
#pragma once

#include <span>

#include "solver/method/video_method.h"

namespace glasswing {

class RampLight {
 public:
  // `black`: the light that remains with the monitors black; empty: none.
  RampLight(const FrameView& view, std::span<const float> black)
      : samples_(view.samples), unit_(view.unit), offset_(-view.zero * view.unit), black_(black) {}

  float operator[](size_t i) const {
    const float light = static_cast<float>(samples_[i]) * unit_ + offset_;
    return black_.empty() ? light : light - black_[i];
  }

 private:
  std::span<const std::uint16_t> samples_;
  float unit_, offset_;
  std::span<const float> black_;
};

}  // namespace glasswing
