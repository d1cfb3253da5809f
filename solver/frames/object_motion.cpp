#include "solver/frames/object_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "core/base/median.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/frames/lit_view.h"

namespace glasswing {
namespace {

constexpr int kRim = 2;                // sampled pixels from the object
constexpr double kLit = 0.3;           // of a stripe's peak
constexpr double kCovered = 0.15;      // change of a pixel's light that only the object makes
constexpr double kMinLightSds = 20.0;  // standard deviations of noise
constexpr size_t kMinMoved = 5;        // pixels
constexpr double kMinShare = 0.03;     // of those at the rim

// Pixels beside the object with one that is not beside it within kRim of them, in rows and columns of
// samples.
std::vector<bool> rim_of(const SessionSamples& samples, const std::vector<bool>& beside) {
  const auto columns = static_cast<int>(
      std::ranges::count(samples.pixels, samples.pixels.front().y, &SessionSamples::Pixel::y));
  const int rows = static_cast<int>(samples.pixels.size()) / columns;
  std::vector<bool> rim(beside.size());
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      if (!beside[static_cast<size_t>(j * columns + i)]) continue;
      for (int y = std::max(j - kRim, 0); y <= std::min(j + kRim, rows - 1); ++y) {
        for (int x = std::max(i - kRim, 0); x <= std::min(i + kRim, columns - 1); ++x) {
          if (!beside[static_cast<size_t>(y * columns + x)]) rim[static_cast<size_t>(j * columns + i)] = true;
        }
      }
    }
  }
  return rim;
}

// Stripes of one direction on one monitor, with the object, in the order of the manifest.
std::vector<std::vector<int>> sweeps_of(const v1::CaptureManifest& manifest, const SessionSamples& samples,
                                        int texture) {
  std::map<std::tuple<double, double>, std::vector<int>> sweeps;
  for (int f = 0; f < manifest.frames_size(); ++f) {
    const v1::Stimulus& stimulus = manifest.frames(f).stimulus();
    if (!manifest.frames(f).object() || kind_of(stimulus) != StimulusKind::kStripe ||
        samples.light[static_cast<size_t>(f)].empty() || texture_of(manifest, stimulus.panel()) != texture)
      continue;
    sweeps[{stimulus.phi_deg(), stimulus.sigma_px()}].push_back(f);
  }
  std::vector<std::vector<int>> in_order;
  for (auto& [key, frames] : sweeps) in_order.push_back(std::move(frames));
  std::ranges::sort(in_order, {}, [](const std::vector<int>& frames) { return frames.front(); });
  return in_order;
}

// a of each pixel of the view, in the mean of its lanes; NaN where too little of the sweep lights it.
std::vector<double> lights_of(const v1::CaptureManifest& manifest, const SessionSamples& samples,
                              const LitView& view, int black, const std::vector<int>& sweep) {
  const auto lanes = static_cast<size_t>(samples.lanes_per_pixel);
  std::vector<double> products(view.pixels().size()), squares(view.pixels().size());
  for (const int f : sweep) {
    const auto picture = LitView::Picture::of(manifest.frames(f).stimulus());
    for (size_t i = 0; picture && i < view.pixels().size(); ++i) {
      const double h = picture->at(view.pixels()[i], 0.0, 0.0).h;
      if (h < kLit) continue;
      for (size_t lane = view.pixels()[i].pixel * lanes; lane < (view.pixels()[i].pixel + 1) * lanes;
           ++lane) {
        const float dark = black < 0 ? 0.0f : samples.light[static_cast<size_t>(black)][lane];
        const auto light = static_cast<double>(samples.light[static_cast<size_t>(f)][lane] - dark);
        if (std::isnan(light)) continue;
        products[i] += h * light;
        squares[i] += h * h;
      }
    }
  }
  for (size_t i = 0; i < products.size(); ++i)
    products[i] = squares[i] > kLit ? products[i] / squares[i] : NAN;
  return products;
}

}  // namespace

std::string object_motion_warning(const v1::CaptureManifest& manifest, const ComparedFrames& compared) {
  if (compared.layout.bare) return "";
  const std::vector<bool> rim = rim_of(compared.samples, compared.beside);
  for (const EmptyMonitor& monitor : compared.layout.monitors) {
    const auto& stage = compared.maps.of_monitor[static_cast<size_t>(monitor.texture)];
    const std::vector<std::vector<int>> sweeps = sweeps_of(manifest, compared.samples, monitor.texture);
    if (!stage || sweeps.size() < 2) continue;
    const LitView view(compared.samples, rim, monitor, *stage);
    const std::vector<double> first =
        lights_of(manifest, compared.samples, view, monitor.black, sweeps.front());
    for (size_t k = 1; k < sweeps.size(); ++k) {
      const std::vector<double> own = lights_of(manifest, compared.samples, view, monitor.black, sweeps[k]);
      std::vector<double> ratios;
      for (size_t i = 0; i < first.size(); ++i) {
        if (first[i] > kMinLightSds * compared.noise_sd && !std::isnan(own[i]))
          ratios.push_back(own[i] / first[i]);
      }
      if (ratios.size() < kMinMoved) continue;
      std::vector<double> sorted = ratios;
      const double usual = median(sorted);
      const auto moved = static_cast<size_t>(std::ranges::count_if(
          ratios, [&](double ratio) { return std::abs(ratio / usual - 1.0) > kCovered; }));
      if (moved < kMinMoved || static_cast<double>(moved) < kMinShare * static_cast<double>(ratios.size()))
        continue;
      return fmt::format(
          "the object moved before frame {}: {} of {} pixels at its rim no longer see what they saw in the "
          "first sweep; capture again from frame {}",
          sweeps[k].back(), moved, ratios.size(), sweeps[k - 1].front());
    }
  }
  return "";
}

}  // namespace glasswing
