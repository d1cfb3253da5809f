// The backend against a camera with packed formats, packets sent again, chunks, PTP and a trigger line
// (wire_camera.h).
#include "tests/camera-node/backends/aravis/wire_camera.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <random>

#include "camera-node/backends/aravis/aravis_camera.h"
#include "camera-node/camera_metrics.h"
#include "display-node/backends/pulsed_display.h"
#include "display-node/backends/sim_display.h"
#include "tests/camera-node/backends/camera_contract.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// A camera whose pictures are all random, except for one that tells the number of the exposure in its first
// two samples, in units of the lowest bit of 8.
class WiredStandIn {
 public:
  explicit WiredStandIn(WireCamera::Options options = {}, PictureSize size = {64, 48})
      : size_(size), camera_(named(options), [this](const WireCamera::Exposure& exposure) {
          const std::lock_guard lock(mutex_);
          exposures_[exposure.number] = exposure;
          return picture(exposure.number);
        }) {}

  AravisCamera::Options options(const std::string& format = "Mono12p") const {
    AravisCamera::Options options;
    options.device = serial_;
    options.size = size_;
    options.format = format;
    options.frame_rate_hz = 50.0;
    return options;
  }
  std::shared_ptr<const Image16> picture(int number) const {
    std::mt19937 random(static_cast<unsigned>(number));
    auto image = std::make_shared<Image16>(size_.width_px, size_.height_px, 1);
    for (std::uint16_t& sample : image->samples) sample = static_cast<std::uint16_t>(random());
    image->samples[0] = static_cast<std::uint16_t>(number >> 8 << 8);
    image->samples[1] = static_cast<std::uint16_t>(number << 8);
    return image;
  }
  // Of the exposure that a picture shows.
  WireCamera::Exposure exposure_of(const Image16& image) const {
    const auto byte = [&](int x) { return std::lround(image.at(x, 0, 0) * 4095 / 65535.0) >> 4; };  // 12 bits
    const std::lock_guard lock(mutex_);
    return exposures_.at(static_cast<int>(byte(0) << 8 | byte(1)));
  }
  WireCamera& camera() { return camera_; }

 private:
  WireCamera::Options named(WireCamera::Options options) {
    static int count = 0;
    serial_ = fmt::format("w{}-{}", ::getpid(), ++count);
    options.serial = serial_;
    return options;
  }
  std::string serial_;
  const PictureSize size_;
  mutable std::mutex mutex_;
  std::map<int, WireCamera::Exposure> exposures_;  // by number; guarded by mutex_
  WireCamera camera_;
};

std::unique_ptr<AravisCamera> opened(const AravisCamera::Options& options) {
  absl::StatusOr<std::unique_ptr<AravisCamera>> camera = AravisCamera::open(options);
  EXPECT_OK(camera.status());
  return camera.ok() ? *std::move(camera) : nullptr;
}

std::unique_ptr<Camera> open_one() {
  static const WiredStandIn stand_in;
  return opened(stand_in.options());
}
INSTANTIATE_TEST_SUITE_P(Wire, CameraContract, testing::Values(open_one));

TEST(WireCamera, EveryFormatArrivesToTheLastBit) {
  const WiredStandIn stand_in;
  for (const WireFormat& format : WireRegisters::formats()) {
    SCOPED_TRACE(format.name);
    const auto camera = opened(stand_in.options(std::string(format.name)));
    ASSERT_NE(camera, nullptr);
    EXPECT_EQ(camera->describe().camera().bits(), format.bits);
    ASSERT_OK(camera->start(2.0));
    for (int i = 0; i < 3; ++i) {
      const std::optional<CapturedFrame> frame = camera->next(seconds(5));
      ASSERT_TRUE(frame);
      const Image16 image = frame->image().value();
      // The numbers survive every format: they use the highest 8 bits.
      const int full = (1 << format.bits) - 1;
      const auto code = [&](int at) {
        return std::lround(image.samples[at * image.channels] * 1.0 * full / 65535.0);
      };
      const int number = static_cast<int>((code(0) >> (format.bits - 8)) << 8 | code(1) >> (format.bits - 8));
      const auto truth = stand_in.picture(number);
      int wrong = 0;
      for (int at = 0; at < static_cast<int>(truth->samples.size()); ++at)
        wrong += code(at) != truth->samples[at] >> (16 - format.bits);
      EXPECT_EQ(wrong, 0) << "picture " << number;
    }
  }
}

// The numbers of frames that arrived whole out of all that were exposed meanwhile.
struct Share {
  double complete = 0.0;
  int mislabelled = 0;
};
Share share_of(WiredStandIn& stand_in, int frames) {
  Share share;
  const auto camera = opened(stand_in.options("Mono12p"));
  if (camera == nullptr) return share;
  EXPECT_OK(camera->start(2.0));
  std::int64_t first = 0, last = 0;
  for (int i = 0; i < frames; ++i) {
    const std::optional<CapturedFrame> frame = camera->next(seconds(10));
    if (!frame) return share;
    if (first == 0) first = frame->taken.sequence();
    last = frame->taken.sequence();
  }
  share.complete = frames / static_cast<double>(last - first + 1);
  return share;
}

TEST(WireCamera, PacketsThatWereLostAreSentAgain) {
  WiredStandIn resends({.lost = 0.01}, {320, 240});  // 85 packets a frame
  const double asked = share_of(resends, 150).complete;
  EXPECT_GT(resends.camera().counts().resent, 50);
  EXPECT_GE(asked, 0.97);
  WiredStandIn silent({.lost = 0.01, .resends = false}, {320, 240});
  const double dropped = camera_metrics().incomplete.Value();
  const double unasked = share_of(silent, 50).complete;
  // 0.99^87 of the frames; 3 standard deviations of 120 frames.
  EXPECT_NEAR(unasked, std::pow(0.99, 87), 3 * std::sqrt(0.42 * 0.58 / 120));
  EXPECT_GT(camera_metrics().incomplete.Value(), dropped);
}

TEST(WireCamera, TimesHoldWithinTheirBound) {
  struct Case {
    double ppm;
    bool end;
    double lost;
  };
  for (const Case& each : {Case{0.0, false, 0.0}, Case{80.0, false, 0.01}, Case{-80.0, true, 0.001}}) {
    SCOPED_TRACE(fmt::format("{} ppm, end {}, lost {}", each.ppm, each.end, each.lost));
    const WiredStandIn stand_in({.lost = each.lost, .stamps_end = each.end, .clock_ppm = each.ppm});
    const auto camera = opened(stand_in.options());
    ASSERT_NE(camera, nullptr);
    ASSERT_OK(camera->start(3.0));
    int within = 0;
    constexpr int kFrames = 300;
    nanoseconds largest{}, widest{};
    for (int i = 0; i < kFrames; ++i) {
      const std::optional<CapturedFrame> frame = camera->next(seconds(5));
      ASSERT_TRUE(frame);
      const WireCamera::Exposure truth = stand_in.exposure_of(frame->image().value());
      const nanoseconds error = std::chrono::abs(nanoseconds(frame->taken.exposure_start_ns()) - truth.start);
      const nanoseconds bound(frame->taken.uncertainty_ns());
      within += error <= bound;
      largest = std::max(largest, error);
      widest = std::max(widest, bound);
    }
    EXPECT_GE(within, 0.999 * kFrames)
        << "largest error " << largest.count() << " ns, widest bound " << widest.count() << " ns";
    EXPECT_LE(widest, milliseconds(4));
  }
}

TEST(WireCamera, TwoAtOnceKeepTheirPicturesApart) {
  const WiredStandIn one, other({.address = "127.0.0.2", .lost = 0.01});
  const auto first = opened(one.options()), second = opened(other.options());
  ASSERT_TRUE(first != nullptr && second != nullptr);
  ASSERT_OK(first->start(2.0));
  ASSERT_OK(second->start(7.0));
  for (int i = 0; i < 50; ++i) {
    for (const auto& [camera, stand_in, length] : {std::tuple(first.get(), &one, milliseconds(2)),
                                                   std::tuple(second.get(), &other, milliseconds(7))}) {
      const std::optional<CapturedFrame> frame = camera->next(seconds(5));
      ASSERT_TRUE(frame);
      const WireCamera::Exposure truth = stand_in->exposure_of(frame->image().value());
      EXPECT_EQ(truth.length, nanoseconds(length));
      EXPECT_LE(std::chrono::abs(nanoseconds(frame->taken.exposure_start_ns()) - truth.start),
                nanoseconds(frame->taken.uncertainty_ns()));
    }
  }
}

TEST(WireCamera, ALineTriggersAfterTheDelay) {
  WiredStandIn stand_in;
  AravisCamera::Options options = stand_in.options();
  options.trigger = "Line1";
  options.line_delay = milliseconds(7);
  const auto camera = opened(options);
  ASSERT_NE(camera, nullptr);
  ASSERT_OK(camera->start_triggered(2.0));
  for (int i = 0; i < 30; ++i) {
    const nanoseconds raised = monotonic_now();
    stand_in.camera().raise_line();
    const nanoseconds after = monotonic_now();
    const std::optional<CapturedFrame> frame = camera->next(seconds(5));
    ASSERT_TRUE(frame);
    const WireCamera::Exposure truth = stand_in.exposure_of(frame->image().value());
    EXPECT_GE(truth.start, raised + milliseconds(7));
    EXPECT_LE(truth.start, after + milliseconds(7));
    EXPECT_LE(std::chrono::abs(nanoseconds(frame->taken.exposure_start_ns()) - truth.start),
              nanoseconds(frame->taken.uncertainty_ns()));
    EXPECT_FALSE(camera->next(milliseconds(0)));
  }
}

// Raises the stand-in's line.
class WiredLine final : public TriggerLine {
 public:
  explicit WiredLine(WireCamera& camera) : camera_(camera) {}
  absl::Status pulse() override {
    camera_.raise_line();
    return absl::OkStatus();
  }

 private:
  WireCamera& camera_;
};

TEST(WireCamera, TheDisplaysLinePlacesTheExposureInThePicture) {
  constexpr milliseconds kAfter(18), kSlack(12), kDelay(4), kStep(60);
  WiredStandIn stand_in;
  AravisCamera::Options options = stand_in.options();
  options.trigger = "Line1";
  options.line_delay = kDelay;
  const auto camera = opened(options);
  ASSERT_NE(camera, nullptr);
  EXPECT_EQ(camera->describe().line_delay_ns(), nanoseconds(kDelay).count());
  ASSERT_OK(camera->start_triggered(2.0));
  SimDisplay sim({{.name = "back", .width_px = 4, .height_px = 3}}, {});
  PulsedDisplay display(sim, std::make_unique<WiredLine>(stand_in.camera()));
  display.arm(PulsedDisplay::Pulse{.after = kAfter, .slack = kSlack});
  std::vector<nanoseconds> begun;
  nanoseconds at = monotonic_now();
  for (int i = 0; i < 20; ++i, at = begun.back() + kStep)
    begun.push_back(display.show({nullptr}, at).value()[0].start);
  display.arm({});
  ASSERT_OK(display.show({nullptr}, at).status());  // by then the last exposure has begun, or never will
  int exposed = 0;
  while (const std::optional<CapturedFrame> frame = camera->next(milliseconds(300))) {
    const nanoseconds start = stand_in.exposure_of(frame->image().value()).start;
    const auto shown = std::ranges::upper_bound(begun, start);
    ASSERT_NE(shown, begun.begin());
    EXPECT_GE(start, *(shown - 1) + kAfter + kDelay);
    EXPECT_LE(start, *(shown - 1) + kAfter + kSlack + kDelay +
                         milliseconds(1));  // between reading the time and raising
    ++exposed;
  }
  EXPECT_GE(exposed, 15);  // unless the machine stalls for longer than the slack
}

TEST(WireCamera, WithPtpTheBoundIsThatOfTheClocks) {
  WiredStandIn stand_in;
  for (const char* meaning : {"start", "end"}) {
    SCOPED_TRACE(meaning);
    AravisCamera::Options options = stand_in.options();
    options.ptp = meaning;
    const auto camera = opened(options);
    ASSERT_NE(camera, nullptr);
    ASSERT_OK(camera->start(12.0));  // longer than the triggers' bound, so that a wrong meaning shows
    int narrow = 0;
    for (int i = 0; i < 40; ++i) {
      const std::optional<CapturedFrame> frame = camera->next(seconds(5));
      ASSERT_TRUE(frame);
      const nanoseconds error = std::chrono::abs(nanoseconds(frame->taken.exposure_start_ns()) -
                                                 stand_in.exposure_of(frame->image().value()).start);
      EXPECT_LE(error, nanoseconds(frame->taken.uncertainty_ns()));
      narrow += nanoseconds(frame->taken.uncertainty_ns()) <= std::chrono::microseconds(100);
    }
    // The stand-in stamps the start: the other meaning contradicts the triggers and is not used.
    EXPECT_EQ(narrow, std::string_view(meaning) == "start" ? 40 : 0);
  }
  WiredStandIn plain({.ptp = false});
  AravisCamera::Options options = plain.options();
  options.ptp = "start";
  const absl::Status none = AravisCamera::open(options).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(none)) << none;
}

TEST(WireCamera, FramesThatNobodyTakesAreCountedAndTheNewestKept) {
  WiredStandIn stand_in;
  const auto camera = opened(stand_in.options());
  ASSERT_NE(camera, nullptr);
  ASSERT_OK(camera->start(2.0));
  const std::optional<CapturedFrame> first = camera->next(seconds(5));
  ASSERT_TRUE(first);
  const std::int64_t before = stand_in.camera().counts().exposed;
  constexpr int kExposed = 60;
  while (stand_in.camera().counts().exposed < before + kExposed)
    sleep_until_monotonic(monotonic_now() + milliseconds(5));
  int taken = 0;
  std::int64_t last = first->taken.sequence();
  while (const std::optional<CapturedFrame> frame = camera->next(milliseconds(0))) {
    const WireCamera::Exposure truth = stand_in.exposure_of(frame->image().value());
    EXPECT_LE(std::chrono::abs(nanoseconds(frame->taken.exposure_start_ns()) - truth.start),
              nanoseconds(frame->taken.uncertainty_ns()));
    EXPECT_GT(frame->taken.sequence(), last);
    last = frame->taken.sequence();
    ++taken;
  }
  // The last one or two may still be on their way.
  EXPECT_GE(camera->describe().dropped_frames() + taken, kExposed - 2);
  EXPECT_GE(last - first->taken.sequence(), kExposed - 2);
  EXPECT_GT(camera->describe().dropped_frames(), 0);
  EXPECT_LE(taken, 36);
}

TEST(WireCamera, AFrameTellsItsExposureAndGain) {
  WiredStandIn stand_in;
  AravisCamera::Options options = stand_in.options();
  options.gain = 6.0;  // dB
  const auto camera = opened(options);
  ASSERT_NE(camera, nullptr);
  ASSERT_OK(camera->start(3.0));
  const std::optional<CapturedFrame> frame = camera->next(seconds(5));
  ASSERT_TRUE(frame);
  EXPECT_NEAR(frame->taken.gain(), std::pow(10.0, 0.3), 1e-12);
  // Somebody else shortens the exposure: its frames are not those that were asked for.
  const double dropped = camera_metrics().incomplete.Value();
  stand_in.camera().set_exposure(1.5);
  std::optional<CapturedFrame> next;
  do next = camera->next(milliseconds(500));
  while (next);
  EXPECT_GT(camera_metrics().incomplete.Value(), dropped);
  EXPECT_GT(camera->describe().dropped_frames(), 0);
}

}  // namespace
}  // namespace glasswing
