// Solves rows of a stack of frames: the whole of Chuang et al. 2000, section 3, for one pixel's channel after
// another.
#pragma once

#include <optional>
#include <vector>

#include "core/matte/matte.h"
#include "solver/gaussian/empty_stage.h"
#include "solver/gaussian/joint_batch.h"
#include "solver/gaussian/mode_search.h"
#include "solver/gaussian/sample_tile.h"
#include "solver/gaussian/silhouette.h"
#include "solver/gaussian/stack_layout.h"
#include "solver/method.h"

namespace glasswing {

class StackSolver {
 public:
  // All must outlive it. `most_modes`: 1 to kMaxModes, of a channel over all monitors.
  StackSolver(const FrameStack& stack, const StackLayout& layout, int most_modes,
              double silhouette_tolerance);

  // Row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

 private:
  // One monitor's sweeps.
  struct Texture {
    int texture = 0;
    MonitorExtent extent;
    SampleLayout samples;
    std::vector<size_t> sweeps;   // places in the layout, in the order of samples.sweeps
    std::vector<EvenSweep> even;  // empty unless fit_plain can have them all
  };
  // What the crests of one block are found in, one for every sweep of the layout.
  struct Grid {
    bool even = true;
    double step_px = 0.0;
    int count = 0;
    std::vector<float> samples;  // of uneven sweeps, drawn through a straight line
  };

  void find_silhouette(int y);
  // What the pixel sees without the object.
  void map_background(int x, int y, Matte& matte);
  void estimate_row_noise(int y);
  void solve_block(int y, int block, int first_lane, Matte& matte);
  // The lanes of the block that one footprint on this monitor explains.
  void fit_plain_lanes(size_t texture, int block, unsigned lanes);
  void solve_lane(int block, int lane, int x, int y, int channel, Matte& matte);
  JointFit search(const Texture& texture, int block, int lane, int channel, double noise_sd, int most_modes,
                  std::uint8_t& flags);
  void find_crests(int block, const std::array<float, kBlockLanes>& floor,
                   const std::array<float, kBlockLanes>& noise, unsigned lanes);
  float black(int y, int lane) const;

  const FrameStack& stack_;
  const StackLayout& layout_;
  const int most_modes_;
  const int lane_count_;  // of a row
  const bool noise_known_;
  const SampleNoise noise_;  // where it is not known: as of an ordinary camera
  const SilhouetteTest silhouette_;
  std::vector<EmptyMonitor> empty_;
  std::vector<BackgroundMap> background_;
  EmptyPixel empty_pixel_;
  std::vector<Texture> textures_;
  std::vector<Grid> grids_;
  SampleTile tile_;
  // Of the row in hand.
  std::vector<float> noise_sd_;  // a dark sample's, by lane
  std::vector<bool> object_;     // by pixel
  // Of the block in hand.
  std::array<float, kBlockLanes> baseline_{};
  CrestFinder finder_;
  std::vector<std::array<std::optional<JointFit>, kBlockLanes>> plain_;  // [texture][lane]
  std::vector<int> plain_lanes_;
  std::vector<PlainPixel> plain_pixels_;
  std::vector<PlainFit> plain_fits_;
  std::vector<std::array<Crests, kBlockLanes>> crests_;  // [sweep][lane]
  PixelSamples samples_;
  JointWorkspace workspace_;
};

}  // namespace glasswing
