#include "solver/corrections/bar_sums.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include "core/base/median.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/frames/frame_names.h"

namespace glasswing {
namespace {

constexpr double kMinSumSds = 20.0;  // standard deviations of noise
constexpr size_t kMinSums = 300;     // samples
constexpr double kAgree = 0.03;      // of a sum
constexpr double kMaxScatter =
    0.1;  // of sums over their median: codes are not light, or the bars are too fine

// The frames of one picture of bars, and of its inverse.
using BarPair = std::array<int, 2>;

struct AreaFrames {
  int white = -1, black = -1;
  std::vector<BarPair> bars;
};

// With the object, by monitor and exposure.
std::vector<AreaFrames> areas_of(const v1::CaptureManifest& manifest, const SessionSamples& samples) {
  using Key = std::tuple<std::string, double>;
  std::map<Key, AreaFrames> areas;
  std::map<std::tuple<Key, std::string, double, double>, BarPair> bars;
  for (int f = 0; f < manifest.frames_size(); ++f) {
    const v1::Frame& frame = manifest.frames(f);
    const v1::Stimulus& stimulus = frame.stimulus();
    if (!frame.object() || !is_pattern(frame) || samples.light[f].empty()) continue;
    const Key key{stimulus.panel(), frame.exposure_ms()};
    const double gray = gray_of(stimulus);
    if (kind_of(stimulus) == StimulusKind::kSolid && gray == 0.0) areas[key].black = f;
    if (kind_of(stimulus) == StimulusKind::kSolid && gray == 1.0) areas[key].white = f;
    if (kind_of(stimulus) != StimulusKind::kSquare) continue;
    const auto pair = bars.try_emplace(
        {key, stimulus.orient(), stimulus.bar_width_px(), stimulus.offset_px()}, BarPair{-1, -1});
    pair.first->second[stimulus.inverse() ? 1 : 0] = f;
  }
  for (const auto& [key, pair] : bars) {
    if (std::ranges::min(pair) >= 0) areas[std::get<0>(key)].bars.push_back(pair);
  }
  std::vector<AreaFrames> all;
  for (auto& [key, own] : areas) {
    if (own.white >= 0 && own.black >= 0) all.push_back(std::move(own));
  }
  return all;
}

// The two pictures' light over white's, minus black; 1 if that is unknown.
double sum_of(const ComparedFrames& compared, const AreaFrames& areas, const BarPair& pair) {
  const auto light = [&](int frame, size_t lane) {
    return static_cast<double>(compared.samples.light[frame][lane]);
  };
  std::vector<double> sums;
  for (size_t lane = 0; lane < compared.samples.lane_count(); ++lane) {
    const double black = light(areas.black, lane), white = light(areas.white, lane) - black;
    const double sum = (light(pair[0], lane) + light(pair[1], lane) - 2.0 * black) / white;
    if (white > kMinSumSds * compared.noise_sd && !std::isnan(sum)) sums.push_back(sum);
  }
  if (sums.size() < kMinSums) return 1.0;
  const double middle = median(sums);
  for (double& sum : sums) sum = std::abs(sum - middle);
  return 1.4826 * median(sums) > kMaxScatter ? 1.0 : middle;
}

}  // namespace

std::string bar_sums_warning(const v1::CaptureManifest& manifest, const ComparedFrames& compared) {
  std::vector<int> odd;
  double most = 1.0;
  for (const AreaFrames& areas : areas_of(manifest, compared.samples)) {
    for (const BarPair& pair : areas.bars) {
      const double sum = sum_of(compared, areas, pair);
      if (std::abs(sum - 1.0) < kAgree) continue;
      odd.insert(odd.end(), pair.begin(), pair.end());
      if (std::abs(sum - 1.0) > std::abs(most - 1.0)) most = sum;
    }
  }
  if (odd.empty()) return "";
  std::ranges::sort(odd);
  std::vector<int> order;
  for (int f = 0; f < manifest.frames_size(); ++f) order.push_back(f);
  return fmt::format(
      "{}: bars plus their inverse are up to {:.3f} times as bright as white: the exposure or the light "
      "changed, or the codes are not light; not corrected, as no pixel sees the stage beside the object",
      names_of(odd, order), most);
}

}  // namespace glasswing
