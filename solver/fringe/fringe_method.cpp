#include "solver/fringe/fringe_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "core/base/status.h"
#include "solver/fringe/fringe_solver.h"

namespace glasswing {
namespace {

absl::StatusOr<double> number_of(const std::string& key, const std::string& value, double low, double high) {
  char* end = nullptr;
  const double number = std::strtod(value.c_str(), &end);
  if (value.empty() || *end != '\0' || !(number >= low && number <= high)) {
    return absl::InvalidArgumentError(
        fmt::format("{} is \"{}\"; it must be {} to {}", key, value, low, high));
  }
  return number;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Method>> FringeMethod::create(const MethodOptions& options) {
  auto method = std::make_unique<FringeMethod>();
  method->options_ = options;
  for (const auto& [key, value] : options) {
    if (key == "modes") {
      GW_ASSIGN_OR_RETURN(const double modes, number_of(key, value, 1, kMaxModes));
      method->modes_ = static_cast<int>(modes);
    } else if (key == "tolerance") {
      GW_ASSIGN_OR_RETURN(method->tolerance_, number_of(key, value, 0.0, 0.5));
    } else if (key == "silhouette_tolerance") {
      GW_ASSIGN_OR_RETURN(method->silhouette_tolerance_, number_of(key, value, 0.0, 1.0));
    } else {
      return absl::InvalidArgumentError(fmt::format(
          "option \"{}\" is not known to fringe; it has: modes, silhouette_tolerance, tolerance", key));
    }
  }
  return method;
}

absl::StatusOr<std::vector<int>> FringeMethod::frames_needed(const v1::CaptureManifest& manifest) const {
  GW_ASSIGN_OR_RETURN(const FringeLayout layout, lay_out_fringes(manifest));
  return frames_of(layout, manifest);
}

absl::StatusOr<Matte> FringeMethod::solve(const FrameStack& stack) const {
  GW_ASSIGN_OR_RETURN(const FringeLayout layout, lay_out_fringes(stack.manifest));
  GW_RETURN_IF_ERROR(check_rows(stack, frames_of(layout, stack.manifest)));
  const int monitors = static_cast<int>(layout.object.size());
  if (monitors > kMaxModes) {
    return absl::FailedPreconditionError(
        fmt::format("{} monitors showed sinusoids; at most {} can be solved", monitors, kMaxModes));
  }
  const int most = std::min(modes_, kMaxModes / monitors);
  Matte matte(0, stack.first_row, stack.manifest.camera().width_px(), stack.row_count, most * monitors);
  v1::MatteMetadata& metadata = matte.metadata;
  metadata.set_format_version(1);
  metadata.set_session(stack.manifest.session());
  metadata.set_method("fringe");
  for (const auto& [key, value] : options_) (*metadata.mutable_options())[key] = value;
  *metadata.mutable_monitors() = stack.manifest.monitors();
  metadata.set_width_px(stack.manifest.camera().width_px());
  metadata.set_height_px(stack.manifest.camera().height_px());
  metadata.set_generator("glasswing");
  FringeSolver solver(stack, layout, most, tolerance_, silhouette_tolerance_);
  for (int y = 0; y < stack.row_count; ++y) solver.solve_row(y, matte);
  return matte;
}

}  // namespace glasswing
