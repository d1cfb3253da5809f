// The words for a node that prepares.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "glasswing/v1/node_service.pb.h"

namespace glasswing {

// "simulating the scene, 37 %"
inline std::string preparation_text(const v1::Preparation& preparation) {
  if (!preparation.has_done()) return preparation.what();
  return fmt::format("{}, {:.0f} %", preparation.what(), std::floor(100.0 * preparation.done()));
}

}  // namespace glasswing
