#include "solver/fringe/fringe_method.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/method/methods.h"
#include "solver/fringe/fringe_solver.h"

namespace glasswing {
namespace {

class PreparedFringe final : public PreparedMethod {
 public:
  PreparedFringe(v1::MatteMetadata metadata, FringeLayout layout, int max_modes, double tolerance,
                 double silhouette_tolerance)
      : metadata_(std::move(metadata)),
        layout_(std::move(layout)),
        max_modes_(max_modes),
        tolerance_(tolerance),
        silhouette_tolerance_(silhouette_tolerance),
        needed_(frames_of(layout_)) {}

  const std::vector<int>& frames_needed() const override { return needed_; }

  absl::StatusOr<Matte> solve(const FrameStack& rows) const override {
    Matte matte = blank_matte(rows, metadata_, max_modes_ * static_cast<int>(layout_.object.size()));
    FringeSolver solver(rows, layout_, max_modes_, tolerance_, silhouette_tolerance_);
    for (int y = 0; y < rows.row_count; ++y) solver.solve_row(y, matte);
    return matte;
  }

 private:
  const v1::MatteMetadata metadata_;
  const FringeLayout layout_;
  const int max_modes_;  // per channel and monitor
  const double tolerance_;
  const double silhouette_tolerance_;
  const std::vector<int> needed_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Method>> FringeMethod::create(const MethodOptions& options) {
  GW_ASSIGN_OR_RETURN(const OptionValues values, OptionValues::read("fringe", options));
  auto method = std::make_unique<FringeMethod>();
  method->options_ = options;
  method->modes_ = values.whole("modes");
  method->tolerance_ = values.number("tolerance");
  method->silhouette_tolerance_ = values.number("silhouette_tolerance");
  return method;
}

absl::StatusOr<std::unique_ptr<PreparedMethod>> FringeMethod::prepare(
    const v1::CaptureManifest& manifest) const {
  GW_ASSIGN_OR_RETURN(FringeLayout layout, lay_out_fringes(manifest));
  const int monitors = static_cast<int>(layout.object.size());
  if (monitors > kMaxModes) {
    return absl::FailedPreconditionError(
        fmt::format("{} monitors showed sinusoids; at most {} can be solved", monitors, kMaxModes));
  }
  return std::make_unique<PreparedFringe>(metadata_of(manifest, "fringe", options_), std::move(layout),
                                          std::min(modes_, kMaxModes / monitors), tolerance_,
                                          silhouette_tolerance_);
}

}  // namespace glasswing
