// Conventional mattes (backings.h): F, and one straight-through footprint whose weight is 1 - alpha times the
// transmission of the background itself.
#pragma once

#include <memory>

#include "solver/alpha/backings.h"
#include "solver/method/method.h"

namespace glasswing {

class AlphaMethod final : public Method {
 public:
  // Options: backings (2: triangulation from all solids, at least two; 1: from the most colourful solid
  // alone; default 2); with backings=1 also a1 (0.1 to 10, default 1) and a2 (0.5 to 1.5, default 1), the
  // constants of Vlahos's formula; silhouette_tolerance (as in gaussian: 0 to 1, default 0.003).
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(const v1::CaptureManifest& manifest) const override;

 private:
  MethodOptions options_;
  int backings_ = 2;
  Vlahos constants_;
  double silhouette_tolerance_ = 0.003;
};

}  // namespace glasswing
