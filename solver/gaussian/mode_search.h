// How many footprints a pixel's channel has, and where the joint fit starts (Chuang et al. 2000,
// section 3.2).
//
// The crests of the sweeps are lines on the monitor; a footprint lies where lines of all sweeps meet. Two
// footprints may share a line: then that sweep shows one crest with the light of both. So the start with k
// footprints is the set of k meeting points that together explain the crests best, light counted; beside it
// stand the last fit with the best mode of its residual added, and with one of its modes split. The best fit
// of these is kept if the Bayesian information criterion says that it is worth its six parameters.
#pragma once

#include <span>

#include "solver/gaussian/crests.h"
#include "solver/gaussian/joint_fit.h"

namespace glasswing {

// Whether a fit leaves nothing but noise.
bool is_explained(const JointFit& fit, double noise_sd);

// `crests`: one entry a sweep of the layout. `noise_sd`: of a sample of weight 1. Modes come strongest first,
// none where nothing rises above the noise; max_modes is 1 to 4.
JointFit find_footprints(const PixelSamples& samples, std::span<const Crests> crests,
                         const MonitorExtent& extent, double noise_sd, int max_modes,
                         JointWorkspace& workspace);

}  // namespace glasswing
