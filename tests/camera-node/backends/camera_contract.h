// The contract of every Camera backend. Instantiate for a backend:
//
//   INSTANTIATE_TEST_SUITE_P(Sim, CameraContract, testing::Values(make_sim_camera));
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <memory>
#include <set>
#include <thread>
#include <vector>

#include "camera-node/camera.h"
#include "core/frame/archive.h"
#include "tests/support/status.h"

namespace glasswing {

class CameraContract : public testing::TestWithParam<std::function<std::unique_ptr<Camera>()>> {
 protected:
  // Longer than any camera needs for a frame.
  static constexpr std::chrono::milliseconds kPatience{10'000};
  static constexpr int kFrames = 8;

  // The factory returns null if this machine lacks what the backend needs.
  void SetUp() override {
    camera_ = GetParam()();
    if (camera_ == nullptr) GTEST_SKIP() << "this machine lacks what the camera needs";
    info_ = camera_->describe();
  }
  // The ends of the range that it reports.
  std::set<double> exposures_ms() const { return {info_.min_exposure_ms(), info_.max_exposure_ms()}; }

  std::unique_ptr<Camera> camera_;
  v1::GetCameraResponse info_;
};

TEST_P(CameraContract, DescribesItself) {
  const v1::Camera& camera = info_.camera();
  EXPECT_FALSE(camera.name().empty());
  EXPECT_FALSE(info_.backend().empty());
  for (const int side_px : {camera.width_px(), camera.height_px()}) {
    EXPECT_GE(side_px, 1);
    EXPECT_LE(side_px, kMaxSide_px);
  }
  EXPECT_GE(camera.bits(), 8);
  EXPECT_LE(camera.bits(), 16);
  EXPECT_EQ(camera.response(), "linear");
  EXPECT_GT(info_.frame_rate_hz(), 0.0);
  EXPECT_GT(info_.min_exposure_ms(), 0.0);
  EXPECT_LE(info_.min_exposure_ms(), info_.max_exposure_ms());
  EXPECT_GE(info_.readout_ns(), 0);
}

TEST_P(CameraContract, SaysWhatItPreparesUntilItCanGiveAFrame) {
  double done = 0.0;
  for (v1::GetCameraResponse now = info_; now.has_preparation(); now = camera_->describe()) {
    EXPECT_FALSE(now.preparation().what().empty());
    if (now.preparation().has_done()) {
      EXPECT_GE(now.preparation().done(), done);
      EXPECT_LE(now.preparation().done(), 1.0);
      done = now.preparation().done();
    }
    std::this_thread::yield();
  }
  ASSERT_OK(camera_->start(info_.min_exposure_ms()));
  EXPECT_TRUE(camera_->next(kPatience));
}

TEST_P(CameraContract, RefusesExposuresThatItCannotMake) {
  for (const double exposure_ms :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        0.9 * info_.min_exposure_ms(), 1.1 * info_.max_exposure_ms()}) {
    EXPECT_TRUE(absl::IsInvalidArgument(camera_->start(exposure_ms))) << exposure_ms;
    EXPECT_FALSE(camera_->next(std::chrono::milliseconds(0))) << exposure_ms;
  }
}

TEST_P(CameraContract, FramesAreWhatWasAskedInOrderAndExposedBeforeTheyCome) {
  EXPECT_FALSE(camera_->next(std::chrono::milliseconds(0)));  // it does not run yet
  std::int64_t last_sequence = 0;                             // rises across starts, too
  for (const double exposure_ms : exposures_ms()) {
    SCOPED_TRACE(exposure_ms);
    const nanoseconds asked = monotonic_now();
    ASSERT_OK(camera_->start(exposure_ms));
    std::int64_t last_start_ns = std::numeric_limits<std::int64_t>::min();
    for (int i = 0; i < kFrames; ++i) {
      const std::optional<CapturedFrame> frame = camera_->next(kPatience);
      const nanoseconds delivered = monotonic_now();
      ASSERT_TRUE(frame);
      const v1::FrameTaken& taken = frame->taken;
      EXPECT_GT(taken.sequence(), last_sequence);
      EXPECT_LT(taken.exposure_start_ns(), taken.exposure_end_ns());
      EXPECT_LE(taken.exposure_end_ns(), delivered.count());
      EXPECT_GE(taken.exposure_start_ns(), last_start_ns);
      EXPECT_GE(taken.uncertainty_ns(), 0);
      EXPECT_GE(taken.exposure_start_ns() + taken.uncertainty_ns(), asked.count());
      const double length_ns = static_cast<double>(taken.exposure_end_ns() - taken.exposure_start_ns() +
                                                   2 * taken.uncertainty_ns());
      EXPECT_GE(length_ns, 0.99e6 * exposure_ms);
      EXPECT_NEAR(taken.exposure_ms(), exposure_ms, 0.01 * exposure_ms);
      EXPECT_EQ(taken.width_px(), info_.camera().width_px());
      EXPECT_EQ(taken.height_px(), info_.camera().height_px());
      last_sequence = taken.sequence();
      last_start_ns = taken.exposure_start_ns();
    }
    camera_->stop();
    EXPECT_FALSE(camera_->next(std::chrono::milliseconds(0)));
    camera_->stop();  // a second stop is harmless
  }
}

TEST_P(CameraContract, APictureStaysAsItIs) {
  ASSERT_OK(camera_->start(info_.max_exposure_ms()));
  std::vector<CapturedFrame> frames;
  std::vector<Image16> pictures;
  for (int i = 0; i < kFrames; ++i) {
    std::optional<CapturedFrame> frame = camera_->next(kPatience);
    ASSERT_TRUE(frame);
    frames.push_back(*std::move(frame));
    if (i % 2 == 0) pictures.push_back(frames.back().image().value());
  }
  camera_->stop();
  for (size_t i = 0; i < frames.size(); ++i) {
    const Image16 picture = frames[i].image().value();
    EXPECT_EQ(shape_of(picture), shape_of(info_.camera()));
    EXPECT_EQ(picture.samples.size(),
              shape_of(picture).row_samples() * static_cast<size_t>(picture.height_px));
    EXPECT_TRUE(picture.samples == frames[i].image()->samples) << i;
    if (i % 2 == 0) {
      EXPECT_TRUE(picture.samples == pictures[i / 2].samples) << i;
    }
  }
}

}  // namespace glasswing
