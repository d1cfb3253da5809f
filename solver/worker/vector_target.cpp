#include "solver/worker/vector_target.h"

#include <hwy/targets.h>

namespace glasswing {

std::string vector_target() {
  const auto usable = hwy::SupportedTargets() & HWY_TARGETS;
  return hwy::TargetName(usable & -usable);  // the best is the lowest bit
}

}  // namespace glasswing
