#include "solver/ramp/ramp_method.h"

#include <gtest/gtest.h>

#include <map>

#include "solver/methods.h"
#include "solver/ramp/video_layout.h"
#include "tests/solver/ramp/ramp_scene.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kEmpty = 3, kFrames = 6;

// A lens that moves, with noise.
class Clip final : public VideoSource {
 public:
  Clip() {
    scene_.width_px = 80;
    scene_.height_px = 60;
    scene_.read_sd = 0.01;
    manifest_ = scene_.manifest();
    for (int i = 0; i < kEmpty + kFrames; ++i) {
      const bool object = i >= kEmpty;
      v1::Frame& frame = *manifest_.add_frames();
      frame.set_file(std::to_string(i));
      frame.set_object(object);
      frame.set_step(-1);
      frame.set_exposure_start_ns(1000 + i);
      frame.mutable_stimulus()->set_kind("ramp");
      frame.mutable_stimulus()->set_panel("back");
      const auto truth = [&](int x, int y) {
        return object ? scene_.lens(x - (i - kEmpty), y) : RampTruth{};
      };
      frames_.push_back(scene_.frame(truth, static_cast<unsigned>(i)));
    }
  }
  const v1::CaptureManifest& manifest() const override { return manifest_; }
  absl::StatusOr<VideoFrame> read(int frame) override {
    if (frame == broken) return absl::DataLossError("torn");
    return VideoFrame{.view = scene_.view(frames_[frame]), .owner = nullptr};
  }
  std::vector<std::uint16_t>& samples(int frame) { return frames_[frame]; }

  int broken = -1;

 private:
  RampScene scene_;
  v1::CaptureManifest manifest_;
  std::vector<std::vector<std::uint16_t>> frames_;
};

struct Solved {
  absl::Status status;
  std::vector<int> numbers;
  std::map<int, absl::Status> refused;
  std::vector<Matte> mattes;
};
Solved solve(VideoSource& source, int first, int count, int threads = 1, std::stop_token stop = {}) {
  Solved solved;
  const auto method = make_video_method("ramp", {}).value();
  solved.status =
      method->solve(source, first, count, threads, stop, [&](int frame, const absl::StatusOr<Matte>& matte) {
        if (!matte.ok()) {
          solved.refused[frame] = matte.status();
          return absl::OkStatus();
        }
        solved.numbers.push_back(frame);
        solved.mattes.push_back(*matte);
        return absl::OkStatus();
      });
  return solved;
}

void expect_same(const Matte& a, const Matte& b) {
  for (int y = 0; y < a.height_px(); ++y) {
    for (int x = 0; x < a.width_px(); ++x) {
      EXPECT_EQ(a.foreground(x, y), b.foreground(x, y));
      EXPECT_EQ(a.coverage(x, y), b.coverage(x, y));
      for (size_t mode = 0; mode < a.modes(x, y, 0).size(); ++mode) {
        EXPECT_EQ(a.modes(x, y, 0)[mode].weight, b.modes(x, y, 0)[mode].weight);
        EXPECT_EQ(a.modes(x, y, 0)[mode].x_px, b.modes(x, y, 0)[mode].x_px);
        EXPECT_EQ(a.modes(x, y, 0)[mode].yy_px2, b.modes(x, y, 0)[mode].yy_px2);
      }
    }
  }
}

TEST(RampMethod, RangesJoinWithoutSeams) {
  Clip clip;
  const Solved whole = solve(clip, 0, kFrames);
  ASSERT_OK(whole.status);
  ASSERT_EQ(whole.mattes.size(), static_cast<size_t>(kFrames));
  EXPECT_EQ(whole.mattes[2].metadata.frame(), 2);
  EXPECT_EQ(whole.mattes[2].metadata.exposure_start_ns(), 1000 + kEmpty + 2);
  for (const auto& [first, count] : {std::pair{0, 2}, {2, 1}, {3, 3}}) {
    const Solved part = solve(clip, first, count, 3);
    ASSERT_OK(part.status);
    ASSERT_EQ(part.mattes.size(), static_cast<size_t>(count));
    for (int i = 0; i < count; ++i) expect_same(part.mattes[i], whole.mattes[first + i]);
  }
}

TEST(RampMethod, FramesRoundABrokenOneAreFinished) {
  Clip clip;
  clip.broken = kEmpty + 3;
  const Solved solved = solve(clip, 0, kFrames);
  EXPECT_OK(solved.status);
  EXPECT_EQ(solved.numbers.size(), static_cast<size_t>(kFrames) - 1);
  ASSERT_EQ(solved.refused.size(), 1u);
  EXPECT_TRUE(absl::IsDataLoss(solved.refused.at(3)));
  // Outside the range the frame is only left out.
  EXPECT_OK(solve(clip, 4, 2).status);
}

TEST(RampMethod, AFrameThatCannotBeSolvedIsNamed) {
  Clip clip;
  std::ranges::fill(clip.samples(kEmpty + 1), std::uint16_t{0});
  const Solved solved = solve(clip, 0, kFrames);
  EXPECT_EQ(solved.numbers.size(), static_cast<size_t>(kFrames) - 1);
  ASSERT_EQ(solved.refused.size(), 1u);
  EXPECT_EQ(std::string(solved.refused.at(1).message()).find("frame 1: the frame does not show the ramp"),
            0u);
}

TEST(RampMethod, StopsWhenAsked) {
  Clip clip;
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(solve(clip, 0, kFrames, 1, stop.get_token()).status.code(), absl::StatusCode::kCancelled);
}

TEST(RampMethod, SaysWhatTheArchiveLacks) {
  Clip clip;
  v1::CaptureManifest manifest = clip.manifest();
  for (v1::Frame& frame : *manifest.mutable_frames()) frame.set_object(true);
  EXPECT_NE(lay_out_video(manifest).status().message().find("without the object"), std::string::npos);
  for (v1::Frame& frame : *manifest.mutable_frames()) frame.set_object(false);
  EXPECT_NE(lay_out_video(manifest).status().message().find("with the object"), std::string::npos);
  EXPECT_EQ(solve(clip, 4, 3).status.code(), absl::StatusCode::kInvalidArgument);
}

TEST(RampMethod, OptionsAreChecked) {
  const auto message = [](const MethodOptions& options) {
    return std::string(parse_ramp_options(options).status().message());
  };
  const auto parsed =
      parse_ramp_options({{"delta", "0.1"}, {"edge_px", "2"}, {"fill_holes", "0"}, {"smoothing", "none"}});
  ASSERT_OK(parsed);
  EXPECT_EQ(parsed->delta, 0.1);
  EXPECT_EQ(parsed->edge_px, 2);
  EXPECT_FALSE(parsed->fill_holes);
  EXPECT_EQ(parsed->smoothing.smoothing, Smoothing::kNone);
  EXPECT_EQ(message({{"delta", "2"}}), "delta is \"2\"; it must be 0 to 1");
  EXPECT_EQ(message({{"edge_px", "1.5"}}), "edge_px is \"1.5\"; it must be a whole number, 0 to 20");
  EXPECT_NE(message({{"deltas", "1"}}).find("it has: threshold_sd, "), std::string::npos);
  EXPECT_EQ(make_video_method("gaussian", {}).value(), nullptr);
}

TEST(RampMethod, SmoothingOptionsAreRead) {
  const SmoothingOptions smoothing = parse_ramp_options({{"smoothing", "perona-malik"},
                                                         {"smoothing_reach", "3"},
                                                         {"smoothing_iterations", "25"},
                                                         {"smoothing_contrast", "2.5"},
                                                         {"smoothing_conductance", "rational"}})
                                         .value()
                                         .smoothing;
  EXPECT_EQ(smoothing.smoothing, Smoothing::kPeronaMalik);
  EXPECT_EQ(smoothing.reach, 3);
  EXPECT_EQ(smoothing.iterations, 25);
  EXPECT_EQ(smoothing.contrast_px, 2.5);
  EXPECT_FALSE(smoothing.exponential);
}

// The defaults that people are told are those that RampOptions has.
TEST(RampMethod, DefaultsAreThoseOfTheTable) {
  const RampOptions told = parse_ramp_options({}).value(), own;
  EXPECT_EQ(told.threshold_sd, own.threshold_sd);
  EXPECT_EQ(told.min_difference, own.min_difference);
  EXPECT_EQ(told.dilation_px, own.dilation_px);
  EXPECT_EQ(told.erosion_px, own.erosion_px);
  EXPECT_EQ(told.fill_holes, own.fill_holes);
  EXPECT_EQ(told.edge_px, own.edge_px);
  EXPECT_EQ(told.highlights, own.highlights);
  EXPECT_EQ(told.delta, own.delta);
  EXPECT_EQ(told.highlight_rise, own.highlight_rise);
  EXPECT_EQ(told.highlight_reach_px, own.highlight_reach_px);
  EXPECT_EQ(told.highlight_blur_px, own.highlight_blur_px);
  EXPECT_EQ(told.highlight_gain, own.highlight_gain);
  EXPECT_EQ(told.clipped_highlight, own.clipped_highlight);
  EXPECT_EQ(told.smoothing.smoothing, own.smoothing.smoothing);
  EXPECT_EQ(told.smoothing.reach, own.smoothing.reach);
  EXPECT_EQ(told.smoothing.iterations, own.smoothing.iterations);
  EXPECT_EQ(told.smoothing.contrast_px, own.smoothing.contrast_px);
  EXPECT_EQ(told.smoothing.exponential, own.smoothing.exponential);
}

}  // namespace
}  // namespace glasswing
