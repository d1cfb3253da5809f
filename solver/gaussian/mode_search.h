// Finds how many footprints a pixel's channel has and where the joint fit starts (Chuang et al. 2000, section
// 3.2).
//
// The peaks of the sweeps are lines on the monitor; a footprint is where lines of all sweeps meet. Two
// footprints may share a line: then that sweep shows one peak with the light of both. So the start with k
// footprints is the set of k meeting points that together explain the peaks and their light best. Two other
// starts are the last fit with the best mode of its residual added, and with one of its modes split. The best
// fit of these is kept if the Bayesian information criterion justifies its six parameters.
#pragma once

#include <span>

#include "solver/gaussian/kernels/joint_fit.h"
#include "solver/gaussian/peaks.h"

namespace glasswing {

// The start in the usual case: as many footprints as some sweep has peaks. None if the peaks contradict that.
Footprints usual_start(const SampleLayout& layout, std::span<const Peaks> peaks, int max_modes);

// Whether a fit has converged, needs each of its modes, and leaves nothing but noise near them; or more.
// `sweeps`: what it leaves of the sweeps alone.
bool suffices(const JointFit& fit, const JointFit& sweeps, double noise_sd);
bool needs_more(const JointFit& fit, double noise_sd);
// Whether the modes that `after` has more take enough from chi2: n log chi2 must fall by 4 log n.
bool earns_its_place(const JointFit& before, const JointFit& after, double noise_sd);

// `peaks`: one entry per sweep of the layout. `noise_sd`: of a sample of weight 1. Modes are ordered by
// weight, strongest first; none if nothing rises above the noise. max_modes: 1 to 4. `usual`: the fit from
// the usual start if it converged and left more than noise; then only more modes are tried.
JointFit find_footprints(const PixelSamples& samples, std::span<const Peaks> peaks,
                         const MonitorExtent& extent, double noise_sd, int max_modes,
                         JointWorkspace& workspace, const JointFit* usual = nullptr);

}  // namespace glasswing
