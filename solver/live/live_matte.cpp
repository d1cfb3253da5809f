#include "solver/live/live_matte.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "solver/ramp/video_layout.h"

namespace glasswing {
namespace {

absl::StatusOr<RampOptions> parse(const v1::LiveStart& start) {
  GW_ASSIGN_OR_RETURN(RampOptions options,
                      parse_ramp_options(MethodOptions(start.options().begin(), start.options().end())));
  options.smoothing.causal = true;
  // By default earlier frames are not used: the gain is too small for the time.
  if (!start.options().contains("smoothing_reach")) options.smoothing.reach = 0;
  return options;
}

// A stack of one frame.
FrameStack light_of(const LinearStack& light, const StreamedFrame& frame) {
  FrameStack stack;
  stack.width_px = frame.taken.width_px();
  stack.row_count = frame.taken.height_px();
  stack.rows = {*frame.samples};
  stack.owner = frame.samples;
  return light.of(std::move(stack));
}

FrameView view_of(const FrameStack& stack, const StreamedFrame& frame) {
  return {.width_px = frame.taken.width_px(),
          .height_px = frame.taken.height_px(),
          .samples = stack.rows.front(),
          .zero = stack.zero,
          .unit = stack.unit};
}

// Checks a frame from which the empty stage was averaged.
absl::Status check_still(const RampFrame& empty) {
  // Noise makes some pixels look like an object.
  constexpr double kMaxNoise = 0.05;
  const auto object = std::ranges::count_if(empty.alpha, [](float alpha) { return alpha > 0.0f; });
  const double part = static_cast<double>(object) / static_cast<double>(empty.alpha.size());
  if (part <= kMaxNoise) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("the empty stage changed while it was measured: {:.0f} % of its pixels differ from their "
                  "mean; keep the stage and its light constant and try again",
                  100.0 * part));
}

}  // namespace

absl::Status LiveMatte::check_options(const v1::LiveStart& start) {
  return parse(start).status();
}

absl::StatusOr<LiveMatte> LiveMatte::create(const v1::LiveStart& start, const v1::Camera& camera,
                                            std::span<const StreamedFrame> empties, int thread_count) {
  GW_ASSIGN_OR_RETURN(const RampOptions options, parse(start));
  v1::CaptureManifest manifest;
  *manifest.add_monitors() = start.monitor();
  *manifest.mutable_camera() = camera;
  if (start.has_camera_calibration()) *manifest.mutable_camera_calibration() = start.camera_calibration();
  v1::Frame& shown = *manifest.add_frames();
  shown.mutable_stimulus()->set_kind("ramp");
  shown.mutable_stimulus()->set_panel(start.monitor().name());
  shown.set_exposure_ms(start.exposure_ms());
  GW_ASSIGN_OR_RETURN(LinearStack light, LinearStack::create(manifest));

  // The manifest lists one frame, and all frames here are repeats of it.
  VideoLayout layout;
  std::vector<FrameStack> stacks;
  std::vector<FrameView> views;
  for (const StreamedFrame& frame : empties) {
    layout.empty.push_back(0);
    stacks.push_back(light_of(light, frame));
    views.push_back(view_of(stacks.back(), frame));
  }
  GW_ASSIGN_OR_RETURN(RampExtractor extractor,
                      RampExtractor::create(light.manifest_of_light(manifest), layout, views, options));
  GW_ASSIGN_OR_RETURN(const RampFrame first, extractor.extract(views.front(), thread_count));
  GW_RETURN_IF_ERROR(check_still(first));
  GW_ASSIGN_OR_RETURN(RampFrame empty, extractor.extract(views.back(), thread_count));
  GW_RETURN_IF_ERROR(check_still(empty));
  // There is no object, only noise.
  std::ranges::fill(empty.alpha, 0.0f);
  Matte empty_stage = extractor.matte(empty);
  RampSmoother smoother(options.smoothing);
  return LiveMatte(std::move(light), std::move(extractor), std::move(smoother), std::move(empty_stage),
                   thread_count);
}

absl::StatusOr<RampFrame> LiveMatte::next(const StreamedFrame& frame) {
  auto seen = std::make_unique<Seen>();
  const FrameStack light = light_of(light_, frame);
  const FrameView view = view_of(light, frame);
  GW_ASSIGN_OR_RETURN(seen->raw, extractor_.extract(view, thread_count_, std::move(spent_)));
  seen->input.frame = &seen->raw;
  smoother_.prepare(seen->input, thread_count_);
  before_.push_back(std::move(seen));
  for (; before_.size() > static_cast<size_t>(smoother_.frames_before()) + 1; before_.pop_front())
    spent_ = std::move(before_.front()->raw);
  std::vector<SmoothInput> window;
  for (const auto& each : before_) window.push_back(each->input);
  RampFrame smooth = smoother_.smooth(window, window.size() - 1, thread_count_);
  extractor_.finish(view, smooth, thread_count_);
  return smooth;
}

}  // namespace glasswing
