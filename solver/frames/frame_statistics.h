// Criteria for the reports of frames.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "core/base/median.h"
#include "core/matte/matte.h"

namespace glasswing {

// A standard deviation, from the median distance from the median.
inline double sd_of(std::vector<double> values) {
  const double middle = median(values);
  for (double& value : values) value = std::abs(value - middle);
  return 1.4826 * median(values);
}

inline double mean_of(const std::array<double, kChannels>& values) {
  return (values[0] + values[1] + values[2]) / kChannels;
}

}  // namespace glasswing
