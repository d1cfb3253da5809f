#include "solver/ramp/ramp_method.h"

#include <fmt/format.h>

#include <deque>

#include "core/base/status.h"
#include "core/pattern/video_frames.h"
#include "solver/background/stage_layout.h"
#include "solver/ramp/ramp_extractor.h"
#include "solver/ramp/ramp_smoother.h"

namespace glasswing {
namespace {

// Some frames at once.
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

bool is_black(const v1::Frame& frame) {
  const v1::Stimulus& stimulus = frame.stimulus();
  return !frame.object() && frame.also_lit().empty() && stimulus.kind() == "solid" &&
         gray_of(stimulus) == 0.0;
}

// A frame of the video, as far as it has come.
struct Extracted {
  int number = 0;
  VideoFrame read;
  RampFrame frame;
  SmoothInput input;
};

}  // namespace

absl::StatusOr<VideoLayout> lay_out_video(const v1::CaptureManifest& manifest) {
  VideoLayout layout;
  layout.frames = video_frames(manifest);
  std::string panel;
  for (const int place : layout.frames) {
    if (place < 0) continue;
    const std::string& own = manifest.frames(place).stimulus().panel();
    if (panel.empty()) panel = own;
    if (own != panel) {
      return absl::FailedPreconditionError(
          fmt::format("the ramp is on monitor \"{}\" and on \"{}\"; a video has it on one", panel, own));
    }
  }
  if (panel.empty()) return absl::FailedPreconditionError("no frame shows the ramp with the object");
  layout.texture = texture_of(manifest, panel);
  if (layout.texture < 0) {
    return absl::FailedPreconditionError(
        fmt::format("the ramp is on monitor \"{}\", which the archive does not list", panel));
  }
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    if (frame.stimulus().reference()) continue;
    if (is_black(frame)) layout.black.push_back(i);
    if (!frame.object() && frame.stimulus().kind() == "ramp" && frame.stimulus().panel() == panel)
      layout.empty.push_back(i);
  }
  if (layout.empty.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("no frame shows the ramp on monitor \"{}\" without the object", panel));
  }
  return layout;
}

absl::StatusOr<std::unique_ptr<VideoMethod>> make_video_method(const std::string& name,
                                                               const MethodOptions& options) {
  if (name == "ramp") return RampMethod::create(options);
  return nullptr;
}

absl::StatusOr<std::unique_ptr<VideoMethod>> RampMethod::create(const MethodOptions& options) {
  GW_ASSIGN_OR_RETURN(const RampOptions parsed, parse_ramp_options(options));
  return std::unique_ptr<VideoMethod>(new RampMethod(options, parsed));
}

absl::Status RampMethod::solve(VideoSource& source, int first, int count, int thread_count,
                               std::stop_token stop,
                               const std::function<absl::Status(int, const Matte&)>& done) const {
  const v1::CaptureManifest& manifest = source.manifest();
  GW_ASSIGN_OR_RETURN(const VideoLayout layout, lay_out_video(manifest));
  const int size = static_cast<int>(layout.frames.size());
  if (first < 0 || count < 0 || first + count > size) {
    return absl::InvalidArgumentError(
        fmt::format("frames {} to {} were asked for; the video has {}", first, first + count - 1, size));
  }
  std::optional<RampExtractor> extractor;
  {
    GW_ASSIGN_OR_RETURN(const Frames empties, read_all(source, layout.empty));
    GW_ASSIGN_OR_RETURN(const Frames black, read_all(source, layout.black));
    GW_ASSIGN_OR_RETURN(extractor,
                        RampExtractor::create(manifest, layout, empties.views, parsed_, black.views));
  }
  const auto in_frame = [](int number, const absl::Status& status) {
    return absl::Status(status.code(), fmt::format("frame {}: {}", number, std::string(status.message())));
  };
  const auto extract = [&](int number) -> absl::StatusOr<Extracted> {
    GW_ASSIGN_OR_RETURN(VideoFrame read, source.read(layout.frames[static_cast<size_t>(number)]));
    absl::StatusOr<RampFrame> frame = extractor->extract(read.view, thread_count);
    if (!frame.ok()) return in_frame(number, frame.status());
    return Extracted{.number = number, .read = std::move(read), .frame = *std::move(frame), .input = {}};
  };
  const RampSmoother smoother(parsed_.smoothing);
  std::deque<Extracted> near;  // by time; deques keep their elements where they are
  int next = std::max(0, first - smoother.frames_before());
  for (int number = first; number < first + count; ++number) {
    if (stop.stop_requested()) return absl::CancelledError("solving was stopped");
    const int place = layout.frames[static_cast<size_t>(number)];
    if (place < 0) continue;
    while (!near.empty() && near.front().number < number - smoother.frames_before()) near.pop_front();
    for (; next < size && next <= number + smoother.frames_after(); ++next) {
      if (layout.frames[static_cast<size_t>(next)] < 0) continue;
      absl::StatusOr<Extracted> extracted = extract(next);
      if (!extracted.ok() && next == number) return extracted.status();
      if (!extracted.ok()) continue;
      near.push_back(*std::move(extracted));
      near.back().input.frame = &near.back().frame;
      smoother.prepare(near.back().input, thread_count);
    }
    std::vector<SmoothInput> window;
    size_t at = near.size();
    for (size_t i = 0; i < near.size(); ++i) {
      if (near[i].number == number) at = i;
      window.push_back(near[i].input);
    }
    // It could not be extracted when its neighbours looked at it; say why.
    if (at == near.size()) return extract(number).status();
    RampFrame frame = smoother.smooth(window, at, thread_count);
    extractor->finish(near[at].read.view, frame, thread_count);
    Matte matte = extractor->matte(frame, thread_count);
    for (const auto& [key, value] : options_) (*matte.metadata.mutable_options())[key] = value;
    matte.metadata.set_frame(number);
    matte.metadata.set_exposure_start_ns(manifest.frames(place).exposure_start_ns());
    GW_RETURN_IF_ERROR(done(number, matte));
  }
  return absl::OkStatus();
}

}  // namespace glasswing
