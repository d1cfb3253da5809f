#include "solver/corrections/second_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/median.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr size_t kBands = 6;  // of the picture's rows
constexpr double kMinSecondStep = 0.01, kWideBar_px = 4.0;
constexpr float kMinLit = 0.2f;                 // minimum light of a usable lane
constexpr float kIsDark = 0.4f, kIsLit = 0.6f;  // of white
constexpr size_t kMinDarkSamples = 100;         // samples

// Dark samples of a band of rows, of white, by whether the lane is lit in the frame beside, and in the one on
// the other side.
using DarkSamples = std::array<std::array<std::vector<float>, 2>, 2>;

bool is_area(const v1::Frame& frame) {
  const StimulusKind kind = kind_of(frame.stimulus());
  return (kind == StimulusKind::kSolid || kind == StimulusKind::kSquare) && is_pattern(frame);
}

// Bars in which many pixels are neither lit nor dark.
bool is_fine(const v1::Stimulus& stimulus) {
  return kind_of(stimulus) == StimulusKind::kSquare && stimulus.bar_width_px() < kWideBar_px;
}

// Of the first solid of this level on the same monitor, with or without the object as this frame; -1: none.
int solid_like(const v1::CaptureManifest& manifest, const v1::Frame& frame, double level) {
  for (int f = 0; f < manifest.frames_size(); ++f) {
    const v1::Frame& other = manifest.frames(f);
    if (is_area(other) && kind_of(other.stimulus()) == StimulusKind::kSolid &&
        other.object() == frame.object() && other.stimulus().panel() == frame.stimulus().panel() &&
        gray_of(other.stimulus()) == level)
      return f;
  }
  return -1;
}

// What each band of rows shows, beside the object, of the frames one further (1) or back (-1) in time; empty:
// too few samples are usable.
std::vector<double> shares_of(const v1::CaptureManifest& manifest, const ComparedFrames& compared,
                              const std::vector<int>& order, std::ptrdiff_t way) {
  const SessionSamples& samples = compared.samples;
  std::array<DarkSamples, kBands> dark;
  const int height = manifest.camera().height_px();
  for (std::ptrdiff_t i = 1; i + 1 < std::ssize(order); ++i) {
    const auto own = static_cast<size_t>(order[i]), beside = static_cast<size_t>(order[i + way]),
               opposite = static_cast<size_t>(order[i - way]);
    const v1::Frame& frame = manifest.frames(static_cast<int>(own));
    if (!is_area(frame) || is_fine(frame.stimulus()) || !is_area(manifest.frames(static_cast<int>(beside))) ||
        !is_area(manifest.frames(static_cast<int>(opposite))))
      continue;
    const int white = solid_like(manifest, frame, 1.0), black = solid_like(manifest, frame, 0.0);
    if (white < 0 || black < 0) continue;
    const std::vector<float>&full = samples.light[white], &none = samples.light[black];
    const std::array<size_t, 3> all{own, beside, opposite};
    if (full.empty() || none.empty() ||
        std::ranges::any_of(all, [&](size_t f) { return samples.light[f].empty(); }))
      continue;
    for (size_t lane = 0; lane < samples.lane_count(); ++lane) {
      const float lit = full[lane] - none[lane];
      if (!compared.beside[samples.pixel_of(lane)] || !(lit > kMinLit)) continue;
      const auto of_white = [&](size_t f) { return (samples.light[f][lane] - none[lane]) / lit; };
      const float next = of_white(beside), last = of_white(opposite);
      const auto is_open = [](float light) { return !(light < kIsDark || light > kIsLit); };
      if (!(of_white(own) < kIsDark) || is_open(next) || is_open(last)) continue;
      const auto band = static_cast<size_t>(samples.pixels[samples.pixel_of(lane)].y) * kBands /
                        static_cast<size_t>(height);
      dark[band][last > kIsLit ? 1 : 0][next > kIsLit ? 1 : 0].push_back(of_white(own));
    }
  }
  std::vector<double> shares;
  for (const DarkSamples& band : dark) {
    double sum = 0.0, count = 0.0;
    for (const auto& [stays_dark, gets_lit] : band) {
      if (stays_dark.size() < kMinDarkSamples || gets_lit.size() < kMinDarkSamples) continue;
      sum += static_cast<double>(median(gets_lit) - median(stays_dark));
      count += 1.0;
    }
    if (count == 0.0) return {};
    shares.push_back(sum / count);
  }
  return shares;
}

}  // namespace

std::vector<std::string> second_step_warnings(const v1::CaptureManifest& manifest,
                                              const ComparedFrames& compared) {
  const std::vector<int> order = by_time(manifest);
  std::vector<std::string> warnings;
  for (const bool next : {true, false}) {
    std::vector<double> shares = shares_of(manifest, compared, order, next ? 1 : -1);
    if (shares.empty()) continue;
    if (!next) std::ranges::reverse(shares);  // from the rows that show least
    // A picture that is left everywhere is a ghost (frame_report.h).
    const double usual = shares.front();
    for (double& share : shares) share -= usual;
    if (!(shares.back() > std::max(kMinSecondStep, std::abs(usual)))) continue;
    const auto count = std::ranges::count_if(shares, [](double share) { return share > kMinSecondStep; });
    const int height = manifest.camera().height_px();
    warnings.push_back(fmt::format(
        "the {0} {1} of {2} rows of frames show the {3} picture, too, {4:.0f} % of it in the {0} ones: a "
        "rolling shutter that is open while the picture changes; show each picture longer, or reduce the "
        "exposure",
        next ? "last" : "first", count * height / static_cast<std::ptrdiff_t>(kBands), height,
        next ? "next" : "previous", 100.0 * shares.back()));
  }
  return warnings;
}

}  // namespace glasswing
