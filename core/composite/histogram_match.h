// Transfers the colours of one picture to another: for example those of a photograph of a monitor to the
// picture that it showed, so that a composite looks like the photograph (Chuang et al. 2000, figure 10, after
// Heeger and Bergen 1995).
//
// Channels are correlated, so they are matched along the target's principal axes. First means and covariances
// are equalised by the linear map that changes colours least,
//
//   A = S^(-1/2) (S^(1/2) T S^(1/2))^(1/2) S^(-1/2)       S, T: covariances of source and target
//
// then along each axis the n-th smallest value is replaced by the n-th smallest of the target.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

class HistogramMatch {
 public:
  // Sizes may differ. INVALID_ARGUMENT: a picture is empty.
  static absl::StatusOr<HistogramMatch> learn(const RadianceImage& source, const RadianceImage& target);

  // `picture` is the source, or one like it, such as the next frame of a video. Linear radiance; the result
  // is never negative.
  void apply(RadianceImage& picture) const;

 private:
  using Colour = std::array<double, 3>;
  Colour along_axes(const float* samples) const;

  std::array<Colour, 3> from_source_{};  // axes x colour: the linear map, projected onto the axes
  std::array<Colour, 3> to_colour_{};
  Colour source_mean_{}, target_mean_{};
  // By axis: values at equally spaced ranks.
  std::array<std::vector<double>, 3> source_quantiles_, target_quantiles_;
};

}  // namespace glasswing
