#include "core/sim/emission_timeline.h"

#include <gtest/gtest.h>

#include <thread>

namespace glasswing {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

EmissionMonitor monitor(const std::string& name) {
  return {.name = name, .width_px = 4, .height_px = 3, .scanout = milliseconds(16), .lag = milliseconds(5)};
}

EmittedPicture picture(nanoseconds start) {
  return {.scanout_start = start, .image = std::make_shared<Image16>(4, 3)};
}

TEST(EmissionTimeline, KnowsNothingWithoutMonitors) {
  const EmissionTimeline timeline;
  EXPECT_FALSE(timeline.wait_known_until(nanoseconds(0), nanoseconds(0)));
  EXPECT_TRUE(timeline.between(nanoseconds(0), seconds(1))->empty());
}

TEST(EmissionTimeline, KnowsAsFarAsTheSlowestMonitorPlusItsLag) {
  EmissionTimeline timeline;
  timeline.add_monitor(monitor("back"));
  timeline.add_monitor(monitor("left"));
  timeline.set_horizon("back", milliseconds(100));
  timeline.set_horizon("left", milliseconds(50));
  EXPECT_TRUE(timeline.wait_known_until(milliseconds(55), nanoseconds(0)));
  EXPECT_FALSE(timeline.wait_known_until(milliseconds(56), nanoseconds(0)));
  timeline.set_horizon("left", milliseconds(20));  // a horizon never moves back
  EXPECT_TRUE(timeline.wait_known_until(milliseconds(55), nanoseconds(0)));
}

TEST(EmissionTimeline, WakesWhoWaits) {
  EmissionTimeline timeline;
  timeline.add_monitor(monitor("back"));
  const std::jthread feeder([&] { timeline.set_horizon("back", seconds(1)); });
  EXPECT_TRUE(timeline.wait_known_until(seconds(1), hours(1)));
}

TEST(EmissionTimeline, GivesThePicturesThatTouchAnInterval) {
  EmissionTimeline timeline;
  timeline.add_monitor(monitor("back"));
  for (const int start_ms : {0, 100, 200, 300}) timeline.add_picture("back", picture(milliseconds(start_ms)));
  const auto starts = [&](nanoseconds from, nanoseconds until) {
    const std::vector<MonitorEmission> emissions = timeline.between(from, until).value();
    std::vector<nanoseconds> found;
    for (const EmittedPicture& p : emissions.at(0).pictures) found.push_back(p.scanout_start);
    return found;
  };
  // A picture is visible from its start + lag to its successor's start + lag + scanout.
  EXPECT_EQ(starts(milliseconds(130), milliseconds(150)), (std::vector<nanoseconds>{milliseconds(100)}));
  EXPECT_EQ(starts(milliseconds(120), milliseconds(150)),
            (std::vector<nanoseconds>{milliseconds(0), milliseconds(100)}));
  EXPECT_EQ(starts(milliseconds(130), milliseconds(205)), (std::vector<nanoseconds>{milliseconds(100)}));
  EXPECT_EQ(starts(milliseconds(130), milliseconds(206)),
            (std::vector<nanoseconds>{milliseconds(100), milliseconds(200)}));
  EXPECT_EQ(starts(seconds(5), seconds(6)), (std::vector<nanoseconds>{milliseconds(300)}));
  EXPECT_TRUE(starts(milliseconds(-50), milliseconds(5)).empty());
}

TEST(EmissionTimeline, GivesAPictureUntilTheNextHasSettled) {
  EmissionTimeline timeline;
  EmissionMonitor slow = monitor("back");
  slow.settle = milliseconds(10);
  timeline.add_monitor(slow);
  for (const int start_ms : {0, 100}) timeline.add_picture("back", picture(milliseconds(start_ms)));
  EXPECT_EQ(timeline.between(milliseconds(130), milliseconds(150))->at(0).pictures.size(), 2u);
  EXPECT_EQ(timeline.between(milliseconds(131), milliseconds(150))->at(0).pictures.size(), 1u);
}

TEST(EmissionTimeline, ForgetsWhatIsOlderThanItKeeps) {
  EmissionTimeline timeline(seconds(1));
  timeline.add_monitor(monitor("back"));
  for (int i = 0; i <= 50; ++i) timeline.add_picture("back", picture(i * milliseconds(100)));
  // The pictures that start in the last second, and the one visible at its beginning.
  const auto kept = timeline.between(milliseconds(4100), hours(1)).value().at(0).pictures;
  ASSERT_FALSE(kept.empty());
  EXPECT_LE(kept.front().scanout_start, milliseconds(4100));
  EXPECT_LE(kept.size(), 12u);
  EXPECT_EQ(kept.back().scanout_start, seconds(5));
  EXPECT_FALSE(timeline.between(milliseconds(3800), milliseconds(3900)));
}

// The light of an exposure is that of all pictures on it, or not known.
TEST(EmissionTimeline, ForgetsWhatTakesMoreMemoryThanItMay) {
  EmissionTimeline all,
      few(seconds(10), 4 * sizeof(std::uint16_t) * picture(seconds(0)).image->samples.size());
  for (EmissionTimeline* timeline : {&all, &few}) {
    timeline->add_monitor(monitor("back"));
    for (int i = 0; i <= 50; ++i) timeline->add_picture("back", picture(i * milliseconds(100)));
  }
  int known = 0;
  for (int ms = 0; ms < 5000; ms += 10) {
    const nanoseconds from = milliseconds(ms), until = milliseconds(ms + 50);
    const auto kept = few.between(from, until);
    if (!kept) continue;
    ++known;
    const auto truth = all.between(from, until).value();
    ASSERT_EQ(kept->at(0).pictures.size(), truth.at(0).pictures.size()) << ms;
    EXPECT_EQ(kept->at(0).pictures.front().scanout_start, truth.at(0).pictures.front().scanout_start) << ms;
  }
  EXPECT_GE(known, 20);  // of the last four pictures, 100 ms each
  EXPECT_LE(known, 40);
  EXPECT_FALSE(few.between(milliseconds(4000), milliseconds(4050)));
}

TEST(EmissionTimeline, ForgetsAMonitorThatIsAddedAgainOrCleared) {
  EmissionTimeline timeline;
  timeline.add_monitor(monitor("back"));
  timeline.add_picture("back", picture(nanoseconds(0)));
  timeline.set_horizon("back", seconds(1));
  timeline.add_monitor(monitor("back"));
  EXPECT_EQ(timeline.monitors().size(), 1u);
  EXPECT_TRUE(timeline.between(nanoseconds(0), seconds(1))->at(0).pictures.empty());
  EXPECT_FALSE(timeline.wait_known_until(milliseconds(100), nanoseconds(0)));
  timeline.clear();
  EXPECT_TRUE(timeline.monitors().empty());
}

TEST(EmissionTimeline, KnowsWhereAMonitorStoodInTheMiddleOfAnInterval) {
  EmissionTimeline timeline;
  timeline.add_monitor(monitor("back"));
  timeline.set_pose("back", seconds(1), {.away_mm = 5.0});
  timeline.set_pose("back", seconds(2), {.away_mm = 5.0, .tilt_deg = 20.0});
  const auto pose_between = [&](nanoseconds from, nanoseconds until) {
    return timeline.between(from, until)->at(0).monitor.pose;
  };
  EXPECT_EQ(pose_between(milliseconds(900), milliseconds(1098)), PanelPose());
  EXPECT_EQ(pose_between(milliseconds(900), milliseconds(1100)), PanelPose{.away_mm = 5.0});
  EXPECT_EQ(pose_between(milliseconds(1500), milliseconds(1600)), PanelPose{.away_mm = 5.0});
  EXPECT_EQ(timeline.monitors().at(0).pose, (PanelPose{.away_mm = 5.0, .tilt_deg = 20.0}));
  // Much later the poses of long ago are forgotten, but the one in force is not.
  timeline.set_pose("back", hours(1), {.turn_deg = 1.0});
  timeline.set_pose("back", hours(2), {.turn_deg = 2.0});
  EXPECT_EQ(pose_between(hours(2) - seconds(1), hours(2) - seconds(1)), PanelPose{.turn_deg = 1.0});
  timeline.add_monitor(monitor("back"));
  EXPECT_EQ(timeline.monitors().at(0).pose, PanelPose());
}

}  // namespace
}  // namespace glasswing
