#include "display-node/services/emission_service.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <thread>

#include "core/service/service.h"
#include "display-node/backends/sim_display.h"
#include "display-node/playback/player.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

ScreenInfo screen(const std::string& name, int width_px, int height_px, double refresh_hz, int bits = 16) {
  return {.name = name,
          .width_px = width_px,
          .height_px = height_px,
          .bits = bits,
          .refresh_hz = refresh_hz,
          .scanout = nanoseconds(static_cast<std::int64_t>(1e9 / refresh_hz)),
          .lag = milliseconds(3),
          .settle = milliseconds(1)};
}

class EmissionServiceTest : public testing::Test {
 protected:
  void serve(std::vector<ScreenInfo> screens, double missed_flips, TrueOptics optics = {}) {
    sim_ = std::make_unique<SimDisplay>(std::move(screens),
                                        SimDisplay::Faults{.seed = 3, .missed_flips = missed_flips});
    display_ = std::make_unique<LightTap>(*sim_);
    service_ = std::make_unique<EmissionServiceImpl>(*display_, optics);
    grpc::ServerBuilder builder;
    builder.RegisterService(service_.get());
    server_ = builder.BuildAndStart();
    stub_ = v1::EmissionService::NewStub(server_->InProcessChannel({}));
    set_deadline(context_, milliseconds(20'000));
    reader_ = stub_->WatchEmission(&context_, {});
  }
  ~EmissionServiceTest() override {
    context_.TryCancel();
    if (!finished_) (void)reader_->Finish();
    service_->stop();
    server_->Shutdown();
  }

  std::unique_ptr<SimDisplay> sim_;
  std::unique_ptr<LightTap> display_;
  std::unique_ptr<EmissionServiceImpl> service_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<v1::EmissionService::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::WatchEmissionResponse>> reader_;
  bool finished_ = false;
};

TEST_F(EmissionServiceTest, MonitorsComeFirstThenWhatIsOnScreenThenTime) {
  serve({screen("back", 8, 6, 200.0), screen("left", 4, 4, 144.0)}, 0.0);
  v1::WatchEmissionResponse event;
  for (const ScreenInfo& info : display_->screens()) {
    ASSERT_TRUE(reader_->Read(&event));
    ASSERT_TRUE(event.has_monitor());
    EXPECT_EQ(event.monitor().name(), info.name);
    EXPECT_EQ(event.monitor().width_px(), info.width_px);
    EXPECT_EQ(event.monitor().height_px(), info.height_px);
    EXPECT_EQ(event.monitor().scanout_ns(), info.scanout.count());
    EXPECT_EQ(event.monitor().lag_ns(), info.lag.count());
    EXPECT_EQ(event.monitor().settle_ns(), info.settle.count());
  }
  for (const ScreenInfo& info : display_->screens()) {
    ASSERT_TRUE(reader_->Read(&event));
    ASSERT_TRUE(event.has_picture());
    EXPECT_EQ(event.picture().monitor(), info.name);
    EXPECT_EQ(event.picture().chunk(), std::string(info.width_px * info.height_px * 6, '\0'));
  }
  // The horizon advances even if nothing is shown, but never past now.
  std::map<std::string, std::int64_t> horizons;
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(reader_->Read(&event));
    ASSERT_TRUE(event.has_horizon());
    EXPECT_GT(event.horizon().until_ns(), horizons[event.horizon().monitor()]);
    EXPECT_LE(event.horizon().until_ns(), monotonic_now().count());
    horizons[event.horizon().monitor()] = event.horizon().until_ns();
  }
  EXPECT_EQ(horizons.size(), 2u);
}

TEST_F(EmissionServiceTest, TheLightMayNotBeWhatTheScreenSaysOfItself) {
  serve({screen("back", 8, 6, 200.0)}, 0.0,
        {.lag = milliseconds(9), .settle = milliseconds(4), .flicker = {.amplitude = 0.2, .hz = 120.0}});
  v1::WatchEmissionResponse event;
  ASSERT_TRUE(reader_->Read(&event));
  EXPECT_EQ(nanoseconds(event.monitor().lag_ns()), milliseconds(9));
  EXPECT_EQ(nanoseconds(event.monitor().settle_ns()), milliseconds(4));
  EXPECT_EQ(event.monitor().flicker(), 0.2);
  EXPECT_EQ(event.monitor().flicker_hz(), 120.0);
  EXPECT_EQ(display_->screens()[0].lag, milliseconds(3));
}

// The samples of the next whole picture.
std::vector<std::uint16_t> next_picture(grpc::ClientReader<v1::WatchEmissionResponse>& reader) {
  v1::WatchEmissionResponse event;
  std::string pixels;
  while (reader.Read(&event)) {
    if (!event.has_picture()) continue;
    pixels += event.picture().chunk();
    if (!event.picture().last_chunk()) continue;
    std::vector<std::uint16_t> samples(pixels.size() / 2);
    std::memcpy(samples.data(), pixels.data(), pixels.size());
    return samples;
  }
  return {};
}

TEST_F(EmissionServiceTest, ThePanelMakesLightOfCodes) {
  serve({screen("back", 16, 16, 200.0, 8)}, 0.0, {.panel = {.gamma = 2.2, .black = 0.003}});
  const auto light_of = [](int code) { return 0.003 + 0.997 * std::pow(code / 255.0, 2.2); };
  // Stored in steps of 1/65535, computed in floats.
  constexpr double kRounding = 0.5 / 65535.0 + 1e-6;
  const std::vector<std::uint16_t> dark = next_picture(*reader_);
  ASSERT_EQ(dark.size(), 16u * 16u * 3u);
  for (const std::uint16_t sample : dark) EXPECT_NEAR(sample / 65535.0, light_of(0), kRounding);
  auto picture = std::make_shared<Image<std::uint16_t>>(16, 16);
  for (size_t i = 0; i < picture->samples.size(); ++i)
    picture->samples[i] = static_cast<std::uint16_t>(i / 3);
  ASSERT_OK(display_->show({picture}, monotonic_now()));
  const std::vector<std::uint16_t> light = next_picture(*reader_);
  ASSERT_EQ(light.size(), picture->samples.size());
  for (size_t i = 0; i < light.size(); ++i)
    EXPECT_NEAR(light[i] / 65535.0, light_of(picture->samples[i]), kRounding);
}

TEST_F(EmissionServiceTest, DriftsFromPictureToPicture) {
  const nanoseconds before = monotonic_now();
  serve({screen("back", 1, 1, 200.0)}, 0.0, {.panel = {.drift_per_minute = 0.5}});
  const nanoseconds after = monotonic_now();  // the panel was switched on between the two
  ASSERT_EQ(next_picture(*reader_), std::vector<std::uint16_t>(3, 0));
  auto white = std::make_shared<Image<std::uint16_t>>(1, 1);
  std::fill(white->samples.begin(), white->samples.end(), std::uint16_t{65535});
  const std::vector<Scanout> scanouts = display_->show({white}, after + milliseconds(300)).value();
  const auto left = [&](nanoseconds switched_on) {
    const std::chrono::duration<double, std::ratio<60>> lit = scanouts[0].start - switched_on;
    return std::pow(0.5, lit.count());
  };
  constexpr double kRounding = 0.5 / 65535.0 + 1e-6;
  const double light = next_picture(*reader_).at(0) / 65535.0;
  EXPECT_GE(light, left(before) - kRounding);
  EXPECT_LE(light, left(after) + kRounding);
}

// The light and the player's reports agree on every picture and time, missed flips included; pictures larger
// than a chunk arrive whole.
TEST_F(EmissionServiceTest, LightIsWhatThePlayerReports) {
  constexpr int kSteps = 25;
  serve({screen("back", 700, 300, 100.0), screen("left", 4, 4, 144.0)}, 0.3);
  v1::LoadProgramRequest request;
  request.set_program("p");
  request.set_hold_refreshes(2);
  for (int i = 0; i < kSteps; ++i) {
    v1::ProgramStep& step = *request.add_steps();
    step.set_step(i);
    v1::Stimulus& stimulus = *step.add_stimuli();
    stimulus.set_kind("solid");
    stimulus.set_panel(i % 2 == 0 ? "back" : "left");
    for (int c = 0; c < 3; ++c) stimulus.add_colour((i + 1) / 64.0);
  }
  const Program program = Program::create(request, display_->screens(), ImageStore()).value();
  std::vector<v1::Presentation> reports;
  v1::WatchEmissionResponse event;
  do {
    ASSERT_TRUE(reader_->Read(&event));
  } while (!event.has_horizon());  // the tap has seen the black before the program
  std::jthread player([&] {
    EXPECT_OK(play(program, *display_, monotonic_now() + milliseconds(300), {}, {},
                   [&](const v1::Presentation& report) { reports.push_back(report); }));
  });

  struct Light {
    std::int64_t start_ns;
    std::uint16_t code;
  };
  std::map<std::string, std::vector<Light>> light;
  std::map<std::string, std::int64_t> horizons;
  std::string pixels;
  const auto playing = [&] { return light["back"].size() + light["left"].size() < 2 * (kSteps + 1); };
  while (playing() && reader_->Read(&event)) {
    if (event.has_horizon()) horizons[event.horizon().monitor()] = event.horizon().until_ns();
    if (!event.has_picture()) continue;
    const v1::EmittedPicture& picture = event.picture();
    EXPECT_LE(picture.chunk().size(), size_t{1} << 20);
    pixels += picture.chunk();
    if (!picture.last_chunk()) continue;
    EXPECT_EQ(pixels.size(), picture.monitor() == "back" ? 700u * 300u * 6u : 4u * 4u * 6u);
    Light emitted{.start_ns = picture.scanout_start_ns(), .code = 0};
    std::memcpy(&emitted.code, &pixels[pixels.size() - 2], 2);
    EXPECT_GE(emitted.start_ns, horizons[picture.monitor()]);
    light[picture.monitor()].push_back(emitted);
    pixels.clear();
  }
  player.join();
  ASSERT_EQ(reports.size(), 2u * kSteps);
  for (const v1::Presentation& report : reports) {
    const std::vector<Light>& emitted = light[report.monitor()];
    const size_t place = report.step();
    ASSERT_LT(place + 1, emitted.size());
    const bool lit = (report.monitor() == "back") == (report.step() % 2 == 0);
    EXPECT_EQ(emitted[place].code, lit ? code16_of(static_cast<float>(report.step() + 1) / 64.0f) : 0);
    EXPECT_EQ(emitted[place].start_ns, report.scanout_start_ns());
    EXPECT_EQ(emitted[place + 1].start_ns, report.replaced_ns());
  }
}

TEST_F(EmissionServiceTest, ReaderThatStallsIsDroppedAndHoldsNobodyUp) {
  serve({screen("back", 700, 300, 1000.0)}, 0.0);
  v1::WatchEmissionResponse event;
  ASSERT_TRUE(reader_->Read(&event));
  for (int i = 0; i < 400; ++i) ASSERT_OK(display_->show({nullptr}, monotonic_now()));
  while (reader_->Read(&event)) {
  }
  EXPECT_EQ(reader_->Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  finished_ = true;
}

TEST_F(EmissionServiceTest, SaysWhereAMonitorStandsFromWhenOn) {
  serve({screen("back", 8, 6, 200.0)}, 0.0, {.pitch_mm = 0.25});
  v1::WatchEmissionResponse event;
  ASSERT_TRUE(reader_->Read(&event));
  EXPECT_EQ(event.monitor().pitch_mm(), 0.25);
  const nanoseconds before = monotonic_now();
  display_->place(0, {.away_mm = 50.0, .tilt_deg = 10.0, .turn_deg = -5.0});
  do {
    ASSERT_TRUE(reader_->Read(&event));
  } while (!event.has_pose());
  EXPECT_EQ(event.pose().monitor(), "back");
  EXPECT_EQ(event.pose().away_mm(), 50.0);
  EXPECT_EQ(event.pose().tilt_deg(), 10.0);
  EXPECT_EQ(event.pose().turn_deg(), -5.0);
  // If it was placed before the first read, it always stood there.
  EXPECT_TRUE(event.pose().since_ns() == 0 || event.pose().since_ns() >= before.count());
}

}  // namespace
}  // namespace glasswing
