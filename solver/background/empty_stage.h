// The background map from frames without the object: which part of which monitor a pixel sees, by that
// pixel's own samples or on the smooth map of the whole picture (stage_map.h).
#pragma once

#include <array>
#include <vector>

#include "core/matte/matte.h"
#include "glasswing/v1/archive.pb.h"
#include "solver/background/bar_decoder.h"
#include "solver/background/silhouette.h"
#include "solver/background/stage_map.h"
#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

using Samples3 = std::array<double, kChannels>;  // one pixel in one frame, radiance

// --- Frames ----------------------------------------------------------------------------------------------

// Bars of one width on one monitor. Frames are indices in the manifest; -1: none.
struct BarFrames {
  double width_px = 0.0;
  double light = 1.0;  // radiance of the lit bars, gray
  int frame = -1;
  int inverse = -1;
};

struct EmptyMonitor {
  int texture = 0;
  int width_px = 0, height_px = 0;
  int patch_rows = 0;  // below height_px
  // [0]: vertical bars, along x; [1]: horizontal bars, along y. Wide to narrow. Bars without complement are
  // used only if there is a white.
  std::array<std::vector<BarFrames>, 2> bars;
  int black = -1;  // all monitors black
  int white = -1;  // the brightest gray solid
  double white_light = 1.0;
};

// By texture, one for every monitor of the manifest, even without frames. If there are several exposures, the
// one with most frames is used.
std::vector<EmptyMonitor> lay_out_empty_stage(const v1::CaptureManifest& manifest);

// Every frame listed by lay_out_empty_stage().
std::vector<int> frames_of(const std::vector<EmptyMonitor>& monitors);

// --- The background map -----------------------------------------------------------------------------------

struct BarSamples {
  Samples3 lit{}, inverse{};  // as recorded; `inverse` is ignored if there is no such frame
};
struct EmptyPixel {
  Samples3 black{}, white{};                           // ignored if there is no such frame
  std::array<std::vector<BarSamples>, 2> bars;         // in the order of EmptyMonitor::bars
  size_t first_channel = 0, last_channel = kChannels;  // [first, last) were measured
};
// `pixel` is overwritten; reuse one to save allocations.
void gather(const FrameStack& stack, const EmptyMonitor& monitor, int x, int y, EmptyPixel& pixel);

struct BackgroundPoint {
  // The pixel sees this monitor. If not, weights are 0 and the position is meaningless.
  bool seen = false;
  std::array<bool, 2> measured{};  // along x, y; otherwise taken from the straight view
  Samples3 weight{};               // of the whole footprint, as a mode's
  Samples3 foreground{};           // the light without the monitor
  std::array<AxisFit, 2> axis;     // along x, y
  bool ambiguous = false;          // another position explains the bars about as well
  double chi_square = 0.0;         // of the bars; more than a few times `degrees` means
  int degrees = 0;                 // that the pixel sees no single footprint

  Mode mode(int channel, int texture) const;
};

// The view straight through: the camera's picture and the monitor cover each other edge to edge.
struct StraightView {
  std::array<double, 2> centre_px{};
  std::array<double, 2> scale{};  // monitor px per camera px
};
StraightView straight_view(const v1::Camera& camera, const EmptyMonitor& monitor, int x, int y);

// The smooth map of one monitor, and how far its pixels may deviate from it.
struct SmoothStage {
  StageMap map;
  double sd_px = 0.0;        // of the map itself, rms over the pixels that see the monitor
  double place_sd_px = 0.0;  // of the usual pixel about the map
  // The difference of v of each wave from the map in a typical pixel, beyond noise; by axis, in the order of
  // EmptyMonitor::bars.
  std::array<std::vector<double>, 2> wave_sd;
};

// Measures points on one monitor. Thread-safe.
class BackgroundMap {
 public:
  // `channel_count`: 1 for the pixels of a mosaic.
  BackgroundMap(const EmptyMonitor& monitor, const SampleNoise& noise, int channel_count = kChannels);

  // Fits centre and width of each axis by least squares over its bars, all measured channels together, then
  // weights and foreground by least squares over black, white and all bars. `straight` breaks ties left by
  // the bars (BarDecoder::Guess), and is the result for the first monitor if there are no bars.
  BackgroundPoint point(const EmptyPixel& pixel, const StraightView& straight) const;

  // The same with centre and width as on the map at (x_px, y_px) of the picture.
  BackgroundPoint point_on(const SmoothStage& map, const EmptyPixel& pixel, double x_px, double y_px) const;
  // The same, moved to where the pixel's own bars see it, with the footprint's width on the map; centre_sd_px
  // is that of this position alone. Unlike the map its errors are not shared with neighbours.
  BackgroundPoint point_near(const SmoothStage& map, const EmptyPixel& pixel, double x_px, double y_px) const;
  // Whether the pixel's own bars refute that place.
  bool refutes(const BackgroundPoint& on_map) const;

  // The difference between v of each wave and what the monitor shows to a footprint at this place.
  struct Miss {
    double value = 0.0, sd = 1.0;                // and the sd of its noise
    double by_centre = 0.0, by_log_sigma = 0.0;  // derivatives of v
  };
  using Misses = std::array<std::vector<Miss>, 2>;  // by axis and wave
  Misses misses(const EmptyPixel& pixel, const StagePoint& place) const {
    return misses(waves_of(pixel), place);
  }
  // In two parts, for many places of one pixel.
  using Waves = std::array<std::vector<BarDecoder::Sample>, 2>;
  Waves waves_of(const EmptyPixel& pixel) const;
  Misses misses(const Waves& waves, const StagePoint& place) const;

 private:
  struct Contrast {
    Samples3 radiance{}, variance{};
  };
  Contrast contrast_of(const EmptyPixel& pixel) const;
  // The difference of lit and unlit bars per light 1, and its variance.
  Contrast difference_of(const EmptyPixel& pixel, size_t axis, size_t level) const;
  bool sees(const EmptyPixel& pixel, const Contrast& contrast) const;
  // v by wave.
  std::vector<BarDecoder::Sample> waves(const EmptyPixel& pixel, size_t axis, const Contrast& contrast) const;
  // Weights and foreground of a point whose axes are set.
  void weigh(const EmptyPixel& pixel, const Contrast& contrast, BackgroundPoint& point) const;
  bool has_bars() const { return decoders_[0].wave_count() + decoders_[1].wave_count() > 0; }
  bool has_solids() const { return monitor_.white >= 0 && monitor_.black >= 0; }
  // Whether the pixel demonstrably sees this monitor.
  bool usable(const EmptyPixel& pixel, const Contrast& contrast) const;

  EmptyMonitor monitor_;
  SampleNoise noise_;
  double seen_threshold_ = 0.0, refuted_threshold_ = 0.0;
  std::array<BarDecoder, 2> decoders_;
};

}  // namespace glasswing
