#include "camera-node/sim_camera.h"

#include "tests/camera-node/camera_contract.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

// A monitor that changes every 50 ms, until long after the tests.
const EmissionTimeline& changing_light() {
  static const EmissionTimeline* const timeline = [] {
    auto* made = new EmissionTimeline;
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

std::unique_ptr<Camera> make_sim(double frame_rate_hz, double faults) {
  SimCameraOptions options;
  options.frame_rate_hz = frame_rate_hz;
  options.drop = options.duplicate = faults;
  return SimCamera::create(options, changing_light()).value();
}

INSTANTIATE_TEST_SUITE_P(Sim, CameraContract,
                         testing::Values([] { return make_sim(200.0, 0.0); },
                                         [] { return make_sim(50.0, 0.3); }));

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

}  // namespace
}  // namespace glasswing
