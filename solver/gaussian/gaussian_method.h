// Environment mattes from swept Gaussian stripes (Chuang et al. 2000, section 3).
#pragma once

#include <memory>

#include "solver/gaussian/stack_layout.h"
#include "solver/method.h"

namespace glasswing {

class GaussianMethod final : public Method {
 public:
  // Options: modes (1 to 3, most footprints a channel and monitor; default 2), silhouette_tolerance (of full
  // scale, least rms difference that makes a pixel the object's; default 0.006).
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  absl::StatusOr<std::vector<int>> frames_needed(const v1::CaptureManifest& manifest) const override;
  absl::StatusOr<Matte> solve(const FrameStack& stack) const override;

 private:
  void solve_pixel(const FrameStack& stack, const StackLayout& layout, int x, int y, int modes_per_texture,
                   Matte& matte) const;

  MethodOptions options_;
  int modes_ = 4;
  double silhouette_tolerance_ = 0.006;
};

}  // namespace glasswing
