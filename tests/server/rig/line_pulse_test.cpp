// Where line_pulse() places a camera's line in a picture, against a search over all times.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "server/rig/exposure_triggers.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kMaxLag_us = 40000;

struct Panel {
  double hz = 60.0;
  int lag_us = 0, settle_us = 0;
};

struct Case {
  std::vector<Panel> panels;  // one display node each; the first raises the line
  int hold_refreshes = 3, readout_us = 0, delay_us = 0;
  double exposure_ms = 4.0;
};

RigLinks links_of(const Case& each, const std::string& trigger = "Line1") {
  RigLinks links;
  for (size_t i = 0; i < each.panels.size(); ++i) {
    v1::Node node;
    node.set_name("display-" + std::to_string(i));
    node.set_address("127.0.0.1:1");
    auto display = std::make_shared<DisplayLink>(node);
    v1::DisplayMonitor& monitor = *display->info.add_monitors();
    monitor.set_name("m" + std::to_string(i));
    monitor.set_refresh_hz(each.panels[i].hz);
    monitor.set_optical_lag_ns(1000LL * each.panels[i].lag_us);
    monitor.set_settle_ns(1000LL * each.panels[i].settle_us);
    links.displays.push_back(std::move(display));
  }
  links.displays.front()->info.set_line("command:raise");
  links.camera_info.set_trigger(trigger);
  links.camera_info.set_readout_ns(1000LL * each.readout_us);
  links.camera_info.set_line_delay_ns(1000LL * each.delay_us);
  return links;
}

// The first and last microsecond at which the line may rise; empty: none.
std::optional<std::pair<int, int>> found(const Case& each) {
  const auto slowest = std::ranges::min_element(each.panels, {}, &Panel::hz);
  const double hold_us = each.hold_refreshes * 1e6 / slowest->hz;
  std::optional<std::pair<int, int>> range;
  // After the next picture has begun to be scanned out, if the monitors lag that much.
  for (int rises = 0; rises < static_cast<int>(hold_us) + kMaxLag_us; ++rises) {
    const double begins = rises + each.delay_us, ends = begins + 1e3 * each.exposure_ms + each.readout_us;
    const bool shows = std::ranges::all_of(each.panels, [&](const Panel& panel) {
      return begins >= 1e6 / panel.hz + panel.lag_us + panel.settle_us && ends <= hold_us + panel.lag_us;
    });
    if (shows) range = {range ? range->first : rises, rises};
  }
  return range;
}

TEST(LinePulse, IsInTheMiddleOfTheTimesThatASearchFinds) {
  std::mt19937 random(3);
  const auto between = [&](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(random);
  };
  constexpr double kRates[] = {24.0, 59.94, 60.0, 75.0, 120.0, 144.0};
  int placed = 0, refused = 0;
  for (int i = 0; i < 60; ++i) {
    Case each;
    each.hold_refreshes = between(2, 5);
    each.readout_us = between(0, 8000);
    each.delay_us = between(0, 40000);
    each.exposure_ms = between(1, 30);
    for (int n = between(1, 3); n > 0; --n)
      each.panels.push_back({kRates[between(0, 5)], between(0, kMaxLag_us), between(0, 12000)});
    const RigLinks links = links_of(each);
    const absl::StatusOr<std::optional<v1::LinePulse>> pulse =
        line_pulse(links, *links.displays.front(), each.hold_refreshes, each.exposure_ms);
    const auto range = found(each);
    if (range && range->second - range->first < 3) continue;  // decided by the search's step
    SCOPED_TRACE(testing::Message() << "case " << i);
    ASSERT_EQ(pulse.ok(), range.has_value()) << pulse.status();
    ++(range ? placed : refused);
    if (!range) {
      EXPECT_TRUE(absl::IsInvalidArgument(pulse.status()));
      continue;
    }
    ASSERT_TRUE(*pulse);
    const double after_us = static_cast<double>((*pulse)->after_ns()) / 1e3,
                 slack_us = static_cast<double>((*pulse)->slack_ns()) / 1e3;
    // The line cannot rise before the picture begins: then it rises with it.
    const double begins_us = each.delay_us + after_us;
    if (range->first > 0) {
      EXPECT_NEAR(after_us, (range->first + range->second) / 2.0, 1.0);
    } else {
      EXPECT_GE(after_us, 0.0);
      EXPECT_TRUE(after_us == 0.0 || begins_us > each.delay_us);
    }
    EXPECT_NEAR(after_us + slack_us, range->second, 1.0);
  }
  EXPECT_GT(placed, 15);
  EXPECT_GT(refused, 5);
}

TEST(LinePulse, OnlyTheDisplayWithTheLineRaisesItAndOnlyForACameraThatWaitsForIt) {
  const Case two{.panels = {Panel(), Panel()}};
  const RigLinks lined = links_of(two);
  EXPECT_TRUE(line_pulse(lined, *lined.displays[0], 3, 4.0).value());
  EXPECT_FALSE(line_pulse(lined, *lined.displays[1], 3, 4.0).value());
  for (const char* trigger : {"", "software"}) {
    const RigLinks other = links_of(two, trigger);
    EXPECT_FALSE(line_pulse(other, *other.displays[0], 3, 4.0).value()) << trigger;
  }
}

}  // namespace
}  // namespace glasswing
