// The matte of one frame on the colour ramp (Chuang et al. 2000, section 4):
//
//   C = f W + (1 - alpha) B + rho T(c),   W = (1, 1, 1)                                         (eq. 31)
//
// B is the empty stage's average and T the measured manifold of the ramp's colours. c is the position whose
// colour lies on the line from black through the remaining light, and rho the position of that light along
// the line.
//
// Where the object covers part of a pixel, alpha follows from the pixel's colour, which lies between the
// empty stage's and that of the object just inside.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/matte/matte.h"
#include "glasswing/v1/archive.pb.h"
#include "solver/method/video_method.h"
#include "solver/ramp/ramp_options.h"
#include "solver/ramp/smoother/ramp_frame.h"
#include "solver/ramp/video_layout.h"

namespace glasswing {

// The empty stage, prepared once. Thread-safe; results do not depend on thread counts (0: all cores).
class RampExtractor {
 public:
  // `empties`: frames of the ramp without the object, as light, all of one size; a single clean one suffices.
  // `black`: frames with the monitors black, whose light is subtracted from every frame; may be empty.
  // INVALID_ARGUMENT: sizes differ. FAILED_PRECONDITION: no empty frame, one without the ramp, or a saturated
  // ramp.
  static absl::StatusOr<RampExtractor> create(const v1::CaptureManifest& manifest, const VideoLayout& layout,
                                              std::span<const FrameView> empties, const RampOptions& options,
                                              std::span<const FrameView> black = {});

  // Extracts alpha, c, rho (which may exceed 1) and the information about c. In a highlight `highlight` is 1,
  // and c and rho are interpolated from around it; there, and where the object is too dark, the information
  // is 0. Off the object rho and the information are 0. INVALID_ARGUMENT: another size. FAILED_PRECONDITION:
  // the frame does not show the ramp, or the background moved. `spent`: a frame whose memory is reused.
  absl::StatusOr<RampFrame> extract(const FrameView& view, int thread_count, RampFrame spent = {}) const;

  // Call after smoothing c: computes f (eq. 32 and 33) in highlights and clamps rho to 1.
  void finish(const FrameView& view, RampFrame& frame, int thread_count) const;

  // A colourless matte of boxes: rho at c, as wide as c's steps from pixel to pixel (eq. 23 and 24), and 1 -
  // alpha at the position straight behind.
  Matte matte(const RampFrame& frame, int thread_count = 1) const;

  // For users: possible problems of the empty stage.
  const std::vector<std::string>& warnings() const;

 private:
  struct Prepared;
  explicit RampExtractor(std::shared_ptr<const Prepared> prepared) : prepared_(std::move(prepared)) {}

  std::shared_ptr<const Prepared> prepared_;
};

}  // namespace glasswing
