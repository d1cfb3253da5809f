#include "camera-node/backends/sim_camera.h"

#include <algorithm>
#include <set>
#include <thread>

#include "core/sim/scene.h"
#include "tests/camera-node/backends/camera_contract.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

// A monitor that changes every 50 ms for longer than the tests run.
const EmissionTimeline& changing_light() {
  static const EmissionTimeline* const timeline = [] {
    auto* made = new EmissionTimeline(std::chrono::seconds(30));  // all of it
    made->add_monitor(
        {.name = "back", .width_px = 8, .height_px = 6, .scanout = milliseconds(16), .lag = milliseconds(2)});
    const nanoseconds now = monotonic_now();
    for (int i = 0; i < 400; ++i) {
      auto picture = std::make_shared<Image16>(8, 6);
      for (std::uint16_t& sample : picture->samples) sample = static_cast<std::uint16_t>(i % 10 * 6553);
      made->add_picture("back", {.scanout_start = now + milliseconds(50 * i), .image = picture});
    }
    made->set_horizon("back", now + std::chrono::hours(1));
    return made;
  }();
  return *timeline;
}

std::unique_ptr<Camera> make_sim(double frame_rate_hz, double faults, const Automatics& automatics = {}) {
  SimCameraOptions options;
  options.frame_rate_hz = frame_rate_hz;
  options.drop = options.duplicate = faults;
  options.automatics = automatics;
  return SimCamera::create(options, changing_light()).value();
}

INSTANTIATE_TEST_SUITE_P(
    Sim, CameraContract,
    testing::Values([] { return make_sim(200.0, 0.0); }, [] { return make_sim(50.0, 0.3); },
                    [] { return make_sim(200.0, 0.0, {.gain = true, .white_balance = true}); }));

TEST(SimCamera, CallsOnlyALinearResponseLinear) {
  const auto described = [](const SensorModel& sensor) {
    SimCameraOptions options;
    options.sensor = sensor;
    return SimCamera::create(options, changing_light()).value()->describe().camera();
  };
  EXPECT_EQ(described({.vignetting = 0.3, .bits = 10}).response(), "linear");
  for (const SensorModel& sensor :
       {SensorModel{.curve = {.exponent = 0.45f}}, SensorModel{.curve = {.contrast = 0.5f}},
        SensorModel{.black_level = 0.06}}) {
    EXPECT_EQ(described(sensor).response(), "unknown");
    EXPECT_EQ(described(sensor).read_sd(), 0.0);
    EXPECT_EQ(described(sensor).gain(), 0.0);
  }
}

TEST(SimCamera, AMosaicIsWhatItsPhotositesSeeOfTheSamePicture) {
  SimCameraOptions options;
  options.mosaic = "GBRG";
  options.sensor.read_sd = options.sensor.gain = 0.0;
  const auto first_frame = [&](const std::string& mosaic) {
    options.mosaic = mosaic;
    static EmissionTimeline* const still = [] {
      auto* made = new EmissionTimeline;
      made->add_monitor({.name = "back", .width_px = 8, .height_px = 6});
      auto picture = std::make_shared<Image16>(8, 6);
      for (size_t i = 0; i < picture->samples.size(); ++i)
        picture->samples[i] = static_cast<std::uint16_t>(i * 7919);
      made->add_picture("back",
                        {.scanout_start = monotonic_now() - std::chrono::seconds(1), .image = picture});
      made->set_horizon("back", monotonic_now() + std::chrono::hours(1));
      return made;
    }();
    const auto camera = SimCamera::create(options, *still).value();
    EXPECT_EQ(camera->describe().camera().mosaic(), mosaic);
    EXPECT_OK(camera->start(4.0));
    std::optional<CapturedFrame> frame;
    while (!frame) frame = camera->next(milliseconds(500));
    return frame->image().value();
  };
  const Image16 whole = first_frame(""), raw = first_frame("GBRG");
  EXPECT_EQ(raw.channels, 1);
  EXPECT_EQ(raw.samples, sampled(whole, Mosaic::parse("GBRG").value()).samples);
  options.mosaic = "RGBG";
  EXPECT_TRUE(absl::IsInvalidArgument(SimCamera::create(options, changing_light()).status()));
}

TEST(SimCamera, SeesAMovingSceneWhereItIsByTheCamerasClock) {
  constexpr int kSide_px = 24;
  EmissionTimeline timeline;
  timeline.add_monitor({.name = "back", .width_px = kSide_px, .height_px = kSide_px});
  auto picture = std::make_shared<Image16>(kSide_px, kSide_px);
  RadianceImage shown(kSide_px, kSide_px);
  for (size_t i = 0; i < shown.samples.size(); ++i) {
    picture->samples[i] = static_cast<std::uint16_t>(i * 7919);
    shown.samples[i] = radiance_of(picture->samples[i]);
  }
  timeline.add_picture("back",
                       {.scanout_start = monotonic_now() - std::chrono::seconds(1), .image = picture});
  timeline.set_horizon("back", monotonic_now() + std::chrono::hours(1));
  const StageTransports stage =
      build_phases("wobble", {{"back", {kSide_px, kSide_px}}}, kSide_px, kSide_px).value();
  SimCameraOptions options;
  options.scene = "wobble";
  options.width_px = options.height_px = kSide_px;
  options.frame_rate_hz = 100.0;
  options.sensor = {.read_sd = 0.0, .gain = 0.0, .bits = 16, .full_scale_exposure_ms = 4.0};
  options.clock = NodeClock(milliseconds(512), 0.0);
  const auto camera = SimCamera::create(options, timeline).value();
  ASSERT_OK(camera->start(4.0));
  std::set<int> phases;
  for (const bool object : {false, true}) {
    camera->move(object);
    // These frames cover a third of a turn.
    for (int i = 0; i < 40; ++i) {
      const CapturedFrame frame = camera->next(milliseconds(1000)).value();
      const int phase = motion_of("wobble").phase_at(
          nanoseconds((frame.taken.exposure_start_ns() + frame.taken.exposure_end_ns()) / 2));
      phases.insert(phase);
      const RadianceImage truth =
          (object ? *stage.phases[phase] : *stage.empty).respond(std::vector<RadianceImage>{shown});
      const Image16 image = frame.image().value();
      for (size_t s = 0; s < truth.samples.size(); ++s)
        ASSERT_NEAR(image.samples[s], 65535.0f * truth.samples[s], 1.0) << i;  // rounded
    }
  }
  EXPECT_GT(phases.size(), 8u);
}

TEST(SimCamera, AutomaticsFollowTheLightOfTheFramesBeforeAndSayNothing) {
  // Black, then from one moment on a light red, which white balance turns gray.
  constexpr std::array<float, 3> kRed{0.6f, 0.3f, 0.3f};
  const nanoseconds exposure = milliseconds(1), period = milliseconds(2);
  EmissionTimeline timeline;
  timeline.add_monitor({.name = "back", .width_px = 4, .height_px = 4});
  auto picture = std::make_shared<Image16>(4, 4);
  for (size_t i = 0; i < picture->samples.size(); ++i) picture->samples[i] = code16_of(kRed[i % 3]);
  const nanoseconds step = monotonic_now() + milliseconds(20);
  timeline.add_picture("back", {.scanout_start = step, .image = picture});
  timeline.set_horizon("back", step + std::chrono::hours(1));
  for (const Automatics& automatics :
       {Automatics{.gain = true}, Automatics{.white_balance = true}, Automatics{true, true}}) {
    SimCameraOptions options;
    options.scene = "none";
    options.width_px = options.height_px = 4;
    options.frame_rate_hz = 500.0;
    options.sensor = {
        .read_sd = 0.0, .gain = 0.0, .bits = 16, .readout = nanoseconds(0), .full_scale_exposure_ms = 4.0};
    options.automatics = automatics;
    const auto camera = SimCamera::create(options, timeline).value();
    ASSERT_OK(camera->start(1.0));
    for (int i = 0; i < 30; ++i) {
      const CapturedFrame frame = camera->next(milliseconds(1000)).value();
      EXPECT_EQ(frame.taken.exposure_ms(), 1.0);
      EXPECT_EQ(frame.taken.gain(), 1.0);
      // A quarter of the full-scale exposure.
      const auto light_at = [&](nanoseconds start) {
        const double lit_ns = static_cast<double>((start + exposure - step).count());
        const auto share =
            0.25f * static_cast<float>(std::clamp(lit_ns / static_cast<double>(exposure.count()), 0.0, 1.0));
        return Colour{share * kRed[0], share * kRed[1], share * kRed[2]};
      };
      const nanoseconds start(frame.taken.exposure_start_ns());
      std::vector<Colour> before;
      for (int k = 1; k <= kFramesRemembered; ++k) before.push_back(light_at(start - k * period));
      const Colour light = light_at(start), gains = automatic_gains(automatics, before);
      const Image16 image = frame.image().value();
      for (int c = 0; c < 3; ++c) {
        const size_t place = c;
        // Half a 16-bit code times the gain, and a few float operations.
        EXPECT_NEAR(image.at(1, 1, c) / 65535.0, std::min(light[place] * gains[place], 1.0f), 5e-5);
      }
    }
  }
}

TEST(SimCamera, SeesAMonitorWhereItStands) {
  constexpr int kWidth_px = 32, kHeight_px = 24;
  EmissionTimeline timeline;
  timeline.add_monitor({.name = "back",
                        .width_px = kWidth_px,
                        .height_px = kHeight_px,
                        .scanout = milliseconds(1),
                        .lag = {},
                        .pitch_mm = 0.5});
  auto white = std::make_shared<Image16>(kWidth_px, kHeight_px);
  for (std::uint16_t& sample : white->samples) sample = 65535;
  const nanoseconds now = monotonic_now();
  timeline.add_picture("back", {.scanout_start = now - std::chrono::seconds(1), .image = white});
  timeline.set_horizon("back", now + std::chrono::hours(1));
  SimCameraOptions options;
  options.scene = "none";
  options.width_px = kWidth_px;
  options.height_px = kHeight_px;
  options.focal_px = 2.0 * kWidth_px;
  options.sensor.read_sd = options.sensor.gain = 0.0;
  const std::unique_ptr<SimCamera> camera = SimCamera::create(options, timeline).value();
  ASSERT_OK(camera->start(4.0));
  const auto share_lit = [&] {
    const Image16 seen = camera->next(milliseconds(1000))->image().value();
    double sum = 0.0;
    for (const std::uint16_t sample : seen.samples) sum += sample;
    return sum / static_cast<double>(seen.samples.size()) / 65535.0 / (4.0 / 4.5);
  };
  EXPECT_NEAR(share_lit(), 1.0, 1e-3);  // a code of 12 bits
  // Twice as far away, where its own place is two of its widths, 32 mm, from the camera.
  timeline.set_pose("back", now - std::chrono::hours(1), {.away_mm = 32.0});
  EXPECT_NEAR(share_lit(), 0.25, 1e-3);
  timeline.set_pose("back", now, {});
  EXPECT_NEAR(share_lit(), 1.0, 1e-3);
}

// What the camera says, until it is ready.
std::vector<double> shares_of(const Camera& camera) {
  std::vector<double> shares;
  for (v1::GetCameraResponse now = camera.describe(); now.has_preparation(); now = camera.describe()) {
    EXPECT_EQ(now.preparation().what(), "simulating the scene");
    shares.push_back(now.preparation().done());
    std::this_thread::yield();
  }
  return shares;
}

TEST(SimCamera, SaysHowFarItHasSimulatedItsSceneForEachPlaceOfTheMonitor) {
  EmissionTimeline timeline;
  timeline.add_monitor({.name = "back", .width_px = 64, .height_px = 48});
  SimCameraOptions options;
  options.scene = "wobble";
  const std::unique_ptr<SimCamera> camera = SimCamera::create(options, timeline).value();
  for (const double away_mm : {0.0, 10.0}) {
    timeline.set_pose("back", monotonic_now(), {.away_mm = away_mm});
    const std::vector<double> shares = shares_of(*camera);
    ASSERT_GT(shares.size(), 2u);
    EXPECT_EQ(shares.front(), 0.0);
    EXPECT_GT(shares.back(), 0.0);
    EXPECT_LE(shares.back(), 1.0);
    EXPECT_TRUE(std::ranges::is_sorted(shares));
    ASSERT_OK(camera->start(4.0));
    EXPECT_TRUE(camera->next(milliseconds(1000)));
    camera->stop();
  }
  timeline.set_pose("back", monotonic_now(), {});  // where it stood before
  EXPECT_FALSE(camera->describe().has_preparation());
}

TEST(SimCamera, WaitsForLightWhereItIsToCome) {
  EmissionTimeline timeline;
  SimCameraOptions options;
  options.scene = "none";
  EXPECT_FALSE(SimCamera::create(options, timeline).value()->describe().has_preparation());
  options.awaits_light = true;
  const std::unique_ptr<SimCamera> camera = SimCamera::create(options, timeline).value();
  const v1::GetCameraResponse described = camera->describe();
  EXPECT_EQ(described.preparation().what(), "waiting for the monitors' light");
  EXPECT_FALSE(described.preparation().has_done());
  const absl::Status status = camera->start(4.0);
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  timeline.add_monitor({.name = "back", .width_px = 8, .height_px = 6});
  (void)shares_of(*camera);
  EXPECT_OK(camera->start(4.0));
}

TEST(SimCamera, IsReadyToSayWhyItCannotSeeAScene) {
  EmissionTimeline timeline;
  timeline.add_monitor({.name = "desk", .width_px = 8, .height_px = 6});
  const std::unique_ptr<SimCamera> camera = SimCamera::create({}, timeline).value();
  (void)shares_of(*camera);
  const absl::Status status = camera->start(4.0);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
}

// All of it would take minutes. It ends after the rows that it is at.
TEST(SimCamera, StopsSimulatingWhenItEnds) {
  EmissionTimeline timeline;
  timeline.add_monitor({.name = "back", .width_px = 4096, .height_px = 4096});
  SimCameraOptions options;
  options.scene = "wobble";
  options.width_px = options.height_px = 4096;
  std::unique_ptr<SimCamera> camera = SimCamera::create(options, timeline).value();
  while (camera->describe().preparation().done() == 0.0) std::this_thread::yield();
  const nanoseconds ends = monotonic_now();
  camera = nullptr;
  EXPECT_LT(monotonic_now() - ends, std::chrono::seconds(10));
}

TEST(SimCamera, StandsOutsideOfTheScene) {
  SimCameraOptions options;
  options.focal_px = options.width_px - 1.0;
  const absl::Status status = SimCamera::create(options, changing_light()).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_NE(std::string(status.message()).find("--focal-length is 127; it must be 128 px or more"),
            std::string::npos)
      << status;
}

}  // namespace
}  // namespace glasswing
