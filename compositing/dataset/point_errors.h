// Points on the monitor as the places of their pixels' middles, and their standard errors, which hold what
// the fit of a pixel cannot know.
//
// A footprint's centre is the mean over what the pixel sees. Where the map p from pixels to places bends,
// that is
//
//   bend = a^2 / 2 (p_xx + p_yy),   a^2 the median over the picture of trace(footprint) / (|p_x|^2 + |p_y|^2)
//
// away from the place of its middle, and is taken off; a^2 is the pixel's aperture, lens included, px^2.
//
//   sd^2 = max(fit^2, scatter^2) + (cut^2 + (bend / 4)^2 + |pose|^2) / 2
//
// of one of two axes, so that an error's square is 2 sd^2 on average.
//
// fit      of the centre, from the frames' noise; of a footprint of several modes a quarter of the way from
//          the strongest to their mean
// scatter  of points about their neighbours: from second differences d = p(-1) - 2 p(0) + p(1) along rows,
//          columns and diagonals in 5 x 5 pixels, of which opposite ones are averaged, less their median.
//          Errors alone give |d|^2 an exponential distribution of mean 12 sd^2. What cuts explain of it is
//          not counted again.
// cut      a pixel on an edge sees part of its footprint. If the share c of the light of its brightest
//          neighbour is missing from a Gaussian of sigma s, the centre of the rest is
//          s phi(q) / (1 - c) away, where 1 - Phi(q) = c.
// bend     known to about a quarter. Where the neighbours do not explain the footprint, since they are apart
//          or since it is wider than the steps to them tell by 2 a^2, nothing is taken off, and sigma
//          stands for it: the middle's ray lands anywhere in the footprint.
// pose     of the monitor, by the covariance of its calibration; common to its points
#pragma once

#include <vector>

#include "compositing/dataset/dataset_view.h"

namespace glasswing {

// Of a pixel's strongest mode.
struct PointFootprint {
  double weight = 0.0, weight_sd = 0.0, sigma_mm = 0.0;  // sigma: rms of two axes
  int texture = 0;
};

// Of known points, of which sd_mm has the errors of the fit.
void correct_points(const DatasetView& view, const std::vector<PointFootprint>& footprints,
                    ScreenPoints& points);

// How far the mean of a normal distribution moves, in sigmas, when this share of it is cut off; up to 0.5.
double shift_of_cut(double share);

}  // namespace glasswing
