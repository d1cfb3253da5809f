#include "solver/mixture/mixture_method.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/method/exposure_merge.h"
#include "solver/mixture/mixture_solver.h"

namespace glasswing {
namespace {

class PreparedMixture final : public PreparedMethod {
 public:
  PreparedMixture(v1::MatteMetadata metadata, MixtureLayout layout, int max_modes, int stored_modes,
                  double silhouette_tolerance)
      : metadata_(std::move(metadata)),
        layout_(std::move(layout)),
        tables_(layout_),
        max_modes_(max_modes),
        stored_modes_(stored_modes),
        silhouette_tolerance_(silhouette_tolerance),
        needed_(frames_of(layout_)) {}

  const std::vector<int>& frames_needed() const override { return needed_; }

  absl::StatusOr<Matte> solve(const FrameStack& rows) const override {
    Matte matte = blank_matte(rows, metadata_, stored_modes_);
    MixtureSolver solver(rows, layout_, tables_, max_modes_, silhouette_tolerance_);
    for (int y = 0; y < rows.row_count; ++y) solver.solve_row(y, matte);
    return matte;
  }

 private:
  const v1::MatteMetadata metadata_;
  const MixtureLayout layout_;
  const MixtureTables tables_;
  const int max_modes_, stored_modes_;
  const double silhouette_tolerance_;
  const std::vector<int> needed_;
};

}  // namespace

bool shows_sinusoids(const v1::CaptureManifest& manifest) {
  return std::ranges::any_of(manifest.frames(), [](const v1::Frame& frame) {
    return is_pattern(frame) && frame.object() && kind_of(frame.stimulus()) == StimulusKind::kSinusoid;
  });
}

absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare_mixture(const v1::CaptureManifest& manifest,
                                                                v1::MatteMetadata metadata,
                                                                const MixtureLimits& limits) {
  GW_ASSIGN_OR_RETURN(MixtureLayout layout, lay_out_mixture(manifest));
  name_samples(layout, metadata);
  const int monitors = static_cast<int>(layout.monitors.size());
  if (monitors > kMaxModes) {
    return absl::FailedPreconditionError(
        fmt::format("{} monitors showed patterns; at most {} can be solved", monitors, kMaxModes));
  }
  const int each = std::min(limits.max_modes, kMaxFootprints);
  const int stored = std::max(std::min(limits.max_modes, kMaxFootprints * monitors), monitors);
  return std::make_unique<PreparedMixture>(std::move(metadata), std::move(layout), each, stored,
                                           limits.silhouette_tolerance);
}

}  // namespace glasswing
