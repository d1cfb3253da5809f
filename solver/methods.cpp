#include "solver/methods.h"

#include "core/pattern/method_options.h"
#include "core/pattern/plan.h"
#include "solver/alpha/alpha_method.h"
#include "solver/fringe/fringe_method.h"
#include "solver/gaussian/gaussian_method.h"
#include "solver/hierarchical/hierarchical_method.h"
#include "solver/ramp/ramp_method.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<Method>> make_method(const std::string& name, const MethodOptions& options) {
  if (name == "gaussian") return GaussianMethod::create(options);
  if (name == "hierarchical") return HierarchicalMethod::create(options);
  if (name == "fringe") return FringeMethod::create(options);
  if (name == "alpha") return AlphaMethod::create(options);
  return check_method(name);  // lists the methods
}

absl::StatusOr<std::unique_ptr<VideoMethod>> make_video_method(const std::string& name,
                                                               const MethodOptions& options) {
  if (name == kRampMethod) return RampMethod::create(options);
  return nullptr;
}

}  // namespace glasswing
