#include "core/timing/proof.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

TEST(StableWindow, IsTheIntersectionShrunk) {
  const StableWindow window = stable_window({{.step = 7,
                                              .scanout_end = milliseconds(20),
                                              .replaced = milliseconds(40),
                                              .lag = milliseconds(3),
                                              .settle = milliseconds(1),
                                              .uncertainty = microseconds(100)},
                                             {.step = 7,
                                              .scanout_end = milliseconds(22),
                                              .replaced = milliseconds(39),
                                              .lag = milliseconds(1),
                                              .settle = milliseconds(0),
                                              .uncertainty = microseconds(200)}});
  EXPECT_EQ(window.step, 7);
  EXPECT_EQ(window.from, milliseconds(24) + microseconds(100));
  EXPECT_EQ(window.until, milliseconds(40) - microseconds(200));
}

TEST(Proof, TheWholeExposureMustLieInside) {
  const StableWindow window{.step = 1, .from = milliseconds(10), .until = milliseconds(20)};
  const auto frame = [](int start_us, int end_us, int uncertainty_us) {
    return FrameTime{.sequence = 1,
                     .start = microseconds(start_us),
                     .end = microseconds(end_us),
                     .uncertainty = microseconds(uncertainty_us)};
  };
  EXPECT_TRUE(proves(frame(10000, 20000, 0), window));
  EXPECT_TRUE(proves(frame(10100, 19900, 100), window));
  EXPECT_FALSE(proves(frame(10099, 19900, 100), window));
  EXPECT_FALSE(proves(frame(10100, 19901, 100), window));
  EXPECT_FALSE(proves(frame(9999, 15000, 0), window));
  EXPECT_FALSE(proves(frame(15000, 15000, 0), window));  // zero exposure
}

// For any interleaving of frames and windows: every match is proven, no frame or step is matched twice, and
// every step that some frame proves is matched.
TEST(FrameMatcher, MatchesExactlyWhatIsProven) {
  std::mt19937 random(11);
  for (int round = 0; round < 200; ++round) {
    std::vector<StableWindow> windows;
    std::vector<FrameTime> frames;
    for (int step = 0; step < 30; ++step) {
      const auto jitter = microseconds(random() % 4000);
      windows.push_back({.step = step,
                         .from = milliseconds(33 * step + 17) + jitter,
                         .until = milliseconds(33 * step + 33)});
    }
    for (int i = 0; i < 150; ++i) {
      if (random() % 4 == 0) continue;  // dropped
      const auto start = microseconds(7000 * i + static_cast<int>(random() % 1000));
      frames.push_back(
          {.sequence = i, .start = start, .end = start + milliseconds(6), .uncertainty = microseconds(50)});
    }
    FrameMatcher matcher;
    size_t w = 0, f = 0;
    while (w < windows.size() || f < frames.size()) {
      if (f == frames.size() || (w < windows.size() && random() % 5 == 0)) {
        matcher.add_window(windows[w++]);
      } else {
        matcher.add_frame(frames[f++]);
      }
    }
    std::map<int, FrameTime> matched;
    std::set<std::int64_t> used;
    for (const FrameMatcher::Match& match : matcher.take()) {
      EXPECT_TRUE(matched.emplace(match.step, match.frame).second);
      EXPECT_TRUE(used.insert(match.frame.sequence).second);
      EXPECT_TRUE(proves(match.frame, windows[match.step]));
    }
    for (const StableWindow& window : windows) {
      const bool provable =
          std::any_of(frames.begin(), frames.end(), [&](const FrameTime& x) { return proves(x, window); });
      EXPECT_EQ(matched.contains(window.step), provable) << "step " << window.step << " of round " << round;
    }
  }
}

// A frame that comes late, after the same step was begun again, proves only what is on screen again.
TEST(FrameMatcher, WindowsThatAreForgottenGetNoFrame) {
  const StableWindow before{.step = 3, .from = milliseconds(10), .until = milliseconds(30)};
  const StableWindow again{.step = 3, .from = milliseconds(110), .until = milliseconds(130)};
  const auto frame = [](int sequence, int start_ms) {
    return FrameTime{
        .sequence = sequence, .start = milliseconds(start_ms), .end = milliseconds(start_ms + 6)};
  };
  FrameMatcher matcher;
  matcher.add_frame(frame(1, 12));
  matcher.add_window(before);  // matched, but not taken
  matcher.add_window(before);  // waits
  matcher.forget_windows();
  matcher.add_frame(frame(2, 20));
  EXPECT_TRUE(matcher.take().empty());
  matcher.add_window(again);
  matcher.add_frame(frame(3, 115));
  const std::vector<FrameMatcher::Match> matches = matcher.take();
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].frame.sequence, 3);
}

}  // namespace
}  // namespace glasswing
