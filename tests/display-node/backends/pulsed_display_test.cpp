#include "display-node/backends/pulsed_display.h"

#include <gtest/gtest.h>

#include "display-node/backends/sim_display.h"
#include "tests/display-node/backends/simulated_screen.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

// When it was raised.
struct Pulses {
  std::mutex mutex;
  std::vector<nanoseconds> at;
  absl::Status result;
  size_t count() {
    const std::lock_guard lock(mutex);
    return at.size();
  }
};

class RecordedLine final : public TriggerLine {
 public:
  explicit RecordedLine(Pulses& pulses) : pulses_(pulses) {}
  absl::Status pulse() override {
    const std::lock_guard lock(pulses_.mutex);
    pulses_.at.push_back(monotonic_now());
    return pulses_.result;
  }

 private:
  Pulses& pulses_;
};

class PulsedDisplayTest : public testing::Test {
 protected:
  nanoseconds show() {
    const absl::StatusOr<std::vector<Scanout>> shown = display_.show({small_gray(1), small_gray(1)}, at_);
    EXPECT_OK(shown.status());
    if (!shown.ok()) return {};
    at_ = (*shown)[0].start + milliseconds(30);
    return std::max((*shown)[0].start, (*shown)[1].start);
  }
  nanoseconds at_ = monotonic_now();
  SimDisplay sim_{{small_screen("left", 60.0), small_screen("right", 59.0)}, {}};
  Pulses pulses_;
  PulsedDisplay display_{sim_, std::make_unique<RecordedLine>(pulses_)};
};

TEST_F(PulsedDisplayTest, ItRisesOnceForEachPictureAfterTheLastMonitorBegan) {
  constexpr milliseconds kSlack(15);
  // The second is of monitors that lag by three pictures.
  for (const milliseconds after : {milliseconds(11), milliseconds(101)}) {
    display_.arm(PulsedDisplay::Pulse{.after = after, .slack = kSlack});
    std::vector<nanoseconds> due;
    for (int i = 0; i < 20; ++i) due.push_back(show() + after);
    while (monotonic_now() < due.back() + kSlack) show();
    display_.arm({});
    show();  // by then the last is raised, or never will be
    const std::lock_guard lock(pulses_.mutex);
    size_t next = 0, raised = 0;
    for (const nanoseconds at : std::exchange(pulses_.at, {})) {
      while (next < due.size() && due[next] + kSlack < at) ++next;
      if (next == due.size()) break;  // of the pictures since
      EXPECT_GE(at, due[next]);
      ++next;
      ++raised;
    }
    EXPECT_GE(raised, 15u);  // unless the machine stalls for longer than the slack
  }
}

TEST_F(PulsedDisplayTest, ItStaysLowUnlessArmedAndWhenItIsTooLate) {
  show();
  show();
  EXPECT_EQ(pulses_.count(), 0u);
  // Due before the picture is reported: late at once.
  display_.arm(PulsedDisplay::Pulse{.after = -milliseconds(200), .slack = milliseconds(100)});
  show();
  show();
  EXPECT_EQ(pulses_.count(), 0u);
}

TEST_F(PulsedDisplayTest, AFailedLineEndsTheProgram) {
  pulses_.result = absl::UnavailableError("it is unplugged");
  display_.arm(PulsedDisplay::Pulse{.after = nanoseconds(0), .slack = std::chrono::seconds(1)});
  show();
  while (pulses_.count() == 0) std::this_thread::yield();
  absl::Status status;
  while (status.ok()) status = display_.show({small_gray(1), small_gray(1)}, monotonic_now()).status();
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_EQ(status.message(), "the trigger line cannot be raised: it is unplugged");
  display_.arm({});  // the next program tries again
  EXPECT_OK(display_.show({small_gray(1), small_gray(1)}, monotonic_now()).status());
}

}  // namespace
}  // namespace glasswing
