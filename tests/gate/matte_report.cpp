#include "tests/gate/matte_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace glasswing::gate {
namespace {

MatteReport::Quantiles quantiles_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const auto at = [&](double part) {
    return values[static_cast<size_t>(part * static_cast<double>(values.size() - 1))];
  };
  return {.median = at(0.5), .most = at(0.99), .max = values.back()};
}

bool lies_on(const Mode& mode, const v1::MatteMetadata& metadata) {
  const v1::Monitor& monitor = metadata.monitors(mode.texture);
  return mode.x_px >= 0.0f && mode.y_px >= 0.0f && mode.x_px <= static_cast<float>(monitor.width_px()) &&
         mode.y_px <= static_cast<float>(monitor.height_px());
}

// Sums over lanes.
struct Sums {
  std::vector<double> sigmas, stated, errors;
  double unknown = 0.0, places = 0.0, one = 0.0, two = 0.0, squares = 0.0;
  double weights = 0.0, weight_one = 0.0, weight_squares = 0.0;
  double truths = 0.0;
};

// Holds the strongest mode against the true one that lies nearest.
void compare(const Mode& mode, const std::vector<TrueMode>& truth, Sums& sums) {
  const TrueMode* nearest = nullptr;
  double least = INFINITY;
  for (const TrueMode& own : truth) {
    const double distance =
        std::hypot(static_cast<double>(mode.x_px) - own.x_px, static_cast<double>(mode.y_px) - own.y_px);
    // Faint light nearby is not what the strongest mode is about.
    if (own.texture != mode.texture || own.weight < 0.3 * truth.front().weight || distance >= least) continue;
    least = distance, nearest = &own;
  }
  if (nearest == nullptr) return;
  for (const double error :
       {static_cast<double>(mode.x_px) - nearest->x_px, static_cast<double>(mode.y_px) - nearest->y_px}) {
    sums.errors.push_back(std::abs(error));
    if (mode.centre_sd_px <= 0.0f) continue;
    const double z = error / static_cast<double>(mode.centre_sd_px);
    ++sums.places;
    sums.one += std::abs(z) < 1.0, sums.two += std::abs(z) < 2.0;
    sums.squares += z * z;
  }
  if (mode.weight_sd <= 0.0f || truth.size() > 1) return;
  const double z = (static_cast<double>(mode.weight) - nearest->weight) / static_cast<double>(mode.weight_sd);
  ++sums.weights;
  sums.weight_one += std::abs(z) < 1.0;
  sums.weight_squares += z * z;
}

void add_lane(const Matte& matte, int x, int y, int channel, const Truth& truth, MatteReport& report,
              Sums& sums) {
  ++report.lanes;
  size_t count = 0;
  double phantom = 0.0;
  for (const Mode& mode : matte.modes(x, y, channel)) {
    if (mode.weight == 0.0f) continue;
    ++count;
    if (!lies_on(mode, matte.metadata) && mode.weight < mode.weight_sd)
      phantom += static_cast<double>(mode.weight);
  }
  report.with_modes[count] += 1.0;
  if (matte.flags(x, y) == 0) report.phantoms += phantom > 0.0, report.phantom_light += phantom;
  const std::vector<TrueMode> own = truth ? truth(x, y, channel) : std::vector<TrueMode>{};
  if (!own.empty())
    report.truly_with[std::min(own.size(), report.truly_with.size() - 1)] += 1.0, ++sums.truths;
  if (count == 0) return;
  const Mode& strongest = matte.modes(x, y, channel)[0];
  sums.sigmas.push_back(std::sqrt(0.5 * static_cast<double>(strongest.xx_px2 + strongest.yy_px2)));
  if (strongest.centre_sd_px > 0.0f)
    sums.stated.push_back(static_cast<double>(strongest.centre_sd_px));
  else
    ++sums.unknown;
  if (matte.flags(x, y) == 0 && own.size() == count) compare(strongest, own, sums);
}

double many_of(const std::array<double, 9>& shares) {
  double sum = 0.0;
  for (size_t count = 2; count < shares.size(); ++count) sum += shares[count];
  return sum;
}

}  // namespace

double MatteReport::many() const {
  return many_of(with_modes);
}

double MatteReport::truly_many() const {
  return many_of(truly_with);
}

MatteReport report_on(const Matte& matte, const Truth& truth, int channel) {
  MatteReport report;
  Sums sums;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      if (matte.coverage(x, y) == 0.0f) continue;
      ++report.object;
      const auto flag = [&](int bit) { return (matte.flags(x, y) & bit) != 0 ? 1 : 0; };
      report.flagged += matte.flags(x, y) != 0;
      report.not_converged += flag(kFlagNotConverged), report.saturated += flag(kFlagSaturated);
      report.poor_fit += flag(kFlagPoorFit), report.no_data += flag(kFlagNoData);
      for (int c = 0; c < kChannels; ++c) {
        if (channel < 0 || c == channel) add_lane(matte, x, y, c, truth, report, sums);
      }
    }
  }
  const double lanes = std::max(report.lanes, 1);
  for (double& share : report.with_modes) share /= lanes;
  for (double& share : report.truly_with) share /= std::max(sums.truths, 1.0);
  report.phantom_light /= lanes;
  report.unknown = sums.unknown / lanes;
  report.sigma_px = quantiles_of(sums.sigmas);
  report.centre_sd_px = quantiles_of(sums.stated);
  report.error_px = quantiles_of(sums.errors);
  const double places = std::max(sums.places, 1.0), weights = std::max(sums.weights, 1.0);
  report.within_one = sums.one / places, report.within_two = sums.two / places;
  report.rms_z = std::sqrt(sums.squares / places);
  report.weight_within_one = sums.weight_one / weights;
  report.weight_rms_z = std::sqrt(sums.weight_squares / weights);
  return report;
}

std::string MatteReport::text() const {
  const auto line = [](const char* name, const Quantiles& own) {
    return fmt::format("{}: median {:.4f}, 99 % {:.4f}, max {:.4g} px\n", name, own.median, own.most,
                       own.max);
  };
  std::string text = fmt::format(
      "{} of {} object pixels flagged (not converged {}, saturated {}, poor fit {}, no data {})\n"
      "{} of {} lanes with phantom light, {:.5f} a lane\nmodes:",
      flagged, object, not_converged, saturated, poor_fit, no_data, phantoms, lanes, phantom_light);
  for (size_t i = 0; i < with_modes.size(); ++i) {
    if (with_modes[i] > 0.0 || truly_with[i] > 0.0)
      text += fmt::format(" {}: {:.1f} % ({:.1f} %)", i, 100.0 * with_modes[i], 100.0 * truly_with[i]);
  }
  text += fmt::format("\n{}{}{}", line("sigma", sigma_px), line("stated error", centre_sd_px),
                      line("true error", error_px));
  return text + fmt::format(
                    "unknown errors {:.2f} %; within one {:.3f}, two {:.3f}, rms z {:.2f}; weights {:.3f}, "
                    "rms z {:.2f}\n",
                    100.0 * unknown, within_one, within_two, rms_z, weight_within_one, weight_rms_z);
}

}  // namespace glasswing::gate
