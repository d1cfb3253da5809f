// Environment mattes from swept Gaussian stripes (Chuang et al. 2000, section 3).
#pragma once

#include <memory>

#include "solver/method/method.h"

namespace glasswing {

class GaussianMethod final : public Method {
 public:
  // `options`: core/method/methods.h.
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  bool solves_mosaics() const override { return true; }
  // Where the manifest has no noise model, noise is estimated from each pixel's own samples.
  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(const v1::CaptureManifest& manifest) const override;

 private:
  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare_gaussians(
      const v1::CaptureManifest& manifest) const;

  MethodOptions options_;
  int modes_ = 0;
  bool oriented_ = true;
  double silhouette_tolerance_ = 0.0;
  int images_ = 0;  // 0: all
  bool any_footprints_ = false;
};

}  // namespace glasswing
