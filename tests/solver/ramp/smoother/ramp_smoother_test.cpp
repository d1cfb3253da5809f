#include "solver/ramp/smoother/ramp_smoother.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace glasswing {
namespace {

constexpr int kWidth = 96, kHeight = 80;
constexpr float kSd_px = 1.5f, kRhoSd = 0.01f;

struct Truth {
  bool object = false;
  float x_px = 0.0f, y_px = 0.0f, rho = 0.0f;
};
using Scene = std::function<Truth(float x, float y)>;

bool in_disc(float x, float y, float centre_x, float centre_y, float radius) {
  return std::hypot(x - centre_x, y - centre_y) < radius;
}

// An extracted frame with noise of kSd_px and kRhoSd times `noise`.
RampFrame frame_of(const Scene& scene, unsigned seed, float noise = 1.0f, int width_px = kWidth,
                   int height_px = kHeight) {
  RampFrame frame(width_px, height_px);
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  frame.rho_sd = kRhoSd * noise;
  for (int y = 0; y < frame.height_px; ++y) {
    for (int x = 0; x < frame.width_px; ++x) {
      const size_t i = y * frame.width_px + x;
      const float px = static_cast<float>(x) + 0.5f, py = static_cast<float>(y) + 0.5f;
      frame.x_px[i] = px;
      frame.y_px[i] = py;
      const Truth truth = scene(px, py);
      if (!truth.object) continue;
      frame.alpha[i] = 1.0f;
      const float sd = kSd_px * noise / truth.rho;
      frame.x_px[i] = truth.x_px + sd * normal(random);
      frame.y_px[i] = truth.y_px + sd * normal(random);
      frame.rho[i] = truth.rho + kRhoSd * noise * normal(random);
      frame.info_xx[i] = frame.info_yy[i] = 1.0f / (sd * sd);
    }
  }
  return frame;
}

// Rms error of c in monitor px, per coordinate, over pixels for which `counts` is true.
double error_px(const RampFrame& frame, const Scene& scene, const std::function<bool(float, float)>& counts) {
  double sum = 0.0, count = 0.0;
  for (int y = 0; y < frame.height_px; ++y) {
    for (int x = 0; x < frame.width_px; ++x) {
      const size_t i = y * frame.width_px + x;
      const float px = static_cast<float>(x) + 0.5f, py = static_cast<float>(y) + 0.5f;
      if (!counts(px, py)) continue;
      const Truth truth = scene(px, py);
      const double right = frame.x_px[i] - truth.x_px, down = frame.y_px[i] - truth.y_px;
      sum += right * right + down * down;
      count += 2.0;
    }
  }
  return std::sqrt(sum / count);
}

RampFrame smoothed(const SmoothingOptions& options, const std::vector<const RampFrame*>& frames, size_t at,
                   int thread_count = 1) {
  std::vector<SmoothInput> window;
  for (const RampFrame* frame : frames) window.push_back({.frame = frame});
  return RampSmoother(options).smooth(window, at, thread_count);
}

// A tilted pane.
Truth pane(float x, float y) {
  return {.object = in_disc(x, y, 48.0f, 40.0f, 36.0f),
          .x_px = 30.0f + 0.7f * x + 0.1f * y,
          .y_px = 10.0f - 0.2f * x + 0.9f * y,
          .rho = 0.9f};
}
bool pane_middle(float x, float y) {
  return in_disc(x, y, 48.0f, 40.0f, 28.0f);
}

// A glass lens: c minus the position behind has the shape of a dome.
Scene lens(float centre_x, float centre_y) {
  return [=](float x, float y) {
    const float right = x - centre_x, down = y - centre_y,
                r2 = (right * right + down * down) / (28.0f * 28.0f);
    const float strength = r2 < 1.0f ? -0.8f * std::sqrt(1.0f - r2) : 0.0f;
    return Truth{.object = r2 < 1.0f,
                 .x_px = x + strength * right,
                 .y_px = y + strength * down,
                 .rho = r2 < 0.85f ? 0.95f : 0.3f};
  };
}

TEST(RampSmoother, PlanesAreFittedAsWellAsTheWindowAllows) {
  const RampFrame frame = frame_of(pane, 1);
  const double error = error_px(smoothed({.reach = 0}, {&frame}, 0), pane, pane_middle);
  // The window's kernel 1 - d^2/25 within d <= 4.5 has (sum k)^2 / sum k^2 = 53 pixels at its middle, where a
  // plane fit has the variance of the mean. The tests against neighbours cost a little of it.
  const double best = kSd_px / 0.9 / std::sqrt(53.0);
  EXPECT_GT(error, 0.9 * best);
  EXPECT_LT(error, 1.3 * best);
}

TEST(RampSmoother, RhoIsSmoothedToo) {
  const RampFrame frame = frame_of(pane, 2);
  const RampFrame result = smoothed({.reach = 0}, {&frame}, 0);
  double before = 0.0, after = 0.0;
  for (size_t i = 0; i < frame.rho.size(); ++i) {
    if (frame.alpha[i] == 0.0f) continue;
    before += std::pow(frame.rho[i] - 0.9, 2);
    after += std::pow(result.rho[i] - 0.9, 2);
  }
  // At least as good as a 3 x 3 mean.
  EXPECT_LT(after, before / 9.0);
}

TEST(RampSmoother, EdgesStay) {
  // Two adjacent panes; one shows positions 12 px further on, darker or not.
  for (const float rho : {0.9f, 0.6f}) {
    const Scene panes = [rho](float x, float y) {
      Truth truth = pane(x, y);
      if (x > 48.0f) {
        truth.x_px += 12.0f;
        truth.rho = rho;
      }
      return truth;
    };
    const auto at_edge = [](float x, float y) { return std::abs(x - 48.0f) < 2.0f && pane_middle(x, y); };
    const RampFrame frame = frame_of(panes, 3);
    const double raw = error_px(frame, panes, at_edge);
    EXPECT_LT(error_px(smoothed({.reach = 0}, {&frame}, 0), panes, at_edge), 0.5 * raw) << rho;
  }
}

TEST(RampSmoother, ThinRimsKeepTheirRho) {
  const Scene ringed = [](float x, float y) {
    Truth truth = pane(x, y);
    if (!in_disc(x, y, 48.0f, 40.0f, 35.0f)) truth.rho = 0.2f;
    return truth;
  };
  const RampFrame frame = frame_of(ringed, 4);
  const RampFrame result = smoothed({.reach = 0}, {&frame}, 0);
  // rho may move by at most three standard deviations.
  for (size_t i = 0; i < frame.rho.size(); ++i) EXPECT_NEAR(result.rho[i], frame.rho[i], 3.001f * kRhoSd);
}

TEST(RampSmoother, WhatStandsStillGainsFromTime) {
  const Scene scene = lens(48.0f, 40.0f);
  const auto inside = [](float x, float y) { return in_disc(x, y, 48.0f, 40.0f, 14.0f); };
  std::vector<RampFrame> frames;
  for (unsigned seed = 10; seed < 15; ++seed) frames.push_back(frame_of(scene, seed));
  std::vector<const RampFrame*> window;
  for (const RampFrame& frame : frames) window.push_back(&frame);
  const double alone = error_px(smoothed({.reach = 0}, window, 2), scene, inside);
  const double together = error_px(smoothed({.reach = 2}, window, 2), scene, inside);
  // Five frames leave 0.45 of the noise, four 0.5, three 0.58: the tests may cost up to two frames.
  EXPECT_LT(together, 0.6 * alone);
}

TEST(RampSmoother, WhatMovesIsFollowed) {
  // Further in a frame than the window is wide, to either side of its middle frame.
  const auto moving = [](float right, float down) {
    std::vector<RampFrame> frames;
    for (const float i : {-1.0f, 0.0f, 1.0f})
      frames.push_back(
          frame_of(lens(47.0f + i * right, 41.0f + i * down), 21u + static_cast<unsigned>(i + 1.0f)));
    return frames;
  };
  const Scene middle = lens(47.0f, 41.0f);
  const auto inside = [](float x, float y) { return in_disc(x, y, 47.0f, 41.0f, 14.0f); };
  for (const auto& [right, down] : {std::pair{7.0f, 3.0f}, {8.0f, 0.0f}, {0.0f, 8.0f}}) {
    const std::vector<RampFrame> frames = moving(right, down);
    const double alone = error_px(smoothed({.reach = 0}, {&frames[1]}, 0), middle, inside);
    for (const size_t other : {0u, 2u}) {
      const double together =
          error_px(smoothed({.reach = 1}, {&frames[1], &frames[other]}, 0), middle, inside);
      EXPECT_LT(together, 0.9 * alone) << right << " " << down << " " << other;  // two frames: 0.71 at best
    }
  }
  const std::vector<RampFrame> frames = moving(7.0f, 3.0f);
  const double alone = error_px(smoothed({.reach = 0}, {&frames[1]}, 0), middle, inside);
  const double together =
      error_px(smoothed({.reach = 1}, {&frames[0], &frames[1], &frames[2]}, 1), middle, inside);
  EXPECT_LT(together, 0.85 * alone);  // three frames: 0.58 at best
  // Motion is followed wherever it leads; a cut to something else is excluded.
  const Scene other = [](float x, float y) {
    Truth truth = pane(x, y);
    truth.x_px += 15.0f * std::sin(x / 5.0f);
    return truth;
  };
  const RampFrame cut = frame_of(other, 30);
  const double after_cut = error_px(smoothed({.reach = 1}, {&cut, &frames[1], &cut}, 1), middle, inside);
  EXPECT_LT(after_cut, 1.1 * alone);
}

TEST(RampSmoother, CausalLooksAtThePastAlone) {
  std::vector<RampFrame> frames;
  for (unsigned seed = 40; seed < 43; ++seed) frames.push_back(frame_of(pane, seed));
  const SmoothingOptions live{.reach = 1, .causal = true};
  EXPECT_EQ(RampSmoother(live).frames_before(), 1);
  EXPECT_EQ(RampSmoother(live).frames_after(), 0);
  EXPECT_EQ(smoothed(live, {&frames[0], &frames[1], &frames[2]}, 1).x_px,
            smoothed(live, {&frames[0], &frames[1]}, 1).x_px);
}

TEST(RampSmoother, FarFramesChangeNothing) {
  std::vector<RampFrame> frames;
  for (unsigned seed = 50; seed < 55; ++seed) frames.push_back(frame_of(pane, seed));
  for (const Smoothing smoothing : {Smoothing::kAdaptive, Smoothing::kPeronaMalik}) {
    const SmoothingOptions options{.smoothing = smoothing, .reach = 1};
    const RampFrame all = smoothed(options, {&frames[0], &frames[1], &frames[2], &frames[3], &frames[4]}, 2);
    const RampFrame near = smoothed(options, {&frames[1], &frames[2], &frames[3]}, 1);
    EXPECT_EQ(all.x_px, near.x_px);
    EXPECT_EQ(all.rho, near.rho);
  }
}

TEST(RampSmoother, UnknownPlacesComeFromTheirNeighbours) {
  const auto in_highlight = [](float x, float y) { return in_disc(x, y, 48.0f, 40.0f, 3.0f); };
  RampFrame frame = frame_of(pane, 60);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const size_t i = y * kWidth + x;
      if (!in_highlight(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)) continue;
      frame.x_px[i] = frame.y_px[i] = 0.0f;
      frame.info_xx[i] = frame.info_yy[i] = 0.0f;
      frame.rho[i] = 2.0f;
    }
  }
  const RampFrame result = smoothed({.reach = 0}, {&frame}, 0);
  EXPECT_LT(error_px(result, pane, in_highlight), kSd_px / 0.9);  // no worse than a single sample
  EXPECT_EQ(result.rho[40 * kWidth + 48], 2.0f);
}

TEST(RampSmoother, CleanFramesStayAsTheyAre) {
  const Scene scene = lens(48.0f, 40.0f);
  const float noise = 1e-4f;
  const RampFrame frame = frame_of(scene, 70, noise);
  const RampFrame result = smoothed({}, {&frame, &frame, &frame}, 1);
  // Samples further apart than sqrt(12 (1 + 1)) = 4.9 standard deviations do not count.
  for (size_t i = 0; i < frame.rho.size(); ++i) {
    if (frame.alpha[i] == 0.0f) continue;
    EXPECT_NEAR(result.x_px[i], frame.x_px[i], 5.0f * kSd_px * noise / 0.3f + 1e-4f);
  }
}

TEST(RampSmoother, OffTheObjectNothingChanges) {
  const RampFrame frame = frame_of(pane, 80);
  for (const Smoothing smoothing : {Smoothing::kAdaptive, Smoothing::kPeronaMalik, Smoothing::kNone}) {
    const RampFrame result = smoothed({.smoothing = smoothing}, {&frame}, 0);
    for (size_t i = 0; i < frame.rho.size(); ++i) {
      if (frame.alpha[i] > 0.0f) continue;
      EXPECT_EQ(result.x_px[i], frame.x_px[i]);
      EXPECT_EQ(result.rho[i], 0.0f);
    }
  }
  const RampFrame empty = frame_of([](float, float) { return Truth{}; }, 81);
  EXPECT_EQ(smoothed({}, {&empty, &frame}, 0).x_px, empty.x_px);
}

TEST(RampSmoother, ThreadsChangeNothing) {
  std::vector<RampFrame> frames;
  for (int i = 0; i < 3; ++i)
    frames.push_back(
        frame_of(lens(44.0f + 3.0f * static_cast<float>(i), 40.0f), 90u + static_cast<unsigned>(i)));
  for (const Smoothing smoothing : {Smoothing::kAdaptive, Smoothing::kPeronaMalik}) {
    const SmoothingOptions options{.smoothing = smoothing};
    const RampFrame one = smoothed(options, {&frames[0], &frames[1], &frames[2]}, 1, 1);
    for (const int thread_count : {2, 7}) {
      const RampFrame several = smoothed(options, {&frames[0], &frames[1], &frames[2]}, 1, thread_count);
      EXPECT_EQ(one.x_px, several.x_px);
      EXPECT_EQ(one.y_px, several.y_px);
      EXPECT_EQ(one.rho, several.rho);
    }
  }
}

// Two panes that meet at an odd column, in a picture large enough to be smoothed at half resolution.
constexpr int kLargeWidth = 1000, kLargeHeight = 500;
Truth large_panes(float x, float y) {
  Truth truth = pane(x, y);
  truth.object = in_disc(x, y, 500.0f, 250.0f, 150.0f);
  if (x > 501.0f) truth.x_px += 12.0f;
  return truth;
}
RampFrame large_frame(unsigned seed) {
  return frame_of(large_panes, seed, 1.0f, kLargeWidth, kLargeHeight);
}

TEST(RampSmoother, LargePicturesAreSmoothedFurther) {
  const RampFrame frame = large_frame(120);
  const RampFrame result = smoothed({.reach = 0}, {&frame}, 0);
  const auto middle = [](float x, float y) {
    return in_disc(x, y, 500.0f, 250.0f, 130.0f) && std::abs(x - 501.0f) > 20.0f;
  };
  // 53 pixels of half the resolution (see PlanesAreFittedAsWellAsTheWindowAllows) are 212.
  const double best = kSd_px / 0.9 / std::sqrt(212.0);
  EXPECT_GT(error_px(result, large_panes, middle), 0.9 * best);
  EXPECT_LT(error_px(result, large_panes, middle), 1.3 * best);
}

TEST(RampSmoother, EdgesOfLargePicturesStay) {
  const RampFrame frame = large_frame(121);
  const auto at_edge = [](float x, float y) {
    return std::abs(x - 501.0f) < 2.0f && in_disc(x, y, 500.0f, 250.0f, 140.0f);
  };
  const auto at_rim = [](float x, float y) {
    return in_disc(x, y, 500.0f, 250.0f, 150.0f) && !in_disc(x, y, 500.0f, 250.0f, 148.0f);
  };
  const RampFrame result = smoothed({.reach = 0}, {&frame}, 0);
  // Coarse pixels across the edge are 6 px off, on both sides.
  EXPECT_LT(error_px(result, large_panes, at_edge), error_px(frame, large_panes, at_edge));
  EXPECT_LT(error_px(result, large_panes, at_rim), 0.5 * error_px(frame, large_panes, at_rim));
}

TEST(RampSmoother, LargePicturesMayHaveOddSides) {
  // The object reaches every side of the picture.
  const Scene all = [](float x, float y) {
    Truth truth = pane(x, y);
    truth.object = true;
    return truth;
  };
  const RampFrame frame = frame_of(all, 124, 1.0f, 1001, 501);
  const RampFrame result = smoothed({.reach = 0}, {&frame}, 0);
  EXPECT_LT(error_px(result, all, [](float, float) { return true; }), kSd_px / 0.9 / std::sqrt(53.0));
}

TEST(RampSmoother, ThreadsChangeNothingInLargePictures) {
  const std::vector<RampFrame> frames{large_frame(122), large_frame(123)};
  const RampFrame one = smoothed({}, {&frames[0], &frames[1]}, 1, 1);
  for (const int thread_count : {2, 7}) {
    const RampFrame several = smoothed({}, {&frames[0], &frames[1]}, 1, thread_count);
    EXPECT_EQ(one.x_px, several.x_px);
    EXPECT_EQ(one.rho, several.rho);
  }
}

TEST(PeronaMalik, SmoothesNoiseAndKeepsSteps) {
  const Scene flats = [](float x, float y) {
    return Truth{.object = in_disc(x, y, 48.0f, 40.0f, 36.0f),
                 .x_px = x < 48.0f ? 20.0f : 80.0f,
                 .y_px = 40.0f,
                 .rho = 1.0f};
  };
  const RampFrame frame = frame_of(flats, 100);
  for (const bool exponential : {true, false}) {
    const RampFrame result = smoothed({.smoothing = Smoothing::kPeronaMalik,
                                       .iterations = 20,
                                       .contrast_px = 4.0,
                                       .exponential = exponential},
                                      {&frame}, 0);
    // 20 steps of 1/6 are a Gaussian of variance 20/3 px^2 where nothing holds them back: 84 pixels.
    EXPECT_LT(error_px(result, flats, pane_middle), 0.4 * kSd_px) << exponential;
    EXPECT_EQ(result.rho, frame.rho);
  }
}

}  // namespace
}  // namespace glasswing
