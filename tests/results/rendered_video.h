// A rendered video on the ramp (F_video's layout): several sequences of one object in one directory, with
// empty stages, photographs of other backgrounds, and the object's coverage.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "solver/method/video_method.h"

namespace glasswing {

// Frames of one sequence as a source: the empty stage from bg/ramp.png, or from bg/ramp_noise*.png if the
// sequence is noisy.
absl::StatusOr<std::unique_ptr<VideoSource>> rendered_video(const std::filesystem::path& directory,
                                                            const std::string& sequence);

struct VideoScore {
  std::string sequence, photograph;  // ramp_dark, stilllife_dark
  double psnr_db = 0.0;              // mean over the frames, inside the object
};

// Solves every sequence, composites it exactly over every photographed background, and compares: PSNR of
// linear light on 16 bits, peak 1, where the true coverage exceeds a half.
absl::StatusOr<std::vector<VideoScore>> score_video(const std::filesystem::path& directory,
                                                    const MethodOptions& options);

}  // namespace glasswing
