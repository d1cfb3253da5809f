// Conventional mattes from solid backings (Smith and Blinn 1996; Chuang et al. 2000, eq. 6):
//
//   y_sc = F_c + (1 - alpha) b_sc
//
// in channel c in front of solid s, where b is the same pixel without the object.
//
// Several backings, triangulation: least squares over solids and channels; with means over solids,
//
//   1 - alpha = sum_sc w (y_sc - y_c) (b_sc - b_c) / sum_sc w (b_sc - b_c)^2,    F_c = y_c - (1 - alpha) b_c
//
// One backing of colour k gives three equations for four unknowns. Vlahos's formula assumes that the object
// has no more of the backing's colour than a2 times the stronger of its other two, q(y) = y_k - a2
// max(y_other):
//
//   1 - alpha = a1 q(y) / q(b),    F = y - (1 - alpha) b
//
// with alpha clamped to [0, 1] and F to at least 0. With a1 = 1 the bare backing has alpha 0. Alpha is exact
// where the object's own light has q = 0, like all grays with a2 = 1.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <span>
#include <vector>

#include "solver/background/empty_stage.h"
#include "solver/background/stage_layout.h"

namespace glasswing {

struct Backing {
  std::array<double, 3> light{};  // radiance on the monitor
  Shot object, empty;
};

struct BackingLayout {
  StageLayout stage;
  int texture = 0;  // the monitor
  std::vector<Backing> backings;
  int key = 0;  // of a single backing, its strongest channel
};

// Uses the first monitor whose solids, with and without the object, suffice; `count` is 1 or 2.
// FAILED_PRECONDITION says what is missing: two solids of different light, of which one may be black; or one
// solid with a dominant colour.
absl::StatusOr<BackingLayout> lay_out_backings(const v1::CaptureManifest& manifest, int count);

// Every frame listed in the layout.
std::vector<int> frames_of(const BackingLayout& layout);

struct BackingSample {
  Samples3 object{}, empty{};
  Samples3 variance{};  // of both together
};

struct Cover {
  double straight = 0.0, straight_sd = 0.0;  // 1 - alpha, in [0, 1]; standard error, 0: unknown
  Samples3 foreground{};                     // F
  double rms = 0.0;                          // of the residual
};

Cover triangulate(std::span<const BackingSample> samples);

struct Vlahos {
  int key = 2;
  double a1 = 1.0, a2 = 1.0;
};
Cover key_out(const BackingSample& sample, const Vlahos& constants);

}  // namespace glasswing
