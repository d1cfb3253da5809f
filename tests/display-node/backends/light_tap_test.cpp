#include "display-node/backends/light_tap.h"

#include <thread>

#include "display-node/backends/sim_display.h"
#include "tests/display-node/backends/display_contract.h"
#include "tests/display-node/backends/simulated_screen.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

// A tap and the simulated screens behind it.
class TappedSim final : public Display {
 public:
  explicit TappedSim(double missed_flips)
      : sim_({small_screen("back", 200.0), small_screen("left", 144.0)},
             {.seed = 7, .missed_flips = missed_flips}),
        tap_(sim_) {}
  std::string backend() const override { return tap_.backend(); }
  const std::vector<ScreenInfo>& screens() const override { return tap_.screens(); }
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override {
    return tap_.show(pictures, at);
  }
  LightTap& tap() { return tap_; }

 private:
  SimDisplay sim_;
  LightTap tap_;
};

INSTANTIATE_TEST_SUITE_P(Tap, DisplayContract,
                         testing::Values([] { return std::make_unique<TappedSim>(0.2); }));

TEST(LightTap, SeesWhatWasShownAndNothingStartsBeforeAHorizon) {
  constexpr int kShows = 40;
  TappedSim display(0.3);
  std::vector<std::vector<Scanout>> shown;
  std::jthread shows([&] {
    for (int i = 1; i <= kShows; ++i) {
      const Picture picture = small_gray(i);
      shown.push_back(display.show({picture, picture}, monotonic_now()).value());
    }
  });
  std::vector<std::vector<Emission>> seen(2);
  std::uint64_t cursor = 0;
  nanoseconds horizon{}, later_horizon{};
  std::vector<Emission> emissions;
  bool first = true;
  while (seen[0].empty() || seen[0].back().picture == nullptr ||
         seen[0].back().picture->samples[0] < kShows) {
    ASSERT_TRUE(display.tap().read(cursor, emissions, later_horizon, milliseconds(100)));
    EXPECT_GE(later_horizon, horizon);
    for (const Emission& emission : emissions) {
      if (!first) {
        EXPECT_GE(emission.scanout_start, horizon);
      }
      seen[emission.monitor].push_back(emission);
    }
    horizon = later_horizon;
    first = false;
  }
  shows.join();
  for (size_t m = 0; m < 2; ++m) {
    std::erase_if(seen[m],
                  [](const Emission& emission) { return emission.picture == nullptr; });  // before the first
    const size_t skipped = shown.size() - seen[m].size();  // replaced before the tap was there
    for (size_t i = 0; i < seen[m].size(); ++i) {
      EXPECT_EQ(seen[m][i].scanout_start, shown[skipped + i][m].start);
      EXPECT_EQ(seen[m][i].picture->samples[0], skipped + i + 1);
    }
  }
}

// Until the new picture's scan-out has begun, the horizon must not pass its start.
TEST(LightTap, WhileAFlipIsUnderWayTheHorizonWaits) {
  TappedSim display(0.0);
  const std::vector<Scanout> old_start = display.show({small_gray(25), nullptr}, monotonic_now()).value();
  std::uint64_t cursor = 0;
  nanoseconds horizon{};
  std::vector<Emission> emissions;
  ASSERT_TRUE(display.tap().read(cursor, emissions, horizon, milliseconds(0)));
  ASSERT_EQ(emissions.size(), 2u);
  EXPECT_EQ(emissions[0].scanout_start, old_start[0].start);
  EXPECT_EQ(emissions[0].picture->samples[0], 25);
  std::vector<Scanout> new_start;
  std::jthread flip([&] {
    new_start = display.show({small_gray(50), nullptr}, monotonic_now() + milliseconds(50)).value();
  });
  nanoseconds dark_until = horizon;
  for (;;) {
    ASSERT_TRUE(display.tap().read(cursor, emissions, horizon, milliseconds(1)));
    if (!emissions.empty()) break;
    dark_until = horizon;
  }
  flip.join();
  EXPECT_LE(dark_until, new_start[0].start);
  EXPECT_EQ(emissions[0].scanout_start, new_start[0].start);
  EXPECT_EQ(emissions[0].picture->samples[0], 50);
}

TEST(LightTap, AReaderThatFallsFarBehindIsTold) {
  SimDisplay sim({small_screen("back", 1000.0)}, {});
  LightTap tap(sim);
  std::uint64_t cursor = 0;
  nanoseconds horizon{};
  std::vector<Emission> emissions;
  ASSERT_TRUE(tap.read(cursor, emissions, horizon, milliseconds(0)));
  for (int i = 0; i < 300; ++i) (void)tap.show({nullptr}, monotonic_now());
  EXPECT_FALSE(tap.read(cursor, emissions, horizon, milliseconds(0)));
}

TEST(LightTap, SeesWhereMonitorsStand) {
  TappedSim display(0.0);
  display.tap().place(1, {.tilt_deg = 20.0});
  std::uint64_t cursor = 0;
  std::vector<Emission> emissions;
  nanoseconds horizon{}, later{};
  ASSERT_TRUE(display.tap().read(cursor, emissions, horizon, milliseconds(0)));
  ASSERT_EQ(emissions.size(), 3u) << "two pictures, and the monitor that is not at its own place";
  EXPECT_EQ(emissions[2].monitor, 1u);
  EXPECT_EQ(emissions[2].scanout_start, nanoseconds(0)) << "always";
  EXPECT_EQ(emissions[2].pose, PanelPose{.tilt_deg = 20.0});
  display.tap().place(0, {.away_mm = 50.0});
  ASSERT_TRUE(display.tap().read(cursor, emissions, later, milliseconds(0)));
  ASSERT_EQ(emissions.size(), 1u);
  EXPECT_EQ(emissions[0].monitor, 0u);
  EXPECT_EQ(emissions[0].pose, PanelPose{.away_mm = 50.0});
  EXPECT_GE(emissions[0].scanout_start, horizon);
  EXPECT_LE(emissions[0].scanout_start, later);
}

}  // namespace
}  // namespace glasswing
