#include "server/selftest/rig_findings.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

// 30 steps of 2 refreshes at 100 Hz: each is stable for 10 ms less 2 ms; 1 ms exposures with 1 ms readout,
// 500 a second.
TestCaptureTimes good_times() {
  TestCaptureTimes times{.shown = {},
                         .windows = {},
                         .frames = {},
                         .hold_refreshes = 2,
                         .exposure = milliseconds(1),
                         .frame_period = milliseconds(2),
                         .readout = milliseconds(1)};
  for (int step = 0; step < 30; ++step) {
    times.shown.push_back(
        {.monitor = "back", .step = step, .held = milliseconds(20), .period = milliseconds(10)});
    times.windows.push_back(
        {.step = step, .from = milliseconds(20 * step + 12), .until = milliseconds(20 * step + 20)});
  }
  for (int i = 0; i < 300; ++i) {
    times.frames.push_back({.sequence = 7 + i,
                            .start = milliseconds(2 * i),
                            .end = milliseconds(2 * i + 2),
                            .uncertainty = microseconds(50)});
  }
  return times;
}

TEST(RigFindings, AGoodRigIsGood) {
  const TestCaptureTimes times = good_times();
  for (const v1::Finding& finding :
       {judge_flips(times), judge_frames(times), judge_window(times, times.exposure, microseconds(50)),
        judge_proof(times), judge_clocks({{"a", microseconds(100)}, {"b", microseconds(200)}})}) {
    EXPECT_EQ(finding.level(), v1::FINDING_LEVEL_OK) << finding.text();
    EXPECT_EQ(finding.advice(), "");
  }
}

TEST(RigFindings, MissedFlipsAreCounted) {
  TestCaptureTimes times = good_times();
  times.shown[4].held = milliseconds(30);
  EXPECT_EQ(judge_flips(times).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_NE(judge_flips(times).text().find("1 of 30"), std::string::npos);
  for (size_t i = 0; i < 4; ++i) times.shown[i].held = milliseconds(30);
  EXPECT_EQ(judge_flips(times).level(), v1::FINDING_LEVEL_PROBLEM);
  // A faster monitor beside it shows a step for whole refreshes of its own: up to one more.
  times = good_times();
  times.shown[4] = {.monitor = "left", .step = 4, .held = milliseconds(21), .period = milliseconds(7)};
  EXPECT_EQ(judge_flips(times).level(), v1::FINDING_LEVEL_OK);
}

TEST(RigFindings, DroppedFramesAndWrongRatesAreNamed) {
  TestCaptureTimes times = good_times();
  std::erase_if(times.frames, [](const FrameTime& frame) { return frame.sequence % 10 == 0; });
  EXPECT_EQ(judge_frames(times).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_NE(judge_frames(times).text().find("dropped"), std::string::npos);
  std::erase_if(times.frames, [](const FrameTime& frame) { return frame.sequence % 2 == 0; });
  EXPECT_EQ(judge_frames(times).level(), v1::FINDING_LEVEL_PROBLEM);
  times = good_times();
  times.frame_period = milliseconds(1);
  EXPECT_EQ(judge_frames(times).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_NE(judge_frames(times).text().find("promises 1000.0"), std::string::npos);
  times.frames.clear();
  EXPECT_EQ(judge_frames(times).level(), v1::FINDING_LEVEL_PROBLEM);
}

// The window is 8 ms; 1 ms is readout and 0.1 ms uncertainty. A frame begins every 2 ms.
TEST(RigFindings, ExposuresMustFitWhatStandsStill) {
  const TestCaptureTimes times = good_times();
  const auto judged = [&](nanoseconds exposure) { return judge_window(times, exposure, microseconds(50)); };
  EXPECT_EQ(judged(microseconds(4900)).level(), v1::FINDING_LEVEL_OK);
  EXPECT_EQ(judged(microseconds(4901)).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_NE(judged(microseconds(5900)).text().find("50 of 100"), std::string::npos)
      << judged(microseconds(5900)).text();
  EXPECT_NE(judged(microseconds(5900)).advice().find("hold_refreshes to 3, or exposure_ms to 4.90"),
            std::string::npos)
      << judged(microseconds(5900)).advice();
  EXPECT_EQ(judged(microseconds(6900)).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_EQ(judged(microseconds(6901)).level(), v1::FINDING_LEVEL_PROBLEM);
  // 26.1 ms are 18.1 ms too much: two more refreshes.
  EXPECT_NE(judged(milliseconds(25)).advice().find("hold_refreshes to 4, or exposure_ms to 6.90"),
            std::string::npos)
      << judged(milliseconds(25)).advice();
  // No exposure makes up for a readout longer than the window.
  TestCaptureTimes slow = times;
  slow.readout = milliseconds(9);
  EXPECT_EQ(judge_window(slow, milliseconds(1), microseconds(50)).advice(), "set hold_refreshes to 3");
}

// Two refreshes of 10 ms.
TEST(RigFindings, ATriggeredCameraMustBeReadyForEachPicture) {
  TestCaptureTimes times = good_times();
  times.triggered = true;
  times.frame_period = milliseconds(20);
  EXPECT_EQ(judge_window(times, times.exposure, microseconds(50)).level(), v1::FINDING_LEVEL_OK);
  times.frame_period = milliseconds(31);
  const v1::Finding late = judge_window(times, times.exposure, microseconds(50));
  EXPECT_EQ(late.level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_NE(late.text().find("shown for 20.00 ms, and the camera is ready again after 31.00 ms"),
            std::string::npos)
      << late.text();
  EXPECT_EQ(late.advice(), "set hold_refreshes to 4");
}

TEST(RigFindings, TheShareOfProvenStepsDecides) {
  TestCaptureTimes times = good_times();
  const auto level_with = [&](int every) {
    TestCaptureTimes some = times;
    for (size_t i = 0; i < some.windows.size(); ++i) {
      if (static_cast<int>(i) % 10 >= every) some.windows[i].until = some.windows[i].from;
    }
    return judge_proof(some).level();
  };
  EXPECT_EQ(level_with(10), v1::FINDING_LEVEL_OK);
  EXPECT_EQ(level_with(5), v1::FINDING_LEVEL_WARNING);
  EXPECT_EQ(level_with(1), v1::FINDING_LEVEL_PROBLEM);
  times.windows.clear();
  EXPECT_EQ(judge_proof(times).level(), v1::FINDING_LEVEL_PROBLEM);
}

TEST(RigFindings, PoorClocksAreNamed) {
  EXPECT_EQ(judge_clocks({{"a", milliseconds(2)}}).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_EQ(judge_clocks({{"a", milliseconds(2)}, {"b", milliseconds(3)}}).level(),
            v1::FINDING_LEVEL_PROBLEM);
}

TEST(RigFindings, ThePatchIsReadOrElseWhy) {
  v1::DisplayMonitor monitor;
  monitor.set_name("back");
  EXPECT_NE(judge_patch(monitor, 0, {}).advice().find("--patch-rows"), std::string::npos);
  monitor.set_patch_rows(8);
  EXPECT_EQ(judge_patch(monitor, 10, {}).level(), v1::FINDING_LEVEL_OK);
  EXPECT_EQ(judge_patch(monitor, 9, {}).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_NE(judge_patch(monitor, 9, {}).text().find("only 9 of its 10"), std::string::npos);
  v1::UnseenPatch patch;
  patch.set_reason("the camera does not see it");
  const v1::Finding unseen = judge_patch(monitor, 10, patch);
  EXPECT_EQ(unseen.level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_NE(unseen.advice().find("--patch-rows back=0"), std::string::npos) << unseen.advice();
  patch.set_contradicts(true);
  EXPECT_EQ(judge_patch(monitor, 10, patch).level(), v1::FINDING_LEVEL_PROBLEM);
}

TEST(RigFindings, LightIsMeasuredOrTakenForLinear) {
  v1::Camera camera;
  camera.set_response("linear");
  EXPECT_EQ(judge_camera_light(camera, std::nullopt, milliseconds(4)).level(), v1::FINDING_LEVEL_OK);
  camera.set_response("unknown");
  EXPECT_EQ(judge_camera_light(camera, std::nullopt, milliseconds(4)).advice(), "glasswing calibrate camera");
  v1::CameraCalibration calibration;
  calibration.set_white_ms(4.5);
  EXPECT_EQ(judge_camera_light(camera, calibration, milliseconds(4)).level(), v1::FINDING_LEVEL_OK);
  EXPECT_EQ(judge_camera_light(camera, calibration, milliseconds(5)).level(), v1::FINDING_LEVEL_WARNING);
  v1::DisplayMonitor monitor;
  monitor.set_name("back");
  EXPECT_EQ(judge_monitor_light(monitor, std::nullopt).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_EQ(judge_monitor_light(monitor, v1::DisplayCalibration()).level(), v1::FINDING_LEVEL_OK);
  monitor.set_bits(16);  // as an ideal simulated one, which no curve can be measured of
  EXPECT_EQ(judge_monitor_light(monitor, std::nullopt).level(), v1::FINDING_LEVEL_OK);
}

TEST(RigFindings, SyncIsMeasuredOrOnlyDeclared) {
  v1::DisplayMonitor declared;
  declared.set_name("back");
  declared.set_optical_lag_ns(3'000'000);
  declared.set_settle_ns(1'000'000);
  EXPECT_EQ(judge_sync(declared, std::nullopt).level(), v1::FINDING_LEVEL_WARNING);
  v1::MonitorSync measured;
  measured.set_lag_ns(3'100'000);
  measured.set_settle_ns(200'000);
  measured.set_error_ns(10'000);
  EXPECT_EQ(judge_sync(declared, measured).level(), v1::FINDING_LEVEL_OK);
  measured.set_lag_ns(7'100'000);
  EXPECT_EQ(judge_sync(declared, measured).level(), v1::FINDING_LEVEL_WARNING);
  EXPECT_NE(judge_sync(declared, measured).text().find("7.10 ms"), std::string::npos);
}

TEST(RigFindings, RetakesAreAdvisedByTheirCommonestCause) {
  v1::Session session;
  session.set_name("vase");
  session.set_step_count(300);
  EXPECT_FALSE(judge_retakes(session));
  const auto add = [&](v1::RetakeCause cause, int count) {
    session.set_retaken_count(session.retaken_count() + count);
    v1::RetakeCount& retakes = *session.add_retakes();
    retakes.set_cause(cause);
    retakes.set_count(count);
  };
  add(v1::RETAKE_CAUSE_WRONG_ID, 3);
  EXPECT_FALSE(judge_retakes(session)) << "a few are normal";
  add(v1::RETAKE_CAUSE_TOO_LATE, 480);
  const std::optional<v1::Finding> finding = judge_retakes(session);
  ASSERT_TRUE(finding);
  EXPECT_EQ(finding->text(),
            "session vase repeated its 300 steps 483 times; frame too late: 480, wrong id: 3");
  EXPECT_EQ(finding->advice(), retake_advice(v1::RETAKE_CAUSE_TOO_LATE));
  add(v1::RETAKE_CAUSE_ID_UNREADABLE, 600);
  EXPECT_NE(judge_retakes(session)->text().find("; id patch not readable: 600, frame too late: 480"),
            std::string::npos);
  EXPECT_NE(judge_retakes(session)->advice().find("six rows of the camera's picture"), std::string::npos);
}

}  // namespace
}  // namespace glasswing
