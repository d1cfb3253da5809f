// Environment mattes from phase-shifted sinusoids at several frequencies.
#pragma once

#include <memory>

#include "solver/fringe/fringe_layout.h"
#include "solver/method/method.h"

namespace glasswing {

class FringeMethod final : public Method {
 public:
  // `options`: core/method/methods.h.
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  // Without a noise model in the manifest, noise is estimated from how a pixel's samples differ from
  // sinusoids.
  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(const v1::CaptureManifest& manifest) const override;

 private:
  MethodOptions options_;
  int modes_ = 0;
  double tolerance_ = 0.0;
  double silhouette_tolerance_ = 0.0;
};

}  // namespace glasswing
