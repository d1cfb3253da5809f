// Video mattes from the colour ramp (Chuang et al. 2000, section 4): each frame is extracted, smoothed with
// its neighbours in time, and finished. Options: ramp_options.h.
#pragma once

#include <memory>

#include "solver/method/video_method.h"
#include "solver/ramp/ramp_options.h"

namespace glasswing {

class RampMethod final : public VideoMethod {
 public:
  static absl::StatusOr<std::unique_ptr<VideoMethod>> create(const MethodOptions& options);

  // Keeps at most one frame more than the smoother uses in memory. A frame outside the range that cannot be
  // read or extracted is left out of the smoothing of its neighbours.
  absl::Status solve(VideoSource& source, int first, int count, int thread_count, std::stop_token stop,
                     const FrameDone& done) const override;

 private:
  RampMethod(MethodOptions options, const RampOptions& parsed)
      : options_(std::move(options)), parsed_(parsed) {}

  MethodOptions options_;
  RampOptions parsed_;
};

}  // namespace glasswing
