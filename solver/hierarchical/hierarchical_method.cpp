#include "solver/hierarchical/hierarchical_method.h"

#include <algorithm>

#include "core/base/status.h"
#include "core/method/methods.h"
#include "solver/hierarchical/box_solver.h"

namespace glasswing {
namespace {

class PreparedBoxes final : public PreparedMethod {
 public:
  PreparedBoxes(v1::MatteMetadata metadata, BoxLayout layout, bool partial_cover, double silhouette_tolerance)
      : metadata_(std::move(metadata)),
        layout_(std::move(layout)),
        straight_(partial_cover && !layout_.stage.pairs.empty()),
        silhouette_tolerance_(silhouette_tolerance),
        needed_(frames_of(layout_)) {}

  const std::vector<int>& frames_needed() const override { return needed_; }

  absl::StatusOr<Matte> solve(const FrameStack& rows) const override {
    if (layout_.stage.bare) return stage_alone(rows);
    const int boxes = static_cast<int>(layout_.monitors.size());
    Matte matte = blank_matte(rows, metadata_, modes_needed(boxes, straight_));
    BoxSolver solver(rows, layout_, straight_, silhouette_tolerance_);
    for (int y = 0; y < rows.row_count; ++y) solver.solve_row(y, matte);
    return matte;
  }

 private:
  Matte stage_alone(const FrameStack& rows) const {
    const auto modes = static_cast<int>(std::min<size_t>(layout_.stage.monitors.size(), kMaxModes));
    Matte matte = blank_matte(rows, metadata_, modes);
    Surroundings surroundings(rows, layout_.stage, silhouette_tolerance_);
    for (int y = 0; y < rows.row_count; ++y) surroundings.settle_row(y, {}, matte);
    return matte;
  }

  const v1::MatteMetadata metadata_;
  const BoxLayout layout_;
  // A pixel may also show the background straight behind; needs frames of the empty stage.
  const bool straight_;
  const double silhouette_tolerance_;
  const std::vector<int> needed_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Method>> HierarchicalMethod::create(const MethodOptions& options) {
  GW_ASSIGN_OR_RETURN(const OptionValues values, OptionValues::read("hierarchical", options));
  auto method = std::make_unique<HierarchicalMethod>();
  method->options_ = options;
  method->partial_cover_ = values.is_set("partial_cover");
  method->silhouette_tolerance_ = values.number("silhouette_tolerance");
  return method;
}

absl::StatusOr<std::unique_ptr<PreparedMethod>> HierarchicalMethod::prepare(
    const v1::CaptureManifest& manifest) const {
  GW_ASSIGN_OR_RETURN(BoxLayout layout, lay_out_boxes(manifest));
  v1::MatteMetadata metadata = metadata_of(manifest, "hierarchical", options_);
  metadata.set_footprint(std::string(kBoxFootprint));
  for (const std::string& warning : layout.warnings) metadata.add_warnings(warning);
  return std::make_unique<PreparedBoxes>(std::move(metadata), std::move(layout), partial_cover_,
                                         silhouette_tolerance_);
}

}  // namespace glasswing
