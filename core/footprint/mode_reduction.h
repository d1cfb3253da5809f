// Reduces the number of modes for the same light. Two footprints of one monitor become one with their weight,
// mean and covariance, so composites over any locally quadratic picture do not change:
//
//   R = R_a + R_b    c = (R_a c_a + R_b c_b) / R    S = sum_i R_i (S_i + (c_i - c)(c_i - c)') / R
//
// The pair that loses least is merged first, by Runnalls' bound of the Kullback-Leibler divergence ("A
// Kullback-Leibler approach to Gaussian mixture reduction", 2007), with each footprint as the monitor's
// pixels show it, 1/12 px^2 wider:
//
//   B = (R log |S| - R_a log |S_a| - R_b log |S_b|) / 2
#pragma once

#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

// The mode with the moments of both, which are on the same monitor. Its standard errors are those of
// independent modes, unknown if one of theirs is. Boxes stay upright: their xy is 0.
Mode merged(const Mode& a, const Mode& b, bool boxes);

// Merges modes of the same monitor until `max_modes` are left, or one for each monitor; those without weight
// are dropped. The strongest comes first.
void reduce_modes(std::vector<Mode>& modes, int max_modes, bool boxes);

// A mode with `share` of its light.
Mode scaled(Mode mode, float share);

// The same matte with storage for a different number of modes, which must suffice for those in use, in
// separate or (`colourless`, only for a colourless one) in joint channels.
Matte with_places(const Matte& matte, int modes_per_channel, bool colourless);

}  // namespace glasswing
