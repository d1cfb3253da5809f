// Environment mattes from phase-shifted sinusoids at several frequencies.
#pragma once

#include <memory>

#include "solver/fringe/fringe_layout.h"
#include "solver/method/method.h"

namespace glasswing {

class FringeMethod final : public Method {
 public:
  // Options: modes (1 to 4, most footprints a channel and monitor; default 1; more are
  // tried where a quarter of the tolerance is exceeded), tolerance (0 to 0.5: how far
  // the answer to a wave may be from a Gaussian footprint's, relative to the light that arrives, before the
  // pixel is flagged; default 0.02), silhouette_tolerance (as of GaussianMethod).
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  absl::StatusOr<std::vector<int>> frames_needed(const v1::CaptureManifest& manifest) const override;
  // Where the manifest has no noise model, noise is what a pixel's own samples differ from sinusoids.
  absl::StatusOr<Matte> solve(const FrameStack& stack) const override;

 private:
  MethodOptions options_;
  int modes_ = 1;
  double tolerance_ = 0.02;
  double silhouette_tolerance_ = 0.003;
};

}  // namespace glasswing
