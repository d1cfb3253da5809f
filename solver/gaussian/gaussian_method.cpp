#include "solver/gaussian/gaussian_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/base/status.h"
#include "core/pattern/method_options.h"
#include "solver/gaussian/fewer_images.h"
#include "solver/gaussian/stack_solver.h"

namespace glasswing {
namespace {

// Leaves the widths along x and y.
void forget_orientation(Matte& matte) {
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      for (int c = 0; c < kChannels; ++c) {
        for (Mode& mode : matte.modes(x, y, c)) mode.xy_px2 = 0.0f;
      }
    }
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<Method>> GaussianMethod::create(const MethodOptions& options) {
  auto method = std::make_unique<GaussianMethod>();
  method->options_ = options;
  for (const auto& [key, value] : options) {
    if (key == "modes") {
      GW_ASSIGN_OR_RETURN(const double modes, number_option(key, value, 1, kMaxModes));
      method->modes_ = static_cast<int>(modes);
    } else if (key == "oriented") {
      if (value != "0" && value != "1")
        return absl::InvalidArgumentError(fmt::format("oriented is \"{}\"; it must be 0 or 1", value));
      method->oriented_ = value == "1";
    } else if (key == "silhouette_tolerance") {
      GW_ASSIGN_OR_RETURN(method->silhouette_tolerance_, number_option(key, value, 0.0, 1.0));
    } else if (key == "images") {
      GW_ASSIGN_OR_RETURN(const double images, number_option(key, value, kMinImages, kMaxImages));
      method->images_ = static_cast<int>(images);
    } else {
      return unknown_option("gaussian", key);
    }
  }
  return method;
}

namespace {

absl::StatusOr<std::vector<int>> frames_to_solve(const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(const StackLayout layout, lay_out(manifest));
  const std::vector<int> stage = frames_of(layout.stage, manifest);
  std::set<int> needed(stage.begin(), stage.end());
  for (const int frame : WaveNoise(manifest).frames()) needed.insert(frame);
  for (const SweepLayout& sweep : layout.sweeps) {
    for (const Shot& shot : sweep.shots) {
      for (const ExposedFrame& exposed : shot) needed.insert(exposed.frame);
    }
  }
  return std::vector<int>(needed.begin(), needed.end());
}

}  // namespace

absl::StatusOr<std::vector<int>> GaussianMethod::frames_needed(const v1::CaptureManifest& manifest) const {
  if (images_ == 0) return frames_to_solve(manifest);
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const Fewer> fewer, fewer_of(manifest));
  return frames_of(fewer->capture, fewer->made);
}

// Every band of a solve asks for the same.
absl::StatusOr<std::shared_ptr<const GaussianMethod::Fewer>> GaussianMethod::fewer_of(
    const v1::CaptureManifest& manifest) const {
  const std::lock_guard lock(mutex_);
  std::string recorded = manifest.SerializeAsString();
  if (fewer_ != nullptr && fewer_->recorded == recorded) return fewer_;
  auto fewer = std::make_shared<Fewer>();
  fewer->recorded = std::move(recorded);
  GW_ASSIGN_OR_RETURN(fewer->capture, fewer_images(manifest, images_));
  GW_ASSIGN_OR_RETURN(fewer->made, frames_to_solve(fewer->capture.manifest));
  fewer_ = fewer;
  return fewer_;
}

absl::StatusOr<Matte> GaussianMethod::solve(const FrameStack& stack) const {
  if (images_ == 0) return solve_all(stack);
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const Fewer> fewer, fewer_of(stack.manifest));
  GW_RETURN_IF_ERROR(check_rows(stack, frames_of(fewer->capture, fewer->made)));
  return solve_all(made_stack(stack, fewer->capture, fewer->made));
}

absl::StatusOr<Matte> GaussianMethod::solve_all(const FrameStack& stack) const {
  GW_ASSIGN_OR_RETURN(const StackLayout layout, lay_out(stack.manifest));
  GW_ASSIGN_OR_RETURN(const std::vector<int> needed, frames_to_solve(stack.manifest));
  GW_RETURN_IF_ERROR(check_rows(stack, needed));
  std::set<int> textures;
  for (const SweepLayout& sweep : layout.sweeps) textures.insert(sweep.texture);
  const int texture_count = static_cast<int>(textures.size());
  if (texture_count > kMaxModes) {
    return absl::FailedPreconditionError(
        fmt::format("{} monitors were swept; at most {} can be solved", texture_count, kMaxModes));
  }
  Matte matte = blank_matte(stack, "gaussian", options_, std::max(modes_, texture_count));
  StackSolver solver(stack, layout, modes_, silhouette_tolerance_);
  for (int y = 0; y < stack.row_count; ++y) solver.solve_row(y, matte);
  if (!oriented_) forget_orientation(matte);
  return matte;
}

}  // namespace glasswing
