// Environment mattes from swept Gaussian stripes (Chuang et al. 2000, section 3).
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "solver/gaussian/stack_layout.h"
#include "solver/gaussian/synthesized_capture.h"
#include "solver/method/method.h"

namespace glasswing {

class GaussianMethod final : public Method {
 public:
  // Options: modes (1 to 4, most footprints a channel; default 4), oriented (0: footprints have only the
  // widths along x and y that were found, as in Chuang et al. 2000, figure 6 b; default 1),
  // silhouette_tolerance (of full scale, least rms difference that makes a pixel the object's; default
  // 0.003), images (40 to 20000: solves as if no more than these had been taken, fewer_images.h; default:
  // all).
  static absl::StatusOr<std::unique_ptr<Method>> create(const MethodOptions& options);

  absl::StatusOr<std::vector<int>> frames_needed(const v1::CaptureManifest& manifest) const override;
  // Where the manifest has no noise model, noise is estimated from each pixel's own samples.
  absl::StatusOr<Matte> solve(const FrameStack& stack) const override;

 private:
  struct Fewer {
    std::string recorded;  // the manifest that it was made of
    MadeCapture capture;
    std::vector<int> made;  // frames of it to solve from
  };
  absl::StatusOr<std::shared_ptr<const Fewer>> fewer_of(const v1::CaptureManifest& manifest) const;
  absl::StatusOr<Matte> solve_all(const FrameStack& stack) const;

  MethodOptions options_;
  int modes_ = kMaxModes;
  bool oriented_ = true;
  double silhouette_tolerance_ = 0.003;
  int images_ = 0;  // 0: all
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const Fewer> fewer_;  // the last
};

}  // namespace glasswing
