#include "display-node/playback/player.h"

#include <gtest/gtest.h>

#include <cmath>
#include <future>

#include "display-node/backends/sim_display.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

constexpr int kHold = 3;

ScreenInfo screen(const std::string& name, double refresh_hz) {
  return {.name = name,
          .width_px = 2,
          .height_px = 2,
          .refresh_hz = refresh_hz,
          .scanout = nanoseconds(static_cast<std::int64_t>(1e9 / refresh_hz)),
          .lag = {},
          .settle = {}};
}

// Step i is gray i / 64 on "back"; "left" stays black.
Program program_of(int steps, int hold_refreshes, const std::vector<ScreenInfo>& screens) {
  v1::LoadProgramRequest request;
  request.set_program("p");
  request.set_hold_refreshes(hold_refreshes);
  for (int i = 1; i <= steps; ++i) {
    v1::ProgramStep& step = *request.add_steps();
    step.set_step(100 + i);
    v1::Stimulus& stimulus = *step.add_stimuli();
    stimulus.set_kind("solid");
    stimulus.set_panel("back");
    for (int c = 0; c < 3; ++c) stimulus.add_colour(i / 64.0);
  }
  return Program::create(request, screens, ImageStore()).value();
}

// Screens that compute their refreshes instead of waiting for them: only the player's own waits take time.
class FakeDisplay final : public Display {
 public:
  struct Shown {
    int gray;  // code of "back"; 0 is black
    nanoseconds at;
    std::vector<Scanout> scanouts;
  };

  std::string backend() const override { return "fake"; }
  const std::vector<ScreenInfo>& screens() const override { return screens_; }
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override {
    if (fails_at_ == static_cast<int>(shown.size())) return absl::InternalError("the cable came off");
    EXPECT_EQ(pictures.size(), screens_.size());
    std::vector<Scanout> scanouts;
    for (size_t m = 0; m < screens_.size(); ++m) {
      const double period_ns = 1e9 / screens_[m].refresh_hz;
      const double refresh = std::ceil(static_cast<double>(at.count()) / period_ns) + missed(shown.size(), m);
      scanouts.push_back(
          {.start = nanoseconds(std::llround(refresh * period_ns)), .uncertainty = nanoseconds(10)});
    }
    shown.push_back(
        {.gray = pictures[0] == nullptr ? 0 : pictures[0]->samples[0], .at = at, .scanouts = scanouts});
    EXPECT_EQ(pictures[1], nullptr);
    if (on_show) on_show();
    return scanouts;
  }

  // Every third flip of "back" is two refreshes late.
  int missed(size_t index, size_t monitor) const { return misses && monitor == 0 && index % 3 == 1 ? 2 : 0; }

  bool misses = false;
  int fails_at_ = -1;
  std::function<void()> on_show;
  std::vector<Shown> shown;

 private:
  const std::vector<ScreenInfo> screens_{screen("back", 1000.0), screen("left", 700.0)};
};

nanoseconds soon() {
  return monotonic_now() + milliseconds(200);
}

class Player : public testing::Test {
 protected:
  absl::Status play_steps(int steps, nanoseconds start, int hold_refreshes = kHold, nanoseconds step = {}) {
    return play(program_of(steps, hold_refreshes, display_.screens()), display_, start, step,
                stop_.get_token(),
                [this](const v1::Presentation& presentation) { reports_.push_back(presentation); });
  }

  FakeDisplay display_;
  std::stop_source stop_;
  std::vector<v1::Presentation> reports_;
};

TEST_F(Player, ShowsEveryStepInOrderAndThenBlack) {
  const nanoseconds start = soon();
  ASSERT_OK(play_steps(8, start));
  ASSERT_EQ(display_.shown.size(), 9u);
  EXPECT_EQ(display_.shown[0].at, start);
  for (size_t i = 0; i < 8; ++i)
    EXPECT_EQ(display_.shown[i].gray, code16_of(static_cast<float>(i + 1) / 64.0f));
  EXPECT_EQ(display_.shown[8].gray, 0);
}

TEST_F(Player, ReportsWhenEachStepWasReallyShownAndReplaced) {
  for (const bool misses : {false, true}) {
    display_.misses = misses;
    display_.shown.clear();
    reports_.clear();
    ASSERT_OK(play_steps(8, soon()));
    ASSERT_EQ(reports_.size(), 16u);
    for (size_t i = 0; i < reports_.size(); ++i) {
      const v1::Presentation& report = reports_[i];
      const size_t step = i / 2, monitor = i % 2;
      const ScreenInfo& info = display_.screens()[monitor];
      const nanoseconds from = display_.shown[step].scanouts[monitor].start;
      const nanoseconds until = display_.shown[step + 1].scanouts[monitor].start;
      EXPECT_EQ(report.step(), 101 + static_cast<int>(step));
      EXPECT_EQ(report.monitor(), info.name);
      EXPECT_EQ(report.scanout_start_ns(), from.count());
      EXPECT_EQ(report.scanout_end_ns(), (from + info.scanout).count());
      EXPECT_EQ(report.replaced_ns(), until.count());
      EXPECT_EQ(report.uncertainty_ns(), 10);
      EXPECT_GE(report.refreshes(), kHold);
      // Whole refreshes, up to the rounding of both ends to a ns.
      EXPECT_NEAR(report.refreshes() * 1e9 / info.refresh_hz, static_cast<double>((until - from).count()),
                  2.0);
    }
    // "left", the slower monitor, alone sets the pace.
    if (!misses) {
      EXPECT_EQ(reports_[1].refreshes(), kHold);
    }
    // A flip that is two refreshes late keeps the previous step on screen for two more.
    if (misses) {
      EXPECT_GE(reports_[0].refreshes(), kHold + 2);
    }
  }
}

TEST_F(Player, KeepsToATimetableAndIsOnTimeAgainAfterAFlipThatWasLate) {
  display_.misses = true;
  const nanoseconds start = soon(), step = std::chrono::microseconds(7300);
  ASSERT_OK(play_steps(8, start, kHold, step));
  ASSERT_EQ(display_.shown.size(), 9u);
  for (size_t i = 0; i < display_.shown.size(); ++i)
    EXPECT_EQ(display_.shown[i].at, start + static_cast<int>(i) * step) << i;
}

TEST_F(Player, NeverStartsLate) {
  const absl::Status status = play_steps(3, monotonic_now() - nanoseconds(1));
  EXPECT_TRUE(absl::IsDeadlineExceeded(status)) << status;
  EXPECT_TRUE(display_.shown.empty());
  EXPECT_TRUE(reports_.empty());
}

TEST_F(Player, StopsAtTheNextRefreshNotAtTheStepsEnd) {
  display_.on_show = [this] { stop_.request_stop(); };
  const absl::Status status = play_steps(3, soon(), 600);
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  ASSERT_EQ(display_.shown.size(), 2u);
  EXPECT_EQ(display_.shown[1].gray, 0);
  EXPECT_LE(display_.shown[1].at, std::max(monotonic_now(), display_.shown[0].scanouts[0].start));
  EXPECT_EQ(reports_.size(), 2u) << "what was shown is reported, cut short or not";
}

TEST_F(Player, StoppedOnItsLastStepIsNotSaidToHaveEndedWell) {
  display_.on_show = [this] { stop_.request_stop(); };
  EXPECT_TRUE(absl::IsCancelled(play_steps(1, soon(), 600)));
}

TEST(PlayerOnScreens, StopsWhileItWaitsToStart) {
  SimDisplay display({screen("back", 200.0)}, {});
  const Program program = program_of(1, 2, display.screens());
  std::stop_source stop;
  const nanoseconds start = monotonic_now() + hours(1);
  std::future<absl::Status> played = std::async(std::launch::async, [&] {
    return play(program, display, start, {}, stop.get_token(),
                [](const v1::Presentation&) { ADD_FAILURE(); });
  });
  EXPECT_EQ(played.wait_for(milliseconds(20)), std::future_status::timeout);
  stop.request_stop();
  EXPECT_TRUE(absl::IsCancelled(played.get()));
}

TEST(PlayerOnScreens, HoldsItsLastStepUntilItIsStopped) {
  constexpr double kRefresh_hz = 200.0;
  SimDisplay display({screen("back", kRefresh_hz)}, {});
  const Program program = program_of(2, 2, display.screens());
  std::stop_source stop;
  std::vector<v1::Presentation> reports;
  std::promise<void> held;
  std::future<absl::Status> played = std::async(std::launch::async, [&] {
    return play(
        program, display, soon(), {}, stop.get_token(),
        [&](const v1::Presentation& report) {
          reports.push_back(report);
          if (report.replaced_ns() == 0) held.set_value();
        },
        true);
  });
  held.get_future().wait();
  // Many times longer than the step would last.
  EXPECT_EQ(played.wait_for(milliseconds(200)), std::future_status::timeout);
  stop.request_stop();
  EXPECT_TRUE(absl::IsCancelled(played.get()));
  ASSERT_EQ(reports.size(), 3u);
  EXPECT_GT(reports[0].replaced_ns(), 0);
  EXPECT_EQ(reports[1].step(), reports[2].step());
  EXPECT_EQ(reports[1].scanout_end_ns(), reports[2].scanout_end_ns());
  EXPECT_GE(reports[2].refreshes(), static_cast<int>(0.2 * kRefresh_hz) - 1);
}

TEST_F(Player, PassesOnWhatTheScreensSay) {
  display_.fails_at_ = 2;
  EXPECT_TRUE(absl::IsInternal(play_steps(4, soon())));
  EXPECT_EQ(reports_.size(), 2u);
}

}  // namespace
}  // namespace glasswing
