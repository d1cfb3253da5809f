#include "solver/gaussian/peaks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace glasswing {
namespace {

// One lane's samples around a top, smoothed by (1 2 1)/4.
class Smoothed {
 public:
  // `left` and `right`: samples on either side.
  Smoothed(const float* top, int left, int right) : top_(top), left_(left), right_(right) {}
  float operator()(int k) const {
    const float middle = top_[k * kBlockLanes];
    const float before = k > -left_ ? top_[(k - 1) * kBlockLanes] : middle;
    const float after = k < right_ ? top_[(k + 1) * kBlockLanes] : middle;
    return 0.25f * (before + 2.0f * middle + after);
  }

 private:
  const float* top_;
  int left_, right_;
};

// The start of a fit, from the smoothed top and the samples two to its left and right,
//   (y(-2) + y(2)) / (2 y(0)) = exp(-2 / sigma^2) for a Gaussian on its centre.
LineGaussian start_of(const Smoothed& smooth, int room) {
  const int k = std::min(room, 2);
  const float height = smooth(0), left = smooth(-k), right = smooth(k);
  const float ratio = std::clamp(0.5f * (left + right) / height, 0.05f, 0.97f);
  const auto kk = static_cast<float>(k * k);
  // The filter has widened it by 1/2 sample^2.
  const float sigma = std::sqrt(std::max(-0.5f * kk / std::log(ratio) - 0.5f, 1.0f));
  const float curvature = 2.0f * height - left - right;
  const float centre =
      curvature > 0.0f ? std::clamp(0.5f * static_cast<float>(k) * (right - left) / curvature, -1.0f, 1.0f)
                       : 0.0f;
  return {.amplitude = height * std::sqrt(1.0f + 0.5f / (sigma * sigma)), .centre = centre, .sigma = sigma};
}

// The number of samples on either side before the response rises again or has decayed.
int room_round(const Smoothed& smooth, int most) {
  const float low = 0.02f * smooth(0);
  float left = smooth(-1), right = smooth(1);
  int half = 1;
  while (half < most && !(left < low && right < low)) {
    const float next_left = smooth(-half - 1), next_right = smooth(half + 1);
    if (next_left > left || next_right > right) break;
    left = next_left, right = next_right;
    ++half;
  }
  return half;
}

}  // namespace

void PeakFinder::add_tops(int sweep, const SweepBlock& block, const std::array<float, kBlockLanes>& floor,
                          unsigned lanes) {
  std::array<internal::LaneTops, kBlockLanes> tops{};
  internal::find_tops(block, floor.data(), tops.data());
  for (int lane = 0; lane < kBlockLanes; ++lane) {
    if ((lanes >> lane & 1u) == 0) continue;
    const internal::LaneTops& own = tops[lane];
    for (int t = 0; t < own.count; ++t) {
      const int place = own.place[t];
      const int room = std::min(place, block.count - 1 - place);
      const Smoothed smooth(block.y + place * kBlockLanes + lane, place, block.count - 1 - place);
      Top& found =
          tops_.emplace_back(Top{.sweep = sweep, .lane = lane, .place = place, .window = {}, .fit = {}});
      found.fit.peak = room > 0 ? start_of(smooth, room)
                                : LineGaussian{.amplitude = smooth(0), .centre = 0.0f, .sigma = 2.0f};
      const int reach = static_cast<int>(std::ceil(4.0f * found.fit.peak.sigma));
      found.window = {.middle = block.y + place * kBlockLanes + lane,
                      .stride = kBlockLanes,
                      .half = room > 0 ? room_round(smooth, std::min({reach, room, kMaxHalf})) : 0};
    }
  }
}

// Fits two Gaussians to windows that one does not explain.
void PeakFinder::add_doubles(const std::array<float, kBlockLanes>& noise_sd) {
  doubles_.clear();
  double_of_.clear();
  windows_.clear();
  for (size_t i = 0; i < tops_.size(); ++i) {
    const Top& top = tops_[i];
    const auto n = static_cast<float>(2 * top.window.half + 1);
    if (!top.fit.settled || top.window.half < 5) continue;
    const LineGaussian& one = top.fit.peak;
    const float noise = std::max(noise_sd[top.lane], 0.01f * one.amplitude);
    if (top.fit.chi2 < 1.5f * n * noise * noise) continue;
    const LineGaussian half{
        .amplitude = 0.6f * one.amplitude, .centre = one.centre, .sigma = 0.75f * one.sigma};
    DoubleFit& fit = doubles_.emplace_back();
    fit.peaks[0] = fit.peaks[1] = half;
    fit.peaks[0].centre -= 0.7f * one.sigma;
    fit.peaks[1].centre += 0.7f * one.sigma;
    double_of_.push_back(i);
    windows_.push_back(top.window);
  }
  if (doubles_.empty()) return;
  fit_double(windows_, doubles_);
}

void PeakFinder::find(std::span<const SweepBlock> sweeps, const std::array<float, kBlockLanes>& floor,
                      const std::array<float, kBlockLanes>& noise_sd, unsigned lanes,
                      std::vector<std::array<Peaks, kBlockLanes>>& found) {
  tops_.clear();
  for (size_t s = 0; s < sweeps.size(); ++s) add_tops(static_cast<int>(s), sweeps[s], floor, lanes);
  by_length_.clear();
  for (size_t i = 0; i < tops_.size(); ++i) {
    if (tops_[i].window.half >= 2) by_length_.emplace_back(tops_[i].window.half, static_cast<int>(i));
  }
  // Similar lengths side by side.
  std::sort(by_length_.begin(), by_length_.end());
  windows_.clear();
  singles_.clear();
  for (const auto& [half, i] : by_length_) {
    windows_.push_back(tops_[i].window);
    singles_.push_back(tops_[i].fit);
  }
  fit_single(windows_, singles_);
  for (size_t k = 0; k < singles_.size(); ++k) tops_[by_length_[k].second].fit = singles_[k];
  add_doubles(noise_sd);

  found.assign(sweeps.size(), {});
  const auto add = [&](const Top& top, const LineGaussian& fit) {
    const SweepBlock& sweep = sweeps[top.sweep];
    Peaks& peaks = found[top.sweep][top.lane];
    const Peak peak{
        .amplitude = fit.amplitude,
        .centre_px = sweep.first_r_px + (top.place + static_cast<double>(fit.centre)) * sweep.step_px,
        .sigma_px = fit.sigma * sweep.step_px};
    int at = peaks.count < kMaxPeaks ? peaks.count++ : kMaxPeaks - 1;
    if (at == kMaxPeaks - 1 && peaks.peaks[at].amplitude > peak.amplitude) return;
    for (; at > 0 && peaks.peaks[at - 1].amplitude < peak.amplitude; --at) {
      peaks.peaks[at] = peaks.peaks[at - 1];
    }
    peaks.peaks[at] = peak;
  };
  size_t next = 0;
  for (size_t i = 0; i < tops_.size(); ++i) {
    const Top& top = tops_[i];
    const bool tried = next < double_of_.size() && double_of_[next] == i;
    const DoubleFit* two = tried ? &doubles_[next++] : nullptr;
    const auto n = static_cast<float>(2 * top.window.half + 1);
    // The Bayesian information criterion for three more parameters.
    const bool better =
        two != nullptr && two->settled && n * std::log(top.fit.chi2 / two->chi2) > 3.0f * std::log(n);
    add(top, better ? two->peaks[0] : top.fit.peak);
    if (better) add(top, two->peaks[1]);
  }
}

}  // namespace glasswing
