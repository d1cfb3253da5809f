// A matte of one frame before the colour ramp (Chuang et al. 2000, section 4):
//
//   C = f W + (1 - alpha) B + rho T(c),   W = (1, 1, 1)                                         (eq. 31)
//
// B is the empty stage's average, T the measured manifold of the ramp's colours, c the place whose colour
// lies on the line from black through what is left of C, rho how far along it C lies.
//
// Where the object covers a part of a pixel, alpha follows from the light: the pixel's colour lies between
// the empty stage's and that of the object just inside.
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

// The empty stage, prepared once. Safe on any number of threads; no result depends on a thread count (0: all
// cores).
class RampExtractor {
 public:
  // `empties`: frames of the ramp without the object, of light, all of one size; one is enough if it is
  // clean. `black`: the stage with the monitors black, whose light is taken off every frame; none: there is
  // none. INVALID_ARGUMENT: sizes differ. FAILED_PRECONDITION: no empty frame, one without the ramp, or the
  // ramp is saturated.
  static absl::StatusOr<RampExtractor> create(const v1::CaptureManifest& manifest, const VideoLayout& layout,
                                              std::span<const FrameView> empties, const RampOptions& options,
                                              std::span<const FrameView> black = {});

  // Alpha, c, rho, which may exceed 1, and the information about c. In a highlight `highlight` is 1, and c
  // and rho are what lies around it; there, and where the object is too dark to tell, the information is 0.
  // Off the object rho and the information are 0. INVALID_ARGUMENT: another size. FAILED_PRECONDITION: the
  // frame does not show the ramp, or the background moved.
  // `spent`: a frame that nobody needs any more, whose memory the new one takes.
  absl::StatusOr<RampFrame> extract(const FrameView& view, int thread_count, RampFrame spent = {}) const;

  // Once c is smoothed: f (eq. 32 and 33) where there is a highlight, rho at most 1.
  void finish(const FrameView& view, RampFrame& frame, int thread_count) const;

  // Colourless, footprints are boxes: rho at c, as wide as c's steps from pixel to pixel (eq. 23 and 24), and
  // 1 - alpha of the place straight behind.
  Matte matte(const RampFrame& frame, int thread_count = 1) const;

  // What may be wrong with the empty stage, for people.
  const std::vector<std::string>& warnings() const;

 private:
  struct Prepared;
  explicit RampExtractor(std::shared_ptr<const Prepared> prepared) : prepared_(std::move(prepared)) {}

  std::shared_ptr<const Prepared> prepared_;
};

}  // namespace glasswing
