// Gives a picture the colours of another: of a photograph of it that was taken off a monitor, say, which is
// darker, so that a composite looks like one (Chuang et al. 2000, figure 10, after Heeger and Bergen 1995).
//
// Channels depend on each other, so they are not matched one by one, but along the target's principal axes.
// First means and covariances are made equal by the linear map that moves colours least,
//
//   A = S^(-1/2) (S^(1/2) T S^(1/2))^(1/2) S^(-1/2)       S, T: covariances of source and target
//
// then along each axis the n-th smallest value becomes the n-th smallest of the target's.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <vector>

#include "core/frame/image.h"

namespace glasswing {

class HistogramMatch {
 public:
  // Sizes may differ. INVALID_ARGUMENT: one of them is empty.
  static absl::StatusOr<HistogramMatch> learn(const RadianceImage& source, const RadianceImage& target);

  // The source, or a picture like it, such as the next of a video. Linear radiance, never negative.
  void apply(RadianceImage& picture) const;

 private:
  using Colour = std::array<double, 3>;
  Colour along_axes(const float* samples) const;

  std::array<Colour, 3> from_source_{};  // axes x colour: the linear map, then onto the axes
  std::array<Colour, 3> to_colour_{};
  Colour source_mean_{}, target_mean_{};
  // By axis: equally many colours lie between neighbours.
  std::array<std::vector<double>, 3> source_quantiles_, target_quantiles_;
};

}  // namespace glasswing
