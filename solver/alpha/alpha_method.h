// Conventional mattes (backings.h): F, and one straight-through footprint whose weight is 1 - alpha times the
// transmission of the background itself.
#pragma once

#include <memory>

#include "solver/alpha/backings.h"
#include "solver/method/method.h"

namespace glasswing {

class AlphaMethod final : public Method {
 public:
  // `options`: core/method/methods.h.
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(const v1::CaptureManifest& manifest) const override;

 private:
  MethodOptions options_;
  int backings_ = 0;
  Vlahos constants_;
  double silhouette_tolerance_ = 0.0;
};

}  // namespace glasswing
