// Finds the peaks of responses to sweeps (Chuang et al. 2000, section 3.2): maxima above the noise after
// smoothing, each fitted by a Gaussian in its surroundings, or by two if one does not explain them.
//
// Responses come in blocks of kBlockLanes lanes, sample by sample, as frames store them. A lane is one
// channel of one pixel.
#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "core/footprint/footprint.h"
#include "solver/gaussian/kernels/line_fit.h"

namespace glasswing {

inline constexpr int kBlockLanes = 16;
inline constexpr int kMaxPeaks = 4;

// One sweep's peaks, highest first.
struct Peaks {
  int count = 0;
  std::array<Peak, kMaxPeaks> peaks{};
  std::span<const Peak> all() const { return {peaks.data(), static_cast<size_t>(count)}; }
};

// One sweep of a block: y[i * kBlockLanes + lane], baseline subtracted, at r = first_r_px + i step_px.
struct SweepBlock {
  const float* y = nullptr;
  int count = 0;
  double first_r_px = 0.0, step_px = 0.0;
};

// The noise of each lane whose samples are otherwise smooth: from second differences d, with sd(d) = sqrt(6)
// sd(y) and peaks clipped (mean |d| of those within 3 sd, iterated three times).
std::array<float, kBlockLanes> estimate_noise(const SweepBlock& sweep);

class PeakFinder {
 public:
  // floor: minimum height of a peak; noise_sd: of a sample; both by lane. Lanes whose bit in `lanes` is not
  // set are skipped. `found`: [sweep][lane].
  void find(std::span<const SweepBlock> sweeps, const std::array<float, kBlockLanes>& floor,
            const std::array<float, kBlockLanes>& noise_sd, unsigned lanes,
            std::vector<std::array<Peaks, kBlockLanes>>& found);

 private:
  struct Top {
    int sweep = 0, lane = 0, place = 0;
    LineWindow window;
    SingleFit fit;
  };
  void add_tops(int sweep, const SweepBlock& block, const std::array<float, kBlockLanes>& floor,
                unsigned lanes);
  void add_doubles(const std::array<float, kBlockLanes>& noise_sd);

  std::vector<Top> tops_;
  std::vector<std::pair<int, int>> by_length_;  // half a window and the index of its top
  std::vector<LineWindow> windows_;
  std::vector<SingleFit> singles_;
  std::vector<DoubleFit> doubles_;
  std::vector<size_t> double_of_;  // index of the top of each
};

namespace internal {

// The highest maxima of each lane after smoothing by (1 2 1)/4, at most kMaxPeaks, highest first. `smooth`
// receives the smoothed samples.
struct LaneTops {
  int count = 0;
  std::array<float, kMaxPeaks> height;
  std::array<int, kMaxPeaks> place;
};
void find_tops(const SweepBlock& sweep, const float* floor, LaneTops* tops);

}  // namespace internal
}  // namespace glasswing
