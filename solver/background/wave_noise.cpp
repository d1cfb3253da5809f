#include "solver/background/wave_noise.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <tuple>

#include "core/matte/matte.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/background/stage_layout.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr double kMedianOfNormal = 0.67449;  // of |x|, in standard deviations
constexpr double kMin = 1.0 / 65535.0;

}  // namespace

WaveNoise::WaveNoise(const v1::CaptureManifest& manifest) {
  struct Bars {
    int frame = -1, complement = -1;
  };
  std::map<std::tuple<bool, std::string, std::string>, Bars>
      bars;  // object, monitor, the stimulus without `inverse`
  std::map<bool, int> black;
  std::map<std::pair<bool, std::string>, int> white;
  const auto first = std::ranges::find_if(manifest.frames(), [](const v1::Frame& frame) {
    return is_pattern(frame) && kind_of(frame.stimulus()) == StimulusKind::kSquare;
  });
  if (first == manifest.frames().end()) return;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    v1::Stimulus stimulus = frame.stimulus();
    if (!is_pattern(frame) || frame.exposure_ms() != first->exposure_ms()) continue;
    if (kind_of(stimulus) == StimulusKind::kSolid) {
      if (gray_of(stimulus) == 0.0) black[frame.object()] = i;
      if (gray_of(stimulus) == 1.0) white[{frame.object(), stimulus.panel()}] = i;
    } else if (kind_of(stimulus) == StimulusKind::kSquare && gray_of(stimulus) == 1.0) {
      const bool inverse = stimulus.inverse();
      stimulus.clear_inverse();
      Bars& own = bars[{frame.object(), stimulus.panel(), stimulus.SerializeAsString()}];
      (inverse ? own.complement : own.frame) = i;
    }
  }
  for (const auto& [key, own] : bars) {
    const auto dark = black.find(std::get<0>(key));
    const auto lit = white.find({std::get<0>(key), std::get<1>(key)});
    if (own.frame < 0 || own.complement < 0 || dark == black.end() || lit == white.end()) continue;
    sums_.push_back(
        {.bars = own.frame, .complement = own.complement, .white = lit->second, .black = dark->second});
  }
}

std::vector<int> WaveNoise::frames() const {
  std::set<int> frames;
  for (const Sum& sum : sums_) frames.insert({sum.bars, sum.complement, sum.white, sum.black});
  return {frames.begin(), frames.end()};
}

double WaveNoise::of_row(const FrameStack& stack, int y) const {
  std::vector<float> off;
  const int width = stack.width_px;
  for (const Sum& sum : sums_) {
    for (int x = 0; x < width; ++x) {
      for (const int c : stack.channels(x, y)) {
        off.push_back(std::abs(stack.at(sum.bars, x, y, c) + stack.at(sum.complement, x, y, c) -
                               stack.at(sum.white, x, y, c) - stack.at(sum.black, x, y, c)));
      }
    }
  }
  const auto middle = off.begin() + std::ssize(off) / 2;
  std::nth_element(off.begin(), middle, off.end());
  return std::max(static_cast<double>(*middle) / (2.0 * kMedianOfNormal), kMin);
}

}  // namespace glasswing
