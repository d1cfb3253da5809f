#include "solver/gaussian/gaussian_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "core/base/status.h"
#include "core/footprint/matte_covariance.h"
#include "core/method/methods.h"
#include "solver/any/any_method.h"
#include "solver/gaussian/fewer_images.h"
#include "solver/gaussian/stack_solver.h"
#include "solver/mixture/mixture_method.h"

namespace glasswing {
namespace {

// Keeps only the widths along x and y.
void forget_orientation(Matte& matte) {
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      for (int c = 0; c < kChannels; ++c) {
        for (Mode& mode : matte.modes(x, y, c)) mode.xy_px2 = 0.0f;
      }
    }
  }
}

struct GaussianLimits {
  int max_modes = kMaxFootprints;  // of a channel on one monitor
  int stored_modes = kMaxModes;    // of a channel, at least one for each monitor
  bool oriented = true;
  double silhouette_tolerance = 0.0;
};

// For the errors of composites. Frames that are sums of others share their noise, so for those they are
// unknown.
void name_samples(const StackLayout& layout, v1::MatteMetadata& metadata) {
  for (const SweepLayout& sweep : layout.sweeps) {
    v1::StripeSweep& named = *metadata.add_sweeps();
    named.set_texture(sweep.texture);
    named.set_phi_deg(sweep.phi_deg);
    named.set_sigma_px(sweep.sigma_px);
    named.set_first_r_px(sweep.r_px.front());
    named.set_last_r_px(sweep.r_px.back());
    named.set_count(static_cast<int>(sweep.r_px.size()));
  }
  for (size_t t = 0; t < layout.areas.size(); ++t) {
    for (const AreaFrames& area : layout.areas[t]) {
      *metadata.add_lit_pictures() =
          lit_picture(static_cast<int>(t), area.lit, area.light, static_cast<int>(area.shot.size()));
    }
  }
}

class PreparedGaussian final : public PreparedMethod {
 public:
  // `capture`: the synthesized frames that the layout refers to; without it, the recorded ones.
  PreparedGaussian(v1::MatteMetadata metadata, StackLayout layout, std::optional<SynthesizedCapture> capture,
                   const GaussianLimits& limits)
      : metadata_(std::move(metadata)),
        layout_(std::move(layout)),
        monitors_(swept_monitors(layout_)),
        capture_(std::move(capture)),
        limits_(limits),
        solved_(frames_of(layout_)),
        needed_(capture_ ? frames_of(*capture_, solved_) : solved_) {}

  const std::vector<int>& frames_needed() const override { return needed_; }

  absl::StatusOr<Matte> solve(const FrameStack& rows) const override {
    return capture_ ? solve_laid_out(synthesized_stack(rows, *capture_, solved_)) : solve_laid_out(rows);
  }

 private:
  Matte solve_laid_out(const FrameStack& stack) const {
    Matte matte = blank_matte(stack, metadata_, limits_.stored_modes);
    StackSolver solver(stack, layout_, monitors_, limits_.max_modes, limits_.silhouette_tolerance);
    for (int y = 0; y < stack.row_count; ++y) solver.solve_row(y, matte);
    if (!limits_.oriented) forget_orientation(matte);
    return matte;
  }

  const v1::MatteMetadata metadata_;
  const StackLayout layout_;
  const std::vector<SweptMonitor> monitors_;
  const std::optional<SynthesizedCapture> capture_;
  const GaussianLimits limits_;
  const std::vector<int> solved_;  // frames listed in the layout
  const std::vector<int> needed_;  // recorded frames to read
};

}  // namespace

absl::StatusOr<std::unique_ptr<Method>> GaussianMethod::create(const MethodOptions& options) {
  GW_ASSIGN_OR_RETURN(const OptionValues values, OptionValues::read("gaussian", options));
  auto method = std::make_unique<GaussianMethod>();
  method->options_ = options;
  method->modes_ = values.whole("modes");
  method->oriented_ = values.is_set("oriented");
  method->silhouette_tolerance_ = values.number("silhouette_tolerance");
  if (values.has("images")) method->images_ = values.whole("images");
  method->any_footprints_ = values.text("footprints") == "any";
  if (method->any_footprints_ && method->images_ != 0) {
    return absl::InvalidArgumentError(
        "footprints=any reads the recorded images; it cannot be combined with images");
  }
  return method;
}

absl::StatusOr<std::unique_ptr<PreparedMethod>> GaussianMethod::prepare(
    const v1::CaptureManifest& manifest) const {
  GW_ASSIGN_OR_RETURN(std::unique_ptr<PreparedMethod> gaussians, prepare_gaussians(manifest));
  if (!any_footprints_) return gaussians;
  return with_pyramids(std::move(gaussians), manifest);
}

absl::StatusOr<std::unique_ptr<PreparedMethod>> GaussianMethod::prepare_gaussians(
    const v1::CaptureManifest& manifest) const {
  std::optional<SynthesizedCapture> capture;
  if (images_ != 0) {
    GW_ASSIGN_OR_RETURN(capture, fewer_images(manifest, images_));
  }
  const v1::CaptureManifest& shown = capture ? capture->manifest : manifest;
  if (shows_sinusoids(shown)) {
    return prepare_mixture(manifest, metadata_of(manifest, "gaussian", options_),
                           {.max_modes = modes_, .silhouette_tolerance = silhouette_tolerance_});
  }
  GW_ASSIGN_OR_RETURN(StackLayout layout, lay_out(shown));
  std::set<int> textures;
  for (const SweepLayout& sweep : layout.sweeps) textures.insert(sweep.texture);
  const int texture_count = static_cast<int>(textures.size());
  if (texture_count > kMaxModes) {
    return absl::FailedPreconditionError(
        fmt::format("{} monitors were swept; at most {} can be solved", texture_count, kMaxModes));
  }
  const int stored = std::max(std::min(modes_, kMaxFootprints * texture_count), texture_count);
  v1::MatteMetadata metadata = metadata_of(manifest, "gaussian", options_);
  if (!capture) name_samples(layout, metadata);
  return std::make_unique<PreparedGaussian>(std::move(metadata), std::move(layout), std::move(capture),
                                            GaussianLimits{.max_modes = std::min(modes_, kMaxFootprints),
                                                           .stored_modes = stored,
                                                           .oriented = oriented_,
                                                           .silhouette_tolerance = silhouette_tolerance_});
}

}  // namespace glasswing
