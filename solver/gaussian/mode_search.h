// How many footprints a pixel's channel has, and where the joint fit starts (Chuang et al. 2000,
// section 3.2).
//
// The peaks of the sweeps are lines on the monitor; a footprint lies where lines of all sweeps meet. Two
// footprints may share a line: then that sweep shows one peak with the light of both. So the start with k
// footprints is the set of k meeting points that together explain the peaks best, light counted; beside it
// stand the last fit with the best mode of its residual added, and with one of its modes split. The best fit
// of these is kept if the Bayesian information criterion says that it is worth its six parameters.
#pragma once

#include <span>

#include "solver/gaussian/joint_fit.h"
#include "solver/gaussian/peaks.h"

namespace glasswing {

// The usual case's start: as many footprints as some sweep shows peaks, no more and no fewer. None where the
// peaks say otherwise.
Footprints usual_start(const SampleLayout& layout, std::span<const Peaks> peaks, int max_modes);

// Whether a fit has settled and needs each of its modes, and leaves nothing but noise near them; or more.
bool suffices(const JointFit& fit, double noise_sd);
bool needs_more(const JointFit& fit, double noise_sd);

// `peaks`: one entry a sweep of the layout. `noise_sd`: of a sample of weight 1. Modes come strongest first,
// none where nothing rises above the noise; max_modes is 1 to 4. `usual`: what the usual start came to, where
// it settled and left more than noise; what is searched has more modes then.
JointFit find_footprints(const PixelSamples& samples, std::span<const Peaks> peaks,
                         const MonitorExtent& extent, double noise_sd, int max_modes,
                         JointWorkspace& workspace, const JointFit* usual = nullptr);

}  // namespace glasswing
