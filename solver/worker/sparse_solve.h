// A draft's pixels: every k-th of every k-th row is solved, and those between take the nearest one's matte,
// with its modes moved as the neighbouring solved pixels' modes differ.
#pragma once

#include <absl/status/statusor.h>

#include <stop_token>

#include "core/matte/matte.h"
#include "solver/method/method.h"
#include "solver/worker/parallel_solve.h"

namespace glasswing {

// The rows of a tile that are solved, from 0: the middle ones of each `step` rows.
std::vector<int> sparse_rows(int row_count, int step);

// The stack's columns 0, `step`, 2 `step`, ...; `step` is odd.
FrameStack every_column(const FrameStack& stack, int step);

// A matte of `row_count` rows of `width_px` pixels from `solved`, whose row k is sparse_rows()[k] and whose
// column c is pixel c `step`. A mode's centre and weight are interpolated linearly where the next solved
// pixel has as many modes, of the same monitor and not further off than kMaxShift_px a pixel; otherwise they
// are those of the nearest.
Matte spread(const Matte& solved, int width_px, int row_count, int step);

// `stack` holds all pixels of the tile's rows, and no mosaic. CANCELLED once `stop` is requested.
absl::StatusOr<Matte> solve_sparsely(const PreparedSolve& prepared, const FrameStack& stack, int step,
                                     int thread_count, std::stop_token stop);

}  // namespace glasswing
