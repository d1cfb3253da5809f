#include "core/design/wave_ladder.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kLonger = 1.1;  // than the monitor
constexpr double kAlongShare = 3.0, kSlantedShare = 2.0;
constexpr double kSlantedLength = 1.0 / 3.0;

bool slanted(double phi_deg) {
  return std::abs(std::remainder(phi_deg, 90.0)) > 1.0;
}

}  // namespace

std::vector<DesignedWave> wave_ladder(const MonitorExtent& extent, std::span<const double> phi_deg, int count,
                                      double shortest_px) {
  std::vector<double> share;
  for (const double phi : phi_deg) share.push_back(slanted(phi) ? kSlantedShare : kAlongShare);
  // Each wave goes to the direction furthest below its share.
  std::vector<int> counts(phi_deg.size(), 0);
  for (int i = 0; i < count; ++i) {
    size_t next = 0;
    for (size_t d = 1; d < counts.size(); ++d) {
      if ((counts[d] + 1) / share[d] < (counts[next] + 1) / share[next] - 1e-9) next = d;
    }
    ++counts[next];
  }
  std::vector<DesignedWave> waves;
  for (size_t d = 0; d < counts.size(); ++d) {
    const double phi_rad = phi_deg[d] * std::numbers::pi / 180.0;
    const double length_px =
        std::abs(extent.width_px * std::cos(phi_rad)) + std::abs(extent.height_px * std::sin(phi_rad));
    const double longest_px =
        std::max(kLonger * length_px * (slanted(phi_deg[d]) ? kSlantedLength : 1.0), shortest_px);
    for (int k = 0; k < counts[d]; ++k) {
      const double part = counts[d] > 1 ? static_cast<double>(k) / (counts[d] - 1) : 1.0;
      const double period_px = longest_px * std::pow(shortest_px / longest_px, part);
      waves.push_back({.phi_deg = phi_deg[d], .period_px = std::round(100.0 * period_px) / 100.0});
    }
  }
  return waves;
}

google::protobuf::RepeatedPtrField<v1::Fringes> fringes_of(std::span<const DesignedWave> waves) {
  google::protobuf::RepeatedPtrField<v1::Fringes> all;
  for (const DesignedWave& wave : waves) {
    if (all.empty() || all.rbegin()->orientation_deg() != wave.phi_deg) {
      v1::Fringes& fringes = *all.Add();
      fringes.set_orientation_deg(wave.phi_deg);
      fringes.set_phases(2);
      fringes.set_object_only(true);
    }
    all.rbegin()->add_period_px(wave.period_px);
  }
  return all;
}

}  // namespace glasswing
