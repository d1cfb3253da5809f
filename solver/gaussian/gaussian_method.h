// Environment mattes from swept Gaussian stripes (Chuang et al. 2000, section 3).
#pragma once

#include <memory>

#include "solver/method/method.h"

namespace glasswing {

class GaussianMethod final : public Method {
 public:
  // Options: modes (1 to 8, maximum footprints per channel, of which 4 on one monitor; default 8), oriented
  // (0: footprints keep only their widths along x and y, as in Chuang et al. 2000, figure 6 b; default 1),
  // silhouette_tolerance (of full scale, minimum rms difference that makes a pixel the object's; default
  // 0.003), images (40 to 20000: solves from no more than these, fewer_images.h; default: all).
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  // Where the manifest has no noise model, noise is estimated from each pixel's own samples.
  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(const v1::CaptureManifest& manifest) const override;

 private:
  MethodOptions options_;
  int modes_ = kMaxModes;
  bool oriented_ = true;
  double silhouette_tolerance_ = 0.003;
  int images_ = 0;  // 0: all
};

}  // namespace glasswing
