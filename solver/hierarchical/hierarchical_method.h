// Environment mattes from square waves: one axis-aligned box per monitor and pixel, common to all channels
// (Zongker, Werner, Curless and Salesin 1999, as Chuang et al. 2000 describe it: section 2, eq. 7 and 8).
#pragma once

#include <memory>

#include "solver/method/method.h"

namespace glasswing {

class HierarchicalMethod final : public Method {
 public:
  // `options`: core/method/methods.h.
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  // The matte's footprints are boxes. Where the manifest has no noise model, noise is estimated from each
  // pixel's own samples.
  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(const v1::CaptureManifest& manifest) const override;

 private:
  MethodOptions options_;
  bool partial_cover_ = false;
  double silhouette_tolerance_ = 0.0;
};

}  // namespace glasswing
