#include "core/matte/fast_compositor.h"

#include "core/matte/compositor.h"

namespace glasswing {

absl::StatusOr<FastCompositor> FastCompositor::create(const Matte& matte, int) {
  return FastCompositor(matte);
}

absl::StatusOr<RadianceImage> FastCompositor::composite(const std::vector<RadianceImage>& backgrounds,
                                                        int thread_count) const {
  return glasswing::composite(matte_, backgrounds, thread_count);
}

}  // namespace glasswing
