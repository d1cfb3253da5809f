#include "display-node/sim_display.h"

#include <thread>

#include "tests/display-node/display_contract.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

ScreenInfo screen(const std::string& name, double refresh_hz) {
  return {.name = name,
          .width_px = 4,
          .height_px = 3,
          .refresh_hz = refresh_hz,
          .scanout = nanoseconds(static_cast<std::int64_t>(1e9 / refresh_hz)),
          .lag = milliseconds(3),
          .settle = milliseconds(1)};
}

std::unique_ptr<SimDisplay> make_sim(double missed_flips) {
  return std::make_unique<SimDisplay>(std::vector{screen("back", 200.0), screen("left", 144.0)},
                                      SimDisplay::Faults{.seed = 7, .missed_flips = missed_flips});
}

INSTANTIATE_TEST_SUITE_P(Sim, DisplayContract,
                         testing::Values([] { return make_sim(0.0); }, [] { return make_sim(0.4); }));

Picture gray(float value) {
  auto image = std::make_shared<RadianceImage>(4, 3);
  image->samples.assign(image->samples.size(), value);
  return image;
}

// Asked for long enough ahead that no scheduler makes it late.
constexpr nanoseconds kAhead = milliseconds(200);

TEST(SimDisplay, ShowsAtTheFirstRefreshUnlessTheFlipIsMissed) {
  for (const bool missed : {false, true}) {
    const std::unique_ptr<SimDisplay> display = make_sim(missed ? 1.0 : 0.0);
    const nanoseconds at = monotonic_now() + kAhead;
    const std::vector<Scanout> scanouts = display->show({gray(1.0f), nullptr}, at).value();
    for (size_t m = 0; m < scanouts.size(); ++m) {
      const double late_refreshes =
          static_cast<double>((scanouts[m].start - at).count()) / period_ns_of(display->screens()[m]);
      EXPECT_GE(late_refreshes, missed ? 0.999 : 0.0);
      EXPECT_LE(late_refreshes, missed ? 2.001 : 1.001);
    }
  }
}

TEST(SimDisplay, TapSeesWhatWasShownAndNothingStartsBeforeAHorizon) {
  constexpr int kShows = 40;
  const std::unique_ptr<SimDisplay> display = make_sim(0.3);
  std::vector<std::vector<Scanout>> shown;
  std::jthread shows([&] {
    for (int i = 1; i <= kShows; ++i) {
      const Picture picture = gray(static_cast<float>(i) / 64.0f);
      shown.push_back(display->show({picture, picture}, monotonic_now()).value());
    }
  });
  std::vector<std::vector<Emission>> seen(2);
  std::uint64_t cursor = 0;
  nanoseconds horizon{}, later_horizon{};
  std::vector<Emission> emissions;
  bool first = true;
  while (seen[0].empty() || seen[0].back().picture == nullptr ||
         seen[0].back().picture->samples[0] < static_cast<float>(kShows) / 64.0f) {
    ASSERT_TRUE(display->read_emissions(cursor, emissions, later_horizon, milliseconds(100)));
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
      EXPECT_EQ(seen[m][i].picture->samples[0], static_cast<float>(skipped + i + 1) / 64.0f);
    }
  }
}

// The new picture waits for its refresh; until then the old one gives the light.
TEST(SimDisplay, TapThatJoinsBeforeAFlipGetsThePictureStillOnScreen) {
  const std::unique_ptr<SimDisplay> display = make_sim(0.0);
  const std::vector<Scanout> old_start = display->show({gray(0.25f), nullptr}, monotonic_now()).value();
  std::uint64_t cursor = 0;
  nanoseconds horizon{};
  std::vector<Emission> emissions;
  ASSERT_TRUE(display->read_emissions(cursor, emissions, horizon, milliseconds(0)));
  std::jthread flip([&] { (void)display->show({gray(0.5f), nullptr}, monotonic_now() + 2 * kAhead); });
  do {
    ASSERT_TRUE(display->read_emissions(cursor, emissions, horizon, milliseconds(100)));
  } while (emissions.empty());

  std::uint64_t late_cursor = 0;
  ASSERT_TRUE(display->read_emissions(late_cursor, emissions, horizon, milliseconds(0)));
  std::erase_if(emissions, [](const Emission& emission) { return emission.monitor != 0; });
  ASSERT_EQ(emissions.size(), 2u);
  EXPECT_EQ(emissions[0].scanout_start, old_start[0].start);
  EXPECT_EQ(emissions[0].picture->samples[0], 0.25f);
  EXPECT_GT(emissions[1].scanout_start, horizon);
  EXPECT_EQ(emissions[1].picture->samples[0], 0.5f);
}

TEST(SimDisplay, TapThatFallsFarBehindIsTold) {
  SimDisplay display({screen("back", 1000.0)}, {});
  std::uint64_t cursor = 0;
  nanoseconds horizon{};
  std::vector<Emission> emissions;
  ASSERT_TRUE(display.read_emissions(cursor, emissions, horizon, milliseconds(0)));
  for (int i = 0; i < 300; ++i) (void)display.show({nullptr}, monotonic_now());
  EXPECT_FALSE(display.read_emissions(cursor, emissions, horizon, milliseconds(0)));
}

}  // namespace
}  // namespace glasswing
