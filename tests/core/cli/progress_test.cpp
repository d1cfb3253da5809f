#include "core/cli/progress.h"

#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <cmath>
#include <sstream>

namespace glasswing {
namespace {

using std::chrono::milliseconds;

TEST(BarLine, IsNeverWiderThanTheTerminal) {
  for (int columns = 0; columns <= 120; ++columns) {
    for (const double fraction : {0.0, 0.123, 0.5, 0.999, 1.0}) {
      const std::string line = bar_line("compositing", fraction, "120 of 311 frames", "2 min 30 s", columns);
      EXPECT_LE(static_cast<int>(line.size()), columns) << line;
    }
  }
}

TEST(BarLine, KeepsWhatMattersMost) {
  const auto line = [](int columns) { return bar_line("solving", 0.25, "3 of 12 tiles", "8 s", columns); };
  EXPECT_EQ(line(100), "solving [#######.......................]  25 %  3 of 12 tiles  8 s left");
  EXPECT_EQ(line(38), "solving  25 %  3 of 12 tiles  8 s left");
  EXPECT_EQ(line(23), "solving  25 %  8 s left");
}

TEST(TimeLeft, IsCoarseAndNeverTooShort) {
  EXPECT_EQ(left_text(0.0), "0 s");
  EXPECT_EQ(left_text(7.2), "8 s");
  EXPECT_EQ(left_text(41.0), "45 s");
  EXPECT_EQ(left_text(61.0), "1 min 5 s");
  EXPECT_EQ(left_text(599.0), "10 min");
  EXPECT_EQ(left_text(3700.0), "1 h 5 min");
}

// Progress on a terminal of 60 columns, or in a log, with a fake clock.
class ProgressOutput : public testing::Test {
 protected:
  std::string written(bool terminal, const std::function<void()>& work) {
    winsize size{.ws_row = 24, .ws_col = 60, .ws_xpixel = 0, .ws_ypixel = 0};
    int ends[2] = {-1, -1};
    EXPECT_EQ(terminal ? ::openpty(&ends[0], &ends[1], nullptr, nullptr, &size) : ::pipe(ends), 0);
    const int before = ::dup(STDERR_FILENO);
    ::dup2(ends[1], STDERR_FILENO);
    work();
    ::dup2(before, STDERR_FILENO);
    ::close(before);
    // The output, a few kilobytes, waits in the kernel; a terminal delivers it in parts.
    constexpr char kEnd = '\x01';
    EXPECT_EQ(::write(ends[1], &kEnd, 1), 1);
    std::string text;
    for (char c = 0; ::read(ends[0], &c, 1) == 1 && c != kEnd;) text += c;
    ::close(ends[0]);
    ::close(ends[1]);
    while (text.ends_with('\n') || text.ends_with('\r')) text.pop_back();
    return text;
  }
  Progress::Clock::time_point now_{};
  const std::function<Progress::Clock::time_point()> clock_ = [this] { return now_; };

  // Steps of 100 ms.
  void work(int steps) {
    Progress progress("working", clock_);
    for (int i = 1; i <= steps; ++i) {
      now_ += milliseconds(100);
      progress.update(static_cast<double>(i) / steps, "so many");
    }
    progress.done("all");
  }
};

TEST_F(ProgressOutput, ShortWorkIsSilent) {
  EXPECT_EQ(written(true, [&] { work(4); }), "");
  EXPECT_EQ(written(false, [&] { work(40); }), "working: all in 4.0 s");
}

TEST_F(ProgressOutput, ALogGetsAPlainLineNowAndThen) {
  EXPECT_EQ(written(false, [&] { work(120); }),
            "working: 41 %, so many, 7 s left\nworking: 83 %, so many, 2 s left\nworking: all in 12.0 s");
}

TEST_F(ProgressOutput, ATerminalGetsABarOfItsWidth) {
  std::istringstream text(written(true, [&] { work(30); }));
  std::string line, last;
  int bars = 0;
  while (std::getline(text, line, '\r')) {
    if (line.find('[') == std::string::npos || !line.starts_with("working")) continue;
    ++bars;
    EXPECT_LT(line.find("\x1b[K"), 60u) << line;
    last = line;
  }
  EXPECT_EQ(bars, 26);  // from half a second on
  EXPECT_NE(last.find("100 %  so many  0 s left"), std::string::npos) << last;
}

// Of 40 s of work whose pace changes every second, and is ahead or behind by up to 0.5 s: of the first 5 s
// that is 10 %, so the guess may be 3.5 s off, and is rounded up to 5 s.
TEST_F(ProgressOutput, TheTimeLeftIsSteady) {
  const std::string text = written(false, [&] {
    Progress progress("working", clock_);
    for (int i = 1; i <= 400; ++i) {
      now_ += milliseconds(i / 10 % 2 == 0 ? 50 : 150);
      progress.update(i / 400.0);
    }
  });
  std::istringstream lines(text);
  double elapsed_s = 0.0;
  for (std::string line; std::getline(lines, line);) {
    elapsed_s += 5.0;
    const size_t comma = line.find(", ");
    ASSERT_NE(comma, std::string::npos) << line;
    const double left_s = std::stod(line.substr(comma + 2));
    EXPECT_NEAR(left_s, 40.0 - elapsed_s, 8.5) << line;
  }
  EXPECT_GT(elapsed_s, 30.0);
}

// 4 s of start-up, then 40 s of steps of 100 ms; of a resumed session a part is done before. The rate of
// equal steps is exact, so that the time left is too, but for its rounding up by less than 5 s.
TEST_F(ProgressOutput, TheTimeLeftLeavesOutTheStart) {
  for (const int done : {0, 300}) {
    const std::string text = written(false, [&] {
      Progress progress("working", clock_);
      const int steps = done + 400;
      for (int i = 0; i <= 440; ++i) {
        progress.update(static_cast<double>(done + std::max(0, i - 40)) / steps);
        now_ += milliseconds(100);
      }
    });
    std::istringstream lines(text);
    double elapsed_s = 0.0;
    for (std::string line; std::getline(lines, line);) {
      elapsed_s += 5.0;
      const size_t comma = line.find(", ");
      if (elapsed_s < 10.0) {
        EXPECT_EQ(comma, std::string::npos) << line;  // no second of steps has passed
        continue;
      }
      ASSERT_NE(comma, std::string::npos) << line;
      const double late_s = std::stod(line.substr(comma + 2)) - (44.0 - elapsed_s);
      EXPECT_GT(late_s, -0.1) << line;
      EXPECT_LT(late_s, 5.0) << line;
    }
    EXPECT_EQ(elapsed_s, 40.0);
  }
}

}  // namespace
}  // namespace glasswing
