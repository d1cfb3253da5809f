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
  // What frames before add is not worth their time, unless somebody asks for it.
  if (!start.options().contains("smoothing_reach")) options.smoothing.reach = 0;
  return options;
}

// One frame as a stack of one.
FrameStack light_of(const LinearStack& light, const v1::CaptureManifest& manifest,
                    const StreamedFrame& frame) {
  FrameStack stack;
  stack.manifest = manifest;
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

// Of a frame that the empty stage was averaged from.
absl::Status check_still(const RampFrame& empty) {
  // Noise makes an object of some pixels.
  constexpr double kMaxNoise = 0.05;
  const auto object = std::ranges::count_if(empty.alpha, [](float alpha) { return alpha > 0.0f; });
  const double part = static_cast<double>(object) / static_cast<double>(empty.alpha.size());
  if (part <= kMaxNoise) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("the empty stage changed while it was looked at: {:.0f} % of its pixels differ from their "
                  "mean; keep stage and light still, and try again",
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

  // All frames are of the one kind that the manifest lists.
  VideoLayout layout;
  std::vector<FrameStack> stacks;
  std::vector<FrameView> views;
  for (const StreamedFrame& frame : empties) {
    layout.empty.push_back(0);
    stacks.push_back(light_of(light, manifest, frame));
    views.push_back(view_of(stacks.back(), frame));
  }
  const v1::CaptureManifest& linear = stacks.front().manifest;
  GW_ASSIGN_OR_RETURN(RampExtractor extractor, RampExtractor::create(linear, layout, views, options));
  GW_ASSIGN_OR_RETURN(const RampFrame first, extractor.extract(views.front(), thread_count));
  GW_RETURN_IF_ERROR(check_still(first));
  GW_ASSIGN_OR_RETURN(RampFrame empty, extractor.extract(views.back(), thread_count));
  GW_RETURN_IF_ERROR(check_still(empty));
  // Whatever noise took for an object there is none.
  std::ranges::fill(empty.alpha, 0.0f);
  Matte empty_stage = extractor.matte(empty);
  RampSmoother smoother(options.smoothing);
  return LiveMatte(std::move(light), std::move(manifest), std::move(extractor), std::move(smoother),
                   std::move(empty_stage), thread_count);
}

absl::StatusOr<RampFrame> LiveMatte::next(const StreamedFrame& frame) {
  auto seen = std::make_unique<Seen>();
  const FrameStack light = light_of(light_, manifest_, frame);
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
