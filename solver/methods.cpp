#include "solver/methods.h"

#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "solver/alpha/alpha_method.h"
#include "solver/fringe/fringe_method.h"
#include "solver/gaussian/gaussian_method.h"
#include "solver/hierarchical/hierarchical_method.h"
#include "solver/ramp/ramp_method.h"

namespace glasswing {

namespace {

using Create = absl::StatusOr<std::unique_ptr<Method>> (*)(const MethodOptions& options);

// Of the table in core/method/methods.cpp, those that solve stills.
constexpr std::pair<std::string_view, Create> kStills[] = {{"gaussian", GaussianMethod::create},
                                                           {"hierarchical", HierarchicalMethod::create},
                                                           {"fringe", FringeMethod::create},
                                                           {"alpha", AlphaMethod::create}};

}  // namespace

absl::StatusOr<std::unique_ptr<Method>> make_method(const std::string& name, const MethodOptions& options) {
  for (const auto& [method, create] : kStills) {
    if (method == name) return create(options);
  }
  return check_method(name);  // lists the methods
}

absl::StatusOr<std::unique_ptr<VideoMethod>> make_video_method(const std::string& name,
                                                               const MethodOptions& options) {
  if (name == kRampMethod) return RampMethod::create(options);
  return nullptr;
}

}  // namespace glasswing
