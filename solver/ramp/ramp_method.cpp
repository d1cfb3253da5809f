#include "solver/ramp/ramp_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <optional>

#include "core/base/status.h"
#include "core/pattern/plan.h"
#include "core/pattern/video_frames.h"
#include "solver/background/stage_layout.h"
#include "solver/ramp/ramp_extractor.h"
#include "solver/ramp/video_layout.h"

namespace glasswing {
namespace {

// Several frames with their views.
struct Frames {
  std::vector<VideoFrame> owned;
  std::vector<FrameView> views;
};
absl::StatusOr<Frames> read_all(VideoSource& source, const std::vector<int>& places) {
  Frames frames;
  for (const int place : places) {
    GW_ASSIGN_OR_RETURN(VideoFrame frame, source.read(place));
    frames.views.push_back(frame.view);
    frames.owned.push_back(std::move(frame));
  }
  return frames;
}

// A frame of the video and its state.
struct Extracted {
  int number = 0;
  VideoFrame read;
  absl::Status status;
  RampFrame frame;
  SmoothInput input;
};

}  // namespace

absl::StatusOr<std::unique_ptr<VideoMethod>> RampMethod::create(const MethodOptions& options) {
  GW_ASSIGN_OR_RETURN(const RampOptions parsed, parse_ramp_options(options));
  return std::unique_ptr<VideoMethod>(new RampMethod(options, parsed));
}

absl::Status RampMethod::solve(VideoSource& source, int first, int count, int thread_count,
                               std::stop_token stop, const FrameDone& done) const {
  const v1::CaptureManifest& manifest = source.manifest();
  GW_ASSIGN_OR_RETURN(const VideoLayout layout, lay_out_video(manifest));
  const int size = static_cast<int>(layout.frames.size());
  if (first < 0 || count < 0 || first + count > size) {
    return absl::InvalidArgumentError(
        fmt::format("frames {} to {} were requested; the video has {}", first, first + count - 1, size));
  }
  std::optional<RampExtractor> extractor;
  {
    GW_ASSIGN_OR_RETURN(const Frames empties, read_all(source, layout.empty));
    GW_ASSIGN_OR_RETURN(const Frames black, read_all(source, layout.black));
    GW_ASSIGN_OR_RETURN(extractor,
                        RampExtractor::create(manifest, layout, empties.views, parsed_, black.views));
  }
  const RampSmoother smoother(parsed_.smoothing);
  std::deque<Extracted> near;  // in order, without lost frames
  RampFrame spent;
  int next = std::max(0, first - smoother.frames_before());
  const auto extract = [&](int number) {
    Extracted& extracted = near.emplace_back();
    extracted.number = number;
    absl::StatusOr<VideoFrame> read = source.read(layout.frames[number]);
    extracted.status = read.status();
    if (!read.ok()) return;
    extracted.read = *std::move(read);
    absl::StatusOr<RampFrame> frame = extractor->extract(extracted.read.view, thread_count, std::move(spent));
    if (!frame.ok()) {
      extracted.status = in_frame(number, frame.status());
      return;
    }
    extracted.frame = *std::move(frame);
    extracted.input.frame = &extracted.frame;
    smoother.prepare(extracted.input, thread_count);
  };
  for (int number = first; number < first + count; ++number) {
    const int place = layout.frames[number];
    if (place < 0) continue;
    for (; next < size && next <= number + smoother.frames_after(); ++next) {
      if (stop.stop_requested()) return absl::CancelledError("solving was stopped");
      if (layout.frames[next] >= 0) extract(next);
    }
    for (; near.front().number < number - smoother.frames_before(); near.pop_front())
      spent = std::move(near.front().frame);
    std::vector<SmoothInput> window;
    size_t at = 0;
    const Extracted* own = nullptr;
    for (const Extracted& each : near) {
      if (each.number == number) {
        own = &each;
        at = window.size();
      }
      if (each.status.ok()) window.push_back(each.input);
    }
    if (!own->status.ok()) {
      if (absl::IsUnavailable(own->status) || absl::IsCancelled(own->status)) return own->status;
      GW_RETURN_IF_ERROR(done(number, own->status));
      continue;
    }
    RampFrame frame = smoother.smooth(window, at, thread_count);
    extractor->finish(own->read.view, frame, thread_count);
    Matte matte = extractor->matte(frame, thread_count);
    for (const auto& [key, value] : options_) (*matte.metadata.mutable_options())[key] = value;
    matte.metadata.set_frame(number);
    matte.metadata.set_exposure_start_ns(manifest.frames(place).exposure_start_ns());
    GW_RETURN_IF_ERROR(done(number, std::move(matte)));
  }
  return absl::OkStatus();
}

}  // namespace glasswing
