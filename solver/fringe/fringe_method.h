// Environment mattes from phase-shifted sinusoids at several frequencies.
#pragma once

#include <memory>

#include "solver/fringe/fringe_layout.h"
#include "solver/method/method.h"

namespace glasswing {

class FringeMethod final : public Method {
 public:
  // Options: modes (1 to 4, maximum footprints per channel and monitor; default 1; more are tried where a
  // quarter of the tolerance is exceeded), tolerance (0 to 0.5: how far the response to a wave may be from a
  // Gaussian footprint's, relative to the light that arrives, before the pixel is flagged; default 0.02),
  // silhouette_tolerance (as in GaussianMethod).
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  // Without a noise model in the manifest, noise is estimated from how a pixel's samples differ from
  // sinusoids.
  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(const v1::CaptureManifest& manifest) const override;

 private:
  MethodOptions options_;
  int modes_ = 1;
  double tolerance_ = 0.02;
  double silhouette_tolerance_ = 0.003;
};

}  // namespace glasswing
