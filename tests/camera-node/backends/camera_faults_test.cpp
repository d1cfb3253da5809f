// Each fault option of the simulated camera has its documented effect and no other.
#include <gtest/gtest.h>

#include <set>

#include "camera-node/backends/sim_camera.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kFrames = 60;
constexpr milliseconds kWait(1000);

// A noiseless camera looks at a monitor that is red, green, blue, red, ... for a millisecond each.
class FaultyCamera : public testing::Test {
 protected:
  FaultyCamera() {
    timeline_.add_monitor({.name = "back", .width_px = 4, .height_px = 4});
    const nanoseconds now = monotonic_now();
    for (int i = -100; i < 1000; ++i) {
      auto picture = std::make_shared<Image16>(4, 4);
      for (size_t s = static_cast<size_t>(i + 999) % 3; s < picture->samples.size(); s += 3)
        picture->samples[s] = 60000;
      timeline_.add_picture("back", {.scanout_start = now + milliseconds(i), .image = picture});
    }
    timeline_.set_horizon("back", now + hours(1));
    options_.scene = "none";
    options_.width_px = options_.height_px = 4;
    options_.frame_rate_hz = 500.0;
    options_.sensor = {.read_sd = 0.0, .gain = 0.0, .bits = 16, .readout = nanoseconds(0)};
  }
  std::vector<CapturedFrame> take() {
    camera_ = SimCamera::create(options_, timeline_).value();
    EXPECT_OK(camera_->start(0.25));
    std::vector<CapturedFrame> frames;
    for (int i = 0; i < kFrames; ++i) {
      frames.push_back(camera_->next(kWait).value());
      returned_.push_back(monotonic_now());
    }
    return frames;
  }
  // How far a frame's start is off the camera's regular period.
  nanoseconds off_beat(const CapturedFrame& frame, const CapturedFrame& first) const {
    const nanoseconds period = milliseconds(2);
    return nanoseconds(frame.taken.exposure_start_ns() - first.taken.exposure_start_ns()) -
           period * (frame.taken.sequence() - first.taken.sequence());
  }

  EmissionTimeline timeline_{hours(1)};
  SimCameraOptions options_;
  std::unique_ptr<SimCamera> camera_;
  std::vector<nanoseconds> returned_;
};

TEST_F(FaultyCamera, WithoutFaultsBeatsEvenlyAndSeesEachPicture) {
  const std::vector<CapturedFrame> frames = take();
  std::set<std::vector<std::uint16_t>> pictures;
  for (const CapturedFrame& frame : frames) {
    EXPECT_EQ(off_beat(frame, frames[0]).count(), 0);
    pictures.insert(frame.image()->samples);
  }
  EXPECT_GE(pictures.size(), 3u);  // an exposure may span two pictures
}

TEST_F(FaultyCamera, DropsFramesAndTheirNumbers) {
  options_.drop = 0.5;
  const std::vector<CapturedFrame> frames = take();
  EXPECT_GT(frames.back().taken.sequence(), frames.front().taken.sequence() + kFrames);
  for (const CapturedFrame& frame : frames) EXPECT_EQ(off_beat(frame, frames[0]).count(), 0);
}

TEST_F(FaultyCamera, DuplicatesHoldTheFirstPixelsUnderNewTimes) {
  options_.duplicate = 1.0;
  const std::vector<CapturedFrame> frames = take();
  for (const CapturedFrame& frame : frames) {
    EXPECT_EQ(off_beat(frame, frames[0]).count(), 0);
    EXPECT_EQ(frame.image()->samples, frames[0].image()->samples);
  }
}

TEST_F(FaultyCamera, LateFramesKeepTheirOrderAndTheirTimes) {
  options_.late = milliseconds(20);
  const std::vector<CapturedFrame> frames = take();
  nanoseconds latest{};
  for (size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(off_beat(frames[i], frames[0]).count(), 0);
    EXPECT_GT(frames[i].taken.sequence(), i == 0 ? 0 : frames[i - 1].taken.sequence());
    latest = std::max(latest, returned_[i] - nanoseconds(frames[i].taken.exposure_end_ns()));
  }
  EXPECT_GT(latest, milliseconds(5));  // the odds that all sixty draws of up to 20 ms are smaller: 4^-60
}

TEST_F(FaultyCamera, JitteredStampsStayWithinWhatTheySay) {
  options_.stamp_jitter = microseconds(500);
  const std::vector<CapturedFrame> frames = take();
  bool any = false;
  for (const CapturedFrame& frame : frames) {
    EXPECT_GE(frame.taken.uncertainty_ns(), 500'000);
    // This stamp and the first each have an error.
    EXPECT_LE(std::abs(off_beat(frame, frames[0]).count()), 1'000'000);
    any = any || off_beat(frame, frames[0]).count() != 0;
  }
  EXPECT_TRUE(any);
}

TEST_F(FaultyCamera, ShiftedStampsDoNotSayThatTheyAre) {
  options_.stamp_shift = seconds(5);
  const std::vector<CapturedFrame> frames = take();
  for (size_t i = 0; i < frames.size(); ++i) {
    EXPECT_GT(frames[i].taken.exposure_end_ns(), returned_[i].count());  // the future
    EXPECT_LT(frames[i].taken.uncertainty_ns(), 1'000'000);
  }
}

TEST_F(FaultyCamera, StampsInItsNodesClock) {
  const std::vector<CapturedFrame> honest = take();
  options_.clock = NodeClock(hours(-7), 0.0);
  returned_.clear();
  const std::vector<CapturedFrame> frames = take();
  for (size_t i = 0; i < frames.size(); ++i) {
    EXPECT_LE(nanoseconds(frames[i].taken.exposure_end_ns()), returned_[i] - hours(7));
    EXPECT_GT(nanoseconds(frames[i].taken.exposure_end_ns()),
              nanoseconds(honest.back().taken.exposure_end_ns()) - hours(7));
  }
}

}  // namespace
}  // namespace glasswing
