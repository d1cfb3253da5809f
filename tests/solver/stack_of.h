// A stack of frames in memory.
#pragma once

#include <vector>

#include "core/image/image.h"
#include "solver/method/method.h"

namespace glasswing {

// `frames` are in the manifest's order and must outlive the stack.
inline FrameStack stack_of(const v1::CaptureManifest& manifest, const std::vector<Image16>& frames) {
  FrameStack stack{.width_px = manifest.camera().width_px(),
                   .first_row = 0,
                   .row_count = manifest.camera().height_px(),
                   .rows = {},
                   .owner = nullptr,
                   .mosaic = mosaic_of(manifest.camera())};
  for (const Image16& frame : frames) stack.rows.push_back(frame.samples);
  return stack;
}

}  // namespace glasswing
