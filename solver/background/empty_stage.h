// What the frames without the object say about a pixel: which part of which monitor it looks at. It depends
// on that pixel's own samples alone, so tiles join without seams.
#pragma once

#include <array>
#include <vector>

#include "core/matte/matte.h"
#include "glasswing/v1/archive.pb.h"
#include "solver/background/bar_decoder.h"
#include "solver/background/silhouette.h"
#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

using Samples3 = std::array<double, kChannels>;  // one pixel in one frame, radiance

// --- Which frames ---------------------------------------------------------------------------------------

// Bars of one width on one monitor. Frames are places in the manifest; -1: there is none.
struct BarFrames {
  double width_px = 0.0;
  double light = 1.0;  // radiance of the lit bars, gray
  int frame = -1;
  int inverse = -1;
};

struct EmptyMonitor {
  int texture = 0;
  int width_px = 0, height_px = 0;
  int patch_rows = 0;  // below those
  // [0]: vertical bars, along x; [1]: horizontal bars, along y. Wide to narrow. Bars without complement
  // count only if there is a white.
  std::array<std::vector<BarFrames>, 2> bars;
  int black = -1;  // all monitors black
  int white = -1;  // the brightest gray solid
  double white_light = 1.0;
};

// By texture, one for every monitor of the manifest, with whatever frames there are. Where frames of several
// exposures are, those of the exposure that has most.
std::vector<EmptyMonitor> lay_out_empty_stage(const v1::CaptureManifest& manifest);

// Every frame that lay_out_empty_stage() names.
std::vector<int> frames_of(const std::vector<EmptyMonitor>& monitors);

// --- The background map -----------------------------------------------------------------------------------

struct BarSamples {
  Samples3 lit{}, inverse{};  // as taken; `inverse` is ignored where there is no such frame
};
struct EmptyPixel {
  Samples3 black{}, white{};                    // ignored where there is no such frame
  std::array<std::vector<BarSamples>, 2> bars;  // in the order of EmptyMonitor::bars
};
// `pixel` is filled anew; keep one to save the allocations.
void gather(const FrameStack& stack, const EmptyMonitor& monitor, int x, int y, EmptyPixel& pixel);

struct BackgroundPoint {
  // The pixel sees this monitor. If not, weights are 0, and the place means nothing.
  bool seen = false;
  std::array<bool, 2> measured{};  // along x, y; where not, it is the straight view's
  Samples3 weight{};               // of the whole footprint, as a mode's
  Samples3 foreground{};           // the light without the monitor
  std::array<AxisFit, 2> axis;     // along x, y
  bool ambiguous = false;          // another place explains the bars about as well
  double chi_square = 0.0;  // of the bars, and how many there were: more than a few times as much means
  int degrees = 0;          // that the pixel sees no single footprint

  Mode mode(int channel, int texture) const;
};

// Straight through: camera and monitor cover each other, edge to edge.
struct StraightView {
  std::array<double, 2> centre_px{};
  std::array<double, 2> scale{};  // monitor px a camera px
};
StraightView straight_view(const v1::Camera& camera, const EmptyMonitor& monitor, int x, int y);

// Measures points on one monitor. Thread-safe.
class BackgroundMap {
 public:
  BackgroundMap(const EmptyMonitor& monitor, const SampleNoise& noise);

  // Centre and width of each axis by least squares over its bars, all channels together; weights and
  // foreground by least squares over black, white and all bars. `straight` breaks ties that the bars leave
  // (BarDecoder::Guess), and is the answer for the first monitor where there are no bars.
  BackgroundPoint point(const EmptyPixel& pixel, const StraightView& straight) const;

 private:
  struct Contrast {
    Samples3 radiance{}, variance{};
  };
  Contrast contrast_of(const EmptyPixel& pixel) const;
  // Difference of lit and unlit bars for light 1, and its variance.
  Contrast difference_of(const EmptyPixel& pixel, size_t axis, size_t level) const;
  bool sees(const EmptyPixel& pixel, const Contrast& contrast) const;
  void weigh(const EmptyPixel& pixel, BackgroundPoint& point) const;

  EmptyMonitor monitor_;
  SampleNoise noise_;
  double seen_threshold_ = 0.0;
  std::array<BarDecoder, 2> decoders_;
};

}  // namespace glasswing
