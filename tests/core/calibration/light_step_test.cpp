#include "core/calibration/light_step.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr size_t kStepsAPass = 20;

double us(nanoseconds time) {
  return 1e-3 * static_cast<double>(time.count());
}

// A monitor of known lag and settling time, in front of a rolling-shutter camera.
struct Rig {
  nanoseconds lag = microseconds(6300);
  nanoseconds settle = microseconds(4200);
  nanoseconds scanout = microseconds(16667);  // negative: the last row comes first
  nanoseconds refresh = microseconds(16667);
  int hold = 2;
  int passes = 4;
  std::vector<std::optional<size_t>> sequence = band_sequence();
  double frame_rate_hz = 200.0;
  nanoseconds exposure = microseconds(4000);
  nanoseconds readout = microseconds(2000);
  size_t rows = 8;
  double noise = 1e-3;
  double contrast = 0.3;
  double second_contrast = 0.3;
  std::vector<double> band_height{1.0 / 6.0, 5.0 / 6.0};
};

// The light of a band at a time, straight from the model's definition: a sum over the changes so far.
double light_at(const Rig& rig, const LightRecord& record, size_t band, double t) {
  const double first_row = us(rig.scanout) < 0 ? -us(rig.scanout) : 0.0;
  const double delay = us(rig.lag) + first_row + us(rig.scanout) * record.band_height[band];
  double light = 0.0;
  bool lit = false;
  for (const BandChange& change : record.shown) {
    const bool now = change.lit == band;
    if (now == lit) continue;
    const double since = t - us(change.scanout_start) - delay;
    light += (now ? 1.0 : -1.0) * std::clamp(since / std::max(us(rig.settle), 1e-3), 0.0, 1.0);
    lit = now;
  }
  return light;
}

LightRecord recorded(const Rig& rig, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, rig.noise);
  std::uniform_real_distribution<double> phase(0.0, 1.0);
  LightRecord record{
      .band_height = rig.band_height, .scanout = std::chrono::abs(rig.scanout), .shown = {}, .frames = {}};
  nanoseconds at = seconds(77);
  const nanoseconds period(std::llround(1e9 / rig.frame_rate_hz));
  for (int pass = 0; pass < rig.passes; ++pass) {
    at += milliseconds(300);
    const nanoseconds began = at;
    for (size_t i = 0; i < kStepsAPass; ++i) {
      const size_t step = static_cast<size_t>(pass) * kStepsAPass + i;
      record.shown.push_back({.scanout_start = at, .lit = rig.sequence[step % rig.sequence.size()]});
      at += rig.hold * rig.refresh;
    }
    record.shown.push_back({.scanout_start = at, .lit = std::nullopt});
    // The camera restarts at a random time.
    nanoseconds start =
        began - milliseconds(50) +
        nanoseconds(static_cast<std::int64_t>(phase(random) * static_cast<double>(period.count())));
    for (; start < at + milliseconds(60); start += period)
      record.frames.push_back(
          {.start = start, .exposure = rig.exposure, .readout = rig.readout, .row_mean = {}});
    at += milliseconds(100);
  }
  // Rows of the upper half see the first band and, as through glass, a little of the second.
  for (LightFrame& frame : record.frames) {
    for (size_t r = 0; r < rig.rows; ++r) {
      const double from =
          us(frame.start) + us(frame.readout) * static_cast<double>(r) / static_cast<double>(rig.rows - 1);
      constexpr int kParts = 400;
      double first = 0.0, second = 0.0;
      for (int i = 0; i < kParts; ++i) {
        const double t = from + us(frame.exposure) * (i + 0.5) / kParts;
        first += light_at(rig, record, 0, t) / kParts;
        if (record.band_height.size() > 1) second += light_at(rig, record, 1, t) / kParts;
      }
      const bool upper = 2 * r < rig.rows;
      const double light = 0.02 * static_cast<double>(r) + rig.contrast * (upper ? 1.0 : 0.1) * first +
                           rig.second_contrast * (upper ? 0.1 : 1.0) * second;
      frame.row_mean.push_back(static_cast<float>(light + noise(random)));
    }
  }
  return record;
}

void expect_truth(const Rig& rig, const LightStep& found) {
  EXPECT_LT(us(found.lag.error), 100.0);
  EXPECT_NEAR(us(found.lag.value), us(rig.lag) + (rig.scanout < nanoseconds(0) ? -us(rig.scanout) : 0.0),
              3.0 * us(found.lag.error));
  EXPECT_NEAR(us(found.settle.value), us(rig.settle), 3.0 * us(found.settle.error));
  ASSERT_TRUE(found.scanout.has_value());
  EXPECT_NEAR(us(found.scanout->value), us(rig.scanout), 3.0 * us(found.scanout->error));
}

// Within three standard errors, each below 0.1 ms: so within 0.3 ms of the truth.
TEST(LightStep, FindsTheTruthWhateverTheCamera) {
  std::map<std::string, Rig> rigs;
  rigs["plain"] = {};
  rigs["at once"].settle = nanoseconds(0);
  rigs["slow panel"].settle = milliseconds(15);
  rigs["far behind"].lag = milliseconds(120);
  rigs["no lag"].lag = nanoseconds(0);
  rigs["bottom up"].scanout = microseconds(-16667);
  rigs["all rows at once"].scanout = nanoseconds(0);
  rigs["webcam"].frame_rate_hz = 30.0;
  rigs["webcam"].exposure = milliseconds(30);
  rigs["webcam"].readout = milliseconds(25);
  rigs["webcam"].passes = 12;
  rigs["global shutter"].readout = nanoseconds(0);
  rigs["many rows"].rows = 100;
  rigs["many rows"].passes = 1;
  rigs["144 Hz"].refresh = rigs["144 Hz"].scanout = microseconds(6944);
  rigs["144 Hz"].settle = milliseconds(2);
  for (const auto& [name, rig] : rigs) {
    SCOPED_TRACE(name);
    const absl::StatusOr<LightStep> found = find_light_step(recorded(rig, 5));
    ASSERT_OK(found);
    expect_truth(rig, *found);
  }
}

TEST(LightStep, OneBandIsEnoughForTheLag) {
  Rig rig;
  rig.second_contrast = 0.0;
  const absl::StatusOr<LightStep> found = find_light_step(recorded(rig, 5));
  ASSERT_OK(found);
  EXPECT_FALSE(found->scanout.has_value());
  EXPECT_NEAR(us(found->lag.value), us(rig.lag), 3.0 * us(found->lag.error));
  EXPECT_LT(us(found->lag.error), 100.0);
}

// Errors over standard errors of 60 rigs with independent noise have a mean square of 1 with a standard
// deviation of sqrt(2 / 60) = 0.18 if they are normal. The test allows three of these, plus a half, as
// settling times cannot be negative.
TEST(LightStep, StandardErrorsAreHonest) {
  double lag_square = 0.0, settle_square = 0.0, scanout_square = 0.0;
  constexpr int kRigs = 60;
  for (int i = 0; i < kRigs; ++i) {
    Rig rig;
    rig.passes = 1;
    rig.frame_rate_hz = 97.0;
    rig.exposure = milliseconds(8);
    rig.noise = 0.02;
    rig.lag = microseconds(3000 + 101 * i);
    const absl::StatusOr<LightStep> found =
        find_light_step(recorded(rig, 100 + static_cast<std::uint64_t>(i)));
    ASSERT_OK(found);
    const auto square = [](nanoseconds truth, const LightStep::Estimate& estimate) {
      return std::pow(us(estimate.value - truth) / us(estimate.error), 2) / kRigs;
    };
    lag_square += square(rig.lag, found->lag);
    settle_square += square(rig.settle, found->settle);
    scanout_square += square(rig.scanout, *found->scanout);
  }
  for (const double mean_square : {lag_square, settle_square, scanout_square}) {
    EXPECT_GT(mean_square, 0.4);
    EXPECT_LT(mean_square, 1.6);
  }
}

// 1 ms exposures every 5 ms against refreshes of 1/60 s: the changes have three phases, and possibly none of
// them meets an exposure. The camera restarts only once, so the stated error must be large.
TEST(LightStep, WhatNoExposureSawIsInTheError) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Rig rig;
    rig.passes = 1;
    rig.exposure = milliseconds(1);
    rig.readout = nanoseconds(0);
    rig.settle = nanoseconds(0);
    rig.noise = 1e-5;
    const absl::StatusOr<LightStep> found = find_light_step(recorded(rig, seed));
    ASSERT_OK(found);
    // A uniform distribution ends sqrt(3) standard deviations from its mean; the line through both bands adds
    // a little.
    EXPECT_NEAR(us(found->lag.value), us(rig.lag), 3.0 * us(found->lag.error));
  }
}

TEST(LightStep, SaysWhyItCannotTell) {
  const auto reason = [](const LightRecord& record) {
    const absl::StatusOr<LightStep> found = find_light_step(record);
    EXPECT_TRUE(absl::IsFailedPrecondition(found.status())) << found.status();
    return std::string(found.status().message());
  };
  Rig dark;
  dark.contrast = dark.second_contrast = 0.0;
  dark.passes = 1;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
    EXPECT_NE(reason(recorded(dark, seed)).find("no light change was seen"), std::string::npos);

  Rig regular;
  for (size_t i = 0; i < regular.sequence.size(); ++i) regular.sequence[i] = i % 2;
  EXPECT_NE(reason(recorded(regular, 1)).find("ambiguous"), std::string::npos);

  Rig slow;
  slow.frame_rate_hz = 3.0;
  EXPECT_NE(reason(recorded(slow, 1)).find("too slow"), std::string::npos);
  // The camera is synchronised to the display, and no exposure meets a change.
  Rig locked;
  locked.passes = 1;
  locked.frame_rate_hz = 30.0;
  locked.refresh = nanoseconds(16'666'667);
  locked.exposure = milliseconds(2);
  EXPECT_NE(reason(recorded(locked, 1)).find("longer exposure"), std::string::npos);
}

TEST(LightStep, RefusesWhatIsNoRecord) {
  const LightRecord good = recorded({.passes = 1}, 1);
  LightRecord record = good;
  record.frames.clear();
  EXPECT_TRUE(absl::IsInvalidArgument(find_light_step(record).status()));
  record = good;
  record.frames[3].row_mean.pop_back();
  EXPECT_TRUE(absl::IsInvalidArgument(find_light_step(record).status()));
  record = good;
  record.band_height.clear();
  EXPECT_TRUE(absl::IsInvalidArgument(find_light_step(record).status()));
  record = good;
  record.shown.resize(1);
  EXPECT_TRUE(absl::IsInvalidArgument(find_light_step(record).status()));
  record = good;
  record.frames[0].exposure = nanoseconds(0);
  EXPECT_TRUE(absl::IsInvalidArgument(find_light_step(record).status()));
}

// Every four consecutive symbols except 0 0 0 0 occur once in 80 steps, so the sequence is maximal.
TEST(BandSequence, IsMaximal) {
  const std::vector<std::optional<size_t>> sequence = band_sequence();
  ASSERT_EQ(sequence.size(), 80u);
  std::set<std::vector<std::optional<size_t>>> seen;
  for (size_t i = 0; i < 80; ++i) {
    std::vector<std::optional<size_t>> four;
    for (size_t k = 0; k < 4; ++k) four.push_back(sequence[(i + k) % 80]);
    seen.insert(four);
  }
  EXPECT_EQ(seen.size(), 80u);
}

}  // namespace
}  // namespace glasswing
