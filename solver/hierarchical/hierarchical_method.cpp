#include "solver/hierarchical/hierarchical_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/base/status.h"
#include "core/pattern/method_options.h"
#include "solver/hierarchical/box_solver.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<Method>> HierarchicalMethod::create(const MethodOptions& options) {
  auto method = std::make_unique<HierarchicalMethod>();
  method->options_ = options;
  for (const auto& [key, value] : options) {
    if (key == "partial_cover") {
      if (value != "0" && value != "1")
        return absl::InvalidArgumentError(fmt::format("{} is \"{}\"; it must be 0 or 1", key, value));
      method->partial_cover_ = value == "1";
    } else if (key == "silhouette_tolerance") {
      GW_ASSIGN_OR_RETURN(method->silhouette_tolerance_, number_option(key, value, 0.0, 1.0));
    } else {
      return unknown_option("hierarchical", key);
    }
  }
  return method;
}

absl::StatusOr<std::vector<int>> HierarchicalMethod::frames_needed(
    const v1::CaptureManifest& manifest) const {
  GW_ASSIGN_OR_RETURN(const BoxLayout layout, lay_out_boxes(manifest));
  const std::vector<int> stage = frames_of(layout.stage, manifest);
  std::set<int> needed(stage.begin(), stage.end());
  for (const BoxMonitor& monitor : layout.monitors) {
    for (const BoxPattern& pattern : monitor.patterns) {
      for (const ExposedFrame& exposed : pattern.shot) needed.insert(exposed.frame);
    }
  }
  return std::vector<int>(needed.begin(), needed.end());
}

absl::StatusOr<Matte> HierarchicalMethod::solve(const FrameStack& stack) const {
  GW_ASSIGN_OR_RETURN(const BoxLayout layout, lay_out_boxes(stack.manifest));
  GW_ASSIGN_OR_RETURN(const std::vector<int> needed, frames_needed(stack.manifest));
  GW_RETURN_IF_ERROR(check_rows(stack, needed));
  // A box each, and what lies straight behind where the empty stage was taken.
  const bool straight = partial_cover_ && !layout.stage.pairs.empty();
  const int boxes = static_cast<int>(layout.monitors.size());
  Matte matte =
      blank_matte(stack, "hierarchical", options_, std::min(straight ? 2 * boxes : boxes, kMaxModes));
  matte.metadata.set_footprint(std::string(kBoxFootprint));
  for (const std::string& warning : layout.warnings) matte.metadata.add_warnings(warning);
  BoxSolver solver(stack, layout, straight, silhouette_tolerance_);
  for (int y = 0; y < stack.row_count; ++y) solver.solve_row(y, matte);
  return matte;
}

}  // namespace glasswing
