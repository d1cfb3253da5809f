// The matte of a mosaic's frames, whose photosites were solved for their own channel each: fills in the other
// two. Light is never interpolated, only the places that it comes from.
//
// 1. Around each pixel, the modes of each channel's sites are followed from site to site as paths of light:
//    a plane through their places, fitted robustly, and the light that each site has of it. Fits may split a
//    path into adjacent modes; paths end at edges, where places jump.
// 2. A missing channel's modes are those of the sites beside the pixel, each moved along its path's slope to
//    the pixel and scaled to the path's light there.
// 3. That light is the mean of the sites beside the pixel where they agree. Otherwise there is an edge, which
//    is found from all channels (edge_fit.h): paths of two channels are the same where they lead to similar
//    places and take the same sites.
//
// F, which no monitor lights, is the mean of the sites beside the pixel. Standard errors of filled values are
// unknown.
#pragma once

#include "core/image/mosaic.h"
#include "core/matte/matte.h"

namespace glasswing {

// How many rows and columns around a pixel its result depends on.
inline constexpr int kMosaicReach = 2;

// Fills in, at each pixel of the matte, the modes and F of the two channels that its photosite does not have.
// Its own values are not changed. Pixels that are not solved (kFlagNoData) get no modes. `thread_count` 0:
// all cores.
void fill_channels(Matte& matte, const Mosaic& mosaic, int thread_count = 0);

// Rows [first, first + count) of a matte.
Matte rows_of(const Matte& matte, int first, int count);

}  // namespace glasswing
