// Which of the differences between a session's frames (frame_report.h) are significant: what is removed from
// them, and what is reported to users. Without significant differences nothing is removed.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "solver/corrections/disturbed_pixels.h"
#include "solver/frames/frame_report.h"
#include "solver/method/frame_correction.h"

namespace glasswing {

struct FrameFaults {
  size_t compared = 0;  // pixels beside the object; 0: frames were not compared
  std::shared_ptr<const FrameCorrections> corrections;  // null: none
  std::vector<int> bad_pixels;                          // of the camera, to be filled: y width + x, ascending
  std::vector<std::string> warnings;
  Disturbance disturbance;                // that is not corrected
  std::shared_ptr<const StageMaps> maps;  // null: of corrected frames, not measured
};

// `read` returns a session's light with these corrections applied.
using CorrectedReader = std::function<LightReader(std::shared_ptr<const FrameCorrections>)>;

// Reports the frames (report_frames), again if ghosts or flare blurred the frames that they were compared
// with, and judges them.
absl::StatusOr<FrameFaults> find_faults(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                                        const CorrectedReader& read);

}  // namespace glasswing
