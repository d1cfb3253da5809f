#include "solver/method.h"

#include <fmt/format.h>

#include "solver/gaussian/gaussian_method.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<Method>> make_method(const std::string& name, const MethodOptions& options) {
  if (name == "gaussian") return GaussianMethod::create(options);
  return absl::InvalidArgumentError(fmt::format("method is \"{}\"; there is: gaussian", name));
}

}  // namespace glasswing
