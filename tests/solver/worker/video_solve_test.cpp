#include "solver/worker/video_solve.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <set>

#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kEmpty = 3, kFrames = 12, kSide = 4;

v1::CaptureManifest manifest() {
  v1::CaptureManifest manifest;
  manifest.set_format_version(1);
  manifest.set_session("s");
  v1::Monitor& monitor = *manifest.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(8);
  monitor.set_height_px(8);
  manifest.mutable_camera()->set_width_px(kSide);
  manifest.mutable_camera()->set_height_px(kSide);
  manifest.mutable_camera()->set_response("linear");
  for (int i = 0; i < kEmpty + kFrames; ++i) {
    v1::Frame& frame = *manifest.add_frames();
    frame.set_file("frames/" + std::to_string(i) + ".tif");
    frame.set_object(i >= kEmpty);
    frame.set_step(-1);
    frame.mutable_stimulus()->set_kind("ramp");
    frame.mutable_stimulus()->set_panel("back");
  }
  return manifest;
}

// A node whose frames contain their own index. It counts frames that were read but not requested yet.
class Node {
 public:
  absl::StatusOr<std::vector<std::uint16_t>> read(int frame) {
    {
      const std::lock_guard lock(mutex_);
      ++reads_[frame];
      max_waiting_ = std::max(max_waiting_, ++waiting_);
    }
    if (frame == broken) return absl::DataLossError("frames/x.tif is damaged");
    return std::vector<std::uint16_t>(3 * kSide * kSide, static_cast<std::uint16_t>(frame));
  }
  void asked() {
    const std::lock_guard lock(mutex_);
    --waiting_;
  }
  std::map<int, int> reads() {
    const std::lock_guard lock(mutex_);
    return reads_;
  }
  int max_waiting() {
    const std::lock_guard lock(mutex_);
    return max_waiting_;
  }
  int broken = -1;

 private:
  std::mutex mutex_;
  std::map<int, int> reads_;
  int waiting_ = 0, max_waiting_ = 0;
};

// Every frame's matte contains its middle sample.
class Copies final : public VideoMethod {
 public:
  explicit Copies(Node& node) : node_(node) {}
  absl::Status solve(VideoSource& source, int first, int count, int, std::stop_token,
                     const FrameDone& done) const override {
    for (int i = 0; i < kEmpty; ++i) {
      if (const auto frame = source.read(i); !frame.ok()) return frame.status();
      node_.asked();
    }
    for (int i = first; i < first + count; ++i) {
      const auto frame = source.read(kEmpty + i);
      if (!frame.ok()) return frame.status();
      node_.asked();
      Matte matte(0, 0, kSide, kSide, 1, true);
      matte.foreground(1, 1).fill(static_cast<float>(frame->view.samples[5]));
      if (const absl::Status status = done(i, matte); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

 private:
  Node& node_;
};

TEST(VideoSolve, FramesAreReadAheadOnceEachAndAFewAtATime) {
  Node node;
  const v1::CaptureManifest archive = manifest();
  const auto source = read_ahead(archive, 4, 6, [&](int frame) { return node.read(frame); }).value();
  std::vector<int> solved;
  const absl::Status status =
      solve_video(Copies(node), *source, 4, 6, 1, {}, [&](int frame, const absl::StatusOr<Matte>& matte) {
        EXPECT_EQ(matte->foreground(1, 1)[0], static_cast<float>(kEmpty + frame));
        solved.push_back(frame);
        return absl::OkStatus();
      });
  ASSERT_OK(status);
  EXPECT_EQ(solved, (std::vector{4, 5, 6, 7, 8, 9}));
  std::map<int, int> expected;
  for (int i = 0; i < kEmpty; ++i) expected[i] = 1;
  for (int i = 4; i < 10; ++i) expected[kEmpty + i] = 1;
  EXPECT_EQ(node.reads(), expected);
  EXPECT_LE(node.max_waiting(), 4);  // three ahead and the requested one
}

TEST(VideoSolve, WhatGoesWrongNamesTheFrame) {
  Node node;
  node.broken = kEmpty + 5;
  const v1::CaptureManifest archive = manifest();
  const auto source = read_ahead(archive, 0, kFrames, [&](int frame) { return node.read(frame); }).value();
  std::vector<int> solved;
  const absl::Status status =
      solve_video(Copies(node), *source, 0, kFrames, 1, {}, [&](int frame, const absl::StatusOr<Matte>&) {
        solved.push_back(frame);
        return absl::OkStatus();
      });
  EXPECT_TRUE(absl::IsDataLoss(status));
  EXPECT_EQ(status.message(), "frame 5: frames/x.tif is damaged");
  EXPECT_EQ(solved.size(), 5u);
}

TEST(VideoSolve, AnErrorOfWhoTakesTheMattesEndsIt) {
  Node node;
  const v1::CaptureManifest archive = manifest();
  const auto source = read_ahead(archive, 0, kFrames, [&](int frame) { return node.read(frame); }).value();
  const absl::Status status =
      solve_video(Copies(node), *source, 0, kFrames, 1, {}, [](int frame, const absl::StatusOr<Matte>&) {
        return frame < 2 ? absl::OkStatus() : absl::AbortedError("enough");
      });
  EXPECT_TRUE(absl::IsAborted(status));
}

}  // namespace
}  // namespace glasswing
