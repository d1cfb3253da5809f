// The parts of a session that can be solved before its last image: the order in which its stripes are shown,
// coarse before fine, and the sets of steps from which drafts of the matte are made.
//
// A sweep's stripes need not be closer than 1.5 sigma (plan.proto, Sweep.step_px): of an image sampled that
// way, 2 exp(-2 pi^2 / 1.5^2) = 3e-4 is lost. So every k-th stripe of a sweep, k step_px <= 1.5 sigma_px, is
// itself a sweep.
#pragma once

#include <string>
#include <vector>

#include "core/pattern/plan.h"
#include "glasswing/v1/matte.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// Permutes the stripes of each monitor among their places: every k-th of each sweep in the plan's order, then
// the others. `steps` are of one exposure. All other steps keep their place.
std::vector<Step> coarse_to_fine(std::vector<Step> steps);

// The first `step_count` steps in the order of showing have what a draft needs.
struct DraftStage {
  int step_count = 0;
  int sweep_count = 0;
};

// Rising. `shown`: all steps of a plan, in the order of showing. A stage ends with a set of stripes, coarse
// or fine, once all monitors whose stripes have begun were swept in three directions. Empty for methods other
// than "gaussian", whose images are few or make a matte only together. None ends after nine tenths of the
// steps: the finished matte follows soon enough then. Of a plan that adapts a stage ends with the plan's own
// steps, and with each round.
std::vector<DraftStage> draft_stages(const v1::Plan& plan, const std::vector<Step>& shown);

// The steps of a plan in the order in which a session shows them that is solved while it is captured.
std::vector<Step> in_order_of_showing(const std::vector<Step>& steps);

// "a draft of 389 of 1450 images, 3 of 4 sweeps"
std::string describe(const v1::Draft& draft);
// "after 50 images 83 % of the pixels are known well enough; 95 % to 36.2 dB, 0.31 px"
std::string describe(const v1::AdaptedRound& round);
// Sweeps of a plan's steps.
int count_sweeps(const std::vector<Step>& steps);

}  // namespace glasswing
