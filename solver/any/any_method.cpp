#include "solver/any/any_method.h"

#include <algorithm>
#include <deque>
#include <iterator>
#include <mutex>
#include <utility>

#include "core/base/status.h"
#include "solver/any/pyramid_solver.h"

namespace glasswing {
namespace {

class PreparedAny final : public PreparedMethod {
 public:
  PreparedAny(std::unique_ptr<PreparedMethod> gaussian, MixtureLayout layout)
      : gaussian_(std::move(gaussian)), layout_(std::move(layout)) {
    for (const MixtureMonitor& monitor : layout_.monitors)
      patterns_.emplace_back(answers_.emplace_back(monitor.patterns, monitor.extent));
    const std::vector<int> own = frames_of(layout_);
    std::ranges::set_union(gaussian_->frames_needed(), own, std::back_inserter(needed_));
  }

  const std::vector<int>& frames_needed() const override { return needed_; }

  absl::StatusOr<Matte> solve(const FrameStack& rows) const override {
    GW_ASSIGN_OR_RETURN(Matte matte, gaussian_->solve(rows));
    matte.metadata.set_footprint(std::string(kPyramidFootprint));
    std::vector<PyramidFitter> fitters = free_fitters();
    PyramidSolver solver(rows, layout_, patterns_, fitters);
    for (int y = 0; y < rows.row_count; ++y) {
      for (int x = 0; x < matte.width_px(); ++x) solver.refine(x, y, matte);
    }
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(fitters));
    return matte;
  }

 private:
  // Those of a thread that has ended its rows, or new ones.
  std::vector<PyramidFitter> free_fitters() const {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return {patterns_.begin(), patterns_.end()};
    std::vector<PyramidFitter> last = std::move(free_.back());
    free_.pop_back();
    return last;
  }

  const std::unique_ptr<PreparedMethod> gaussian_;
  const MixtureLayout layout_;
  std::deque<PatternAnswers> answers_;
  std::deque<PatternLanes> patterns_;  // of the answers
  std::vector<int> needed_;
  mutable std::mutex mutex_;
  mutable std::vector<std::vector<PyramidFitter>> free_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<PreparedMethod>> with_pyramids(std::unique_ptr<PreparedMethod> gaussian,
                                                              const v1::CaptureManifest& manifest) {
  if (!manifest.camera().mosaic().empty()) {
    return absl::FailedPreconditionError(
        "footprints=any needs all colours of each pixel; this camera's mosaic measured one");
  }
  GW_ASSIGN_OR_RETURN(MixtureLayout layout, lay_out_mixture(manifest));
  return std::make_unique<PreparedAny>(std::move(gaussian), std::move(layout));
}

}  // namespace glasswing
