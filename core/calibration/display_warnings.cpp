#include "core/calibration/display_warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace glasswing {
namespace {

constexpr double kMaxExcess = 0.005;   // of white over the sum of primaries
constexpr double kMaxDrift = 0.01;     // of white
constexpr double kMaxFlicker = 0.003;  // of white
constexpr double kMaxFlickers = 5.0;   // range of some dozens of whites that only flicker
constexpr double kMinUse = 0.2;        // of the camera's full scale, white's light
constexpr double kMaxBlack = 0.01;     // of white
constexpr double kErrors = 3.0;        // standard errors that a warning needs

// Two grays are equally bright if their step is less than a tenth of the power law's, where that exceeds 5
// standard errors and 0.05 % of full scale.
constexpr double kMaxFlatStep = 0.1, kMinStepErrors = 5.0, kMinStep = 5e-4;

constexpr std::array<const char*, 3> kNames{"red", "green", "blue"};

// The radiance of a gray of one primary, with its variance.
struct Gray {
  double radiance = 0.0, variance = 0.0, count = 0.0;
};
std::map<int, Gray> grays_of(const std::vector<ShownSolid>& solids, const DisplayResponse& response,
                             size_t p) {
  double square = 0.0;
  for (size_t c = 0; c < 3; ++c) square += response.crosstalk[c][p] * response.crosstalk[c][p];
  std::map<int, Gray> grays;
  for (const ShownSolid& solid : solids) {
    const bool others = std::any_of(solid.code.begin(), solid.code.end(),
                                    [&](const int& code) { return code != 0 && &code != &solid.code[p]; });
    if (others) continue;
    Gray& gray = grays[solid.code[p]];
    gray.count += 1.0;
    for (size_t c = 0; c < 3; ++c) {
      const double weight = response.crosstalk[c][p] / square;
      gray.radiance += weight * (solid.light[c] - response.black[c]);
      gray.variance += weight * weight * solid.error[c] * solid.error[c];
    }
  }
  for (auto& [code, gray] : grays) {
    gray.radiance /= gray.count;
    gray.variance /= gray.count * gray.count;
  }
  return grays;
}

// A range of codes that are equally bright.
struct Level {
  int first = 0, last = 0;
};
std::vector<Level> level_codes(const std::map<int, Gray>& grays, double gamma, int highest) {
  std::vector<Level> levels;
  const auto power = [&](int code) { return std::pow(static_cast<double>(code) / highest, gamma); };
  for (auto next = std::next(grays.begin()); next != grays.end(); ++next) {
    const auto last = std::prev(next);
    const double expected = power(next->first) - power(last->first);
    const double error = std::sqrt(next->second.variance + last->second.variance);
    if (expected < kMinStep || expected < kMinStepErrors * error) continue;
    if (next->second.radiance - last->second.radiance > kMaxFlatStep * expected) continue;
    if (levels.empty() || levels.back().last != last->first) levels.push_back({.first = last->first});
    levels.back().last = next->first;
  }
  return levels;
}

std::optional<std::string> warning_of_levels(const std::vector<Level>& levels, const std::string& primary,
                                             int bits) {
  if (levels.empty()) return std::nullopt;
  const int highest = (1 << bits) - 1;
  const bool cut_dark = levels.front().first == 0, cut_bright = levels.back().last == highest;
  if (levels.size() > static_cast<size_t>(cut_dark) + static_cast<size_t>(cut_bright)) {
    return fmt::format(
        "{}: codes {} to {} are equally bright, and {} more such steps: does the monitor, its cable or its "
        "driver carry fewer bits than {}?",
        primary, levels.front().first, levels.front().last, levels.size() - 1, bits);
  }
  std::string which;
  if (cut_dark) which = fmt::format("{} to {} are equally dark", 0, levels.front().last);
  if (cut_bright) {
    which +=
        fmt::format("{}{} to {} are equally bright", cut_dark ? ", and " : "", levels.back().first, highest);
  }
  return fmt::format(
      "{}: codes {}: set the monitor's input to full range, and contrast and brightness to their defaults",
      primary, which);
}

}  // namespace

std::vector<std::string> display_warnings(const v1::DisplayCalibration& calibration,
                                          const std::vector<ShownSolid>& solids,
                                          const DisplayResponse& response, double flicker) {
  std::vector<std::string> warnings;
  const int highest = (1 << calibration.bits()) - 1;
  const double code = highest;
  const std::array<double, 3> white = response.light({code, code, code});

  double residual = 0.0;
  for (const ToneFit& fit : response.primary) residual = std::hypot(residual, fit.residual_rms);
  const double excess = response.excess_of_white.value_or(0.0);
  if (std::abs(excess) > std::max(kMaxExcess, kErrors * residual)) {
    warnings.push_back(fmt::format(
        "white is {:.1f} % {} than its primaries together: switch off the camera's automatic exposure and "
        "gain, and the monitor's dynamic contrast and energy saving; a monitor with a white primary cannot "
        "be calibrated well",
        100.0 * std::abs(excess), excess > 0.0 ? "brighter" : "darker"));
  }
  if (calibration.drift() > std::max(kMaxDrift, kMaxFlickers * flicker)) {
    warnings.push_back(
        fmt::format("white changed by {:.1f} % while it was measured, which was taken out: let the monitor "
                    "warm up for half an hour",
                    100.0 * calibration.drift()));
  }
  if (flicker > kMaxFlicker) {
    warnings.push_back(fmt::format(
        "white differs by {:.1f} % from one time to the next: the monitor flickers, so make the exposure a "
        "multiple of its refresh; or the camera's automatic settings are on",
        100.0 * flicker));
  }
  if (const double brightest = *std::max_element(white.begin(), white.end()); brightest < kMinUse) {
    warnings.push_back(fmt::format(
        "white reads only {:.1f} % of the camera's full scale at {:.4g} ms: use an exposure of "
        "about {:.2g} ms",
        100.0 * brightest, calibration.exposure_ms(), 0.7 / brightest * calibration.exposure_ms()));
  }
  double black = 0.0;
  for (size_t c = 0; c < 3; ++c) black = std::max(black, response.black[c] / white[c]);
  if (black > kMaxBlack) {
    warnings.push_back(fmt::format(
        "black is {:.1f} % of white: darken the room, lower the monitor's brightness setting, or calibrate "
        "the camera if it is not calibrated",
        100.0 * black));
  }
  for (size_t p = 0; p < 3; ++p) {
    const auto levels = level_codes(grays_of(solids, response, p), response.primary[p].gamma, highest);
    if (auto warning = warning_of_levels(levels, kNames[p], calibration.bits()))
      warnings.push_back(*std::move(warning));
  }
  if (!calibration.has_uniformity()) {
    warnings.emplace_back("the camera sees less than half of the screen, so its uniformity was not measured");
  }
  return warnings;
}

}  // namespace glasswing
