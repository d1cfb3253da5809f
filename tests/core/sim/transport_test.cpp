#include "core/sim/transport.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <tuple>

#include "core/sim/scene.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth_px = 64, kHeight_px = 48;
constexpr MonitorSize kSize{kWidth_px, kHeight_px};

Transport built(const std::string& scene, bool object = true,
                const std::vector<SceneMonitor>& monitors = {{"back", kSize}}) {
  return *build_transport(scene, object, monitors, kWidth_px, kHeight_px);
}

RadianceImage random_picture(int width_px, int height_px) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<float> uniform;
  RadianceImage picture(width_px, height_px);
  std::generate(picture.samples.begin(), picture.samples.end(), [&] { return uniform(random); });
  return picture;
}

RadianceImage respond(const Transport& transport, const RadianceImage& picture) {
  return transport.respond(std::vector<RadianceImage>{picture});
}

bool is_empty_stage(std::span<const Tap> taps, int x, int y) {
  return taps.size() == 1 && taps[0].x_px == x && taps[0].y_px == y && taps[0].weight == 1.0f;
}

// The moments of a pixel's footprint, in monitor px.
struct Footprint {
  double weight = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
};
Footprint footprint_of(std::span<const Tap> taps) {
  Footprint f;
  for (const Tap& tap : taps) {
    f.weight += tap.weight;
    f.x += double{tap.weight} * tap.x_px;
    f.y += double{tap.weight} * tap.y_px;
  }
  f.x /= f.weight;
  f.y /= f.weight;
  for (const Tap& tap : taps) {
    const double part = tap.weight / f.weight;
    f.xx += part * (tap.x_px - f.x) * (tap.x_px - f.x);
    f.xy += part * (tap.x_px - f.x) * (tap.y_px - f.y);
    f.yy += part * (tap.y_px - f.y) * (tap.y_px - f.y);
  }
  return f;
}

TEST(Transport, AnEmptyStageShowsTheBackMonitorAsItIs) {
  const RadianceImage picture = random_picture(kWidth_px, kHeight_px);
  EXPECT_EQ(respond(built("none"), picture).samples, picture.samples);
  for (const char* scene : {"crystal", "glass", "brushed"}) {
    EXPECT_EQ(respond(built(scene, false), picture).samples, picture.samples) << scene;
  }
}

TEST(Transport, ACoarserCameraAveragesBoxesOfMonitorPixels) {
  const RadianceImage picture = random_picture(2 * kWidth_px, 4 * kHeight_px);
  const RadianceImage seen =
      respond(built("none", true, {{"back", {2 * kWidth_px, 4 * kHeight_px}}}), picture);
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      float mean = 0.0f;
      for (int i = 0; i < 8; ++i) mean += picture.at(2 * x + i % 2, 4 * y + i / 2, 0) / 8.0f;
      EXPECT_NEAR(seen.at(x, y, 0), mean, 1e-6f);  // a few roundings of floats below 1
    }
  }
}

TEST(Transport, AFinerCameraSeesFlatPixels) {
  const RadianceImage picture = random_picture(kWidth_px / 4, kHeight_px / 2);
  const RadianceImage seen =
      respond(built("none", true, {{"back", {kWidth_px / 4, kHeight_px / 2}}}), picture);
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) EXPECT_EQ(seen.at(x, y, 2), picture.at(x / 4, y / 2, 2));
  }
}

TEST(Transport, GivesNoMoreLightThanThereIs) {
  const std::vector<SceneMonitor> room{
      {"left", {40, 48}}, {"back", kSize}, {"top", {64, 30}}, {"right", {50, 48}}};
  for (const char* scene : {"crystal", "glass", "brushed", "wobble"}) {
    const Transport transport = built(scene, true, room);
    std::vector<double> light_of(room.size());
    for (int i = 0; i < kWidth_px * kHeight_px * 3; ++i) {
      const auto taps = transport.taps(i / 3 % kWidth_px, i / 3 / kWidth_px, i % 3);
      double sum = 0.0;
      for (size_t t = 0; t < taps.size(); ++t) {
        const Tap& tap = taps[t];
        const size_t m = tap.monitor;
        ASSERT_LT(m, room.size());
        ASSERT_TRUE(tap.x_px >= 0 && tap.x_px < room[m].size.width_px && tap.y_px >= 0 &&
                    tap.y_px < room[m].size.height_px);
        ASSERT_GT(tap.weight, 0.0f);
        if (t > 0) {
          ASSERT_LT(std::tuple(taps[t - 1].monitor, taps[t - 1].y_px, taps[t - 1].x_px),
                    std::tuple(tap.monitor, tap.y_px, tap.x_px));
        }
        sum += tap.weight;
        light_of[m] += tap.weight;
      }
      ASSERT_LE(sum, 1.0 + 1e-5);  // a few hundred floats, each rounded by 6e-8 of itself
    }
    // A crystal collects light from everywhere.
    if (std::string(scene) == "crystal") {
      for (const double light : light_of) EXPECT_GT(light, 1.0);
    }
  }
}

// The ball and the sheet reflect and transmit all light that falls on them.
TEST(Transport, GlassLosesOnlyTheFaintestPaths) {
  const auto scene = make_scene("glass", kSize);
  ASSERT_OK(scene);
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 eye{32.0, 24.0, -256.0};
    const auto paths = (*scene)->trace({eye, normalized(Vec3{i % 20 * 3.2, i / 20 * 2.4, 0.0} - eye)}, 0, 0);
    if (!paths) continue;
    ++hits;
    double sum = 0.0;
    for (const Path& path : *paths) sum += path.weight;
    EXPECT_LE(sum, 1.0 + 1e-12);
    // Each of nine paths is dropped only below 0.002, and the share left inside after seven bounces is (1 -
    // m) m^7 for a reflectance m, which is largest at m = 7/8.
    EXPECT_GE(sum, 1.0 - 9 * 0.002 - std::pow(7.0 / 8.0, 7) / 8.0);
  }
  EXPECT_GT(hits, 50);
}

TEST(Transport, TheCrystalSplitsColours) {
  const Transport transport = built("crystal");
  int object = 0, split = 0, lit = 0;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      if (is_empty_stage(transport.taps(x, y, 0), x, y)) continue;
      ++object;
      const Footprint red = footprint_of(transport.taps(x, y, 0));
      const Footprint blue = footprint_of(transport.taps(x, y, 2));
      if (!(red.weight > 0.5 && blue.weight > 0.5)) continue;
      ++lit;
      if (std::hypot(red.x - blue.x, red.y - blue.y) > 0.5) ++split;
    }
  }
  EXPECT_NEAR(object / double{kWidth_px * kHeight_px}, 0.35, 0.1);
  EXPECT_GT(lit, object / 2);
  EXPECT_GT(split, object / 4);
}

TEST(Transport, TheGlassMirrorsAndTransmitsAtOnce) {
  const Transport transport = built("glass");
  int both = 0;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      // At least a tenth of the light comes straight through, and a tenth from more than 6 px beside it.
      double straight = 0.0, aside = 0.0;
      for (const Tap& tap : transport.taps(x, y, 1)) {
        const double distance_px = std::hypot(tap.x_px - x, tap.y_px - y);
        if (distance_px < 1.5) straight += tap.weight;
        if (distance_px > 6.0) aside += tap.weight;
      }
      if (straight > 0.1 && aside > 0.1) ++both;
    }
  }
  EXPECT_GT(both, kWidth_px * kHeight_px / 20);
}

TEST(Transport, TheBrushedMetalSpreadsLightAslant) {
  const Transport transport = built("brushed");
  int metal = 0, aslant = 0;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const bool stage = is_empty_stage(transport.taps(x, y, 1), x, y);
      for (int c = 0; c < 3; ++c) EXPECT_EQ(transport.foreground(x, y, c) > 0.0f, !stage);
      const Footprint f = footprint_of(transport.taps(x, y, 1));
      // Away from all edges: the metal's full green, 0.74.
      if (stage || std::abs(f.weight - 0.74) > 1e-4) continue;
      ++metal;
      if (std::abs(f.xy) > 0.3 * std::sqrt(f.xx * f.yy) && f.xx + f.yy > 1.0) ++aslant;
    }
  }
  EXPECT_GT(metal, kWidth_px * kHeight_px / 20);
  EXPECT_GT(aslant, metal / 2);
}

TEST(Transport, IsTheSameEveryTime) {
  const RadianceImage picture = random_picture(kWidth_px, kHeight_px);
  for (const char* scene : {"crystal", "glass", "brushed"}) {
    EXPECT_EQ(respond(built(scene), picture).samples, respond(built(scene), picture).samples) << scene;
  }
}

TEST(Transport, NamesWhatItDoesNotHave) {
  const auto message = [](const std::string& scene, const std::vector<SceneMonitor>& monitors) {
    const auto transport = build_transport(scene, true, monitors, 8, 8);
    EXPECT_EQ(transport.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(transport.status().message());
  };
  EXPECT_EQ(
      message("vase", {{"back", kSize}}),
      "scene is \"vase\"; there are: crystal, glass, brushed, still-life, wobble, wobble-lit, board, none");
  EXPECT_EQ(message("none", {{"front", kSize}}),
            "monitor \"front\" has no place in the scene; there are: back, left, right, top");
  EXPECT_EQ(message("none", {{"left", kSize}}), "a scene needs a monitor \"back\", behind the object");
}

TEST(Transport, APhaseIsTheObjectBeforeTheEmptyStage) {
  const StageTransports stage = build_phases("wobble", {{"back", kSize}}, kWidth_px, kHeight_px).value();
  ASSERT_EQ(stage.phases.size(), static_cast<size_t>(motion_of("wobble").phases));
  const RadianceImage picture = random_picture(kWidth_px, kHeight_px);
  EXPECT_EQ(respond(*stage.empty, picture).samples, picture.samples);
  EXPECT_EQ(respond(*stage.phases[0], picture).samples, respond(built("wobble"), picture).samples);
  for (const auto& phase : stage.phases) {
    int object = 0;
    for (int y = 0; y < kHeight_px; ++y) {
      for (int x = 0; x < kWidth_px; ++x) object += !is_empty_stage(phase->taps(x, y, y % 3), x, y);
    }
    // The object lies within the picture.
    EXPECT_GT(object, kWidth_px * kHeight_px / 10);
    EXPECT_LT(object, kWidth_px * kHeight_px / 3);
    for (const int x : {0, kWidth_px - 1}) {
      for (int y = 0; y < kHeight_px; ++y) EXPECT_TRUE(is_empty_stage(phase->taps(x, y, 0), x, y));
    }
  }
  // A static scene has one phase, which is the same however it is stored.
  for (const std::string scene : {"crystal", "glass", "brushed"}) {
    const StageTransports still = build_phases(scene, {{"back", kSize}}, kWidth_px, kHeight_px).value();
    ASSERT_EQ(still.phases.size(), 1u);
    EXPECT_EQ(respond(*still.phases[0], picture).samples, respond(built(scene), picture).samples);
  }
}

TEST(Transport, ATraceReportsItsShareAndStopsWhenItIsTold) {
  for (const std::string scene : {"wobble", "crystal", "none"}) {
    SCOPED_TRACE(scene);
    std::vector<double> shares;
    const auto note = [&](double share) {
      shares.push_back(share);
      return true;
    };
    const auto build = [&](const TraceReport& report) {
      return build_phases(scene, {{"back", kSize}}, kWidth_px, kHeight_px, kRaysAcross, kFocalWidths, report);
    };
    ASSERT_OK(build(note));
    EXPECT_GT(shares.front(), 0.0);
    EXPECT_LT(shares.front(), 0.1);  // a row of the empty stage
    EXPECT_TRUE(std::ranges::is_sorted(shares));
    EXPECT_NEAR(shares.back(), 1.0, 1e-12);  // a sum of some thousand parts
    EXPECT_LE(shares.back(), 1.0);
    for (const size_t rows : {size_t{1}, shares.size() - 1}) {
      size_t left = rows;
      EXPECT_TRUE(absl::IsCancelled(build([&](double) { return --left > 0; }).status())) << rows;
      EXPECT_EQ(left, 0u);  // it is not asked again
    }
  }
}

// Also from the last phase to the first.
TEST(Transport, AMovingSceneGoesRoundInSmallSteps) {
  const StageTransports stage = build_phases("wobble", {{"back", kSize}}, kWidth_px, kHeight_px).value();
  const auto change = [&](size_t a, size_t b) {
    int changed = 0;
    for (int y = 0; y < kHeight_px; ++y) {
      for (int x = 0; x < kWidth_px; ++x) {
        changed += is_empty_stage(stage.phases[a]->taps(x, y, 0), x, y) !=
                   is_empty_stage(stage.phases[b]->taps(x, y, 0), x, y);
      }
    }
    return changed;
  };
  const size_t count = stage.phases.size();
  for (size_t i = 0; i < count; ++i) {
    EXPECT_GT(change(i, (i + count / 2) % count) + change(i, (i + count / 4) % count), 0);
    EXPECT_LT(change(i, (i + 1) % count), change(i, (i + count / 4) % count));
  }
  const Motion motion = motion_of("wobble");
  EXPECT_EQ(motion.phase_at(nanoseconds(0)), 0);
  EXPECT_EQ(motion.phase_at(motion.period - nanoseconds(1)), motion.phases - 1);
  EXPECT_EQ(motion.phase_at(-nanoseconds(1)), motion.phases - 1);
  EXPECT_EQ(motion.phase_at(7 * motion.period + motion.period / 4), motion.phases / 4);
  EXPECT_EQ(motion_of("crystal").phase_at(std::chrono::hours(1)), 0);
}

// The lamp is visible only in reflections, and does not change the monitors' light.
TEST(Transport, ALampAddsHighlightsAlone) {
  const Transport dark = built("wobble"), lit = built("wobble-lit");
  const RadianceImage picture = random_picture(kWidth_px, kHeight_px), black(kWidth_px, kHeight_px);
  const RadianceImage without = respond(dark, picture), with = respond(lit, picture),
                      own = respond(lit, black);
  EXPECT_EQ(respond(dark, black).samples, black.samples);
  int highlight = 0;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const float f = lit.foreground(x, y, 0);
      highlight += f > 0.0f;
      for (int c = 0; c < 3; ++c) {
        EXPECT_EQ(own.at(x, y, c), f);
        EXPECT_NEAR(with.at(x, y, c), without.at(x, y, c) + f, 1e-5);  // float sums
      }
      EXPECT_FALSE(f > 0.0f && is_empty_stage(lit.taps(x, y, 0), x, y));
    }
  }
  EXPECT_GT(highlight, 0);
  EXPECT_LT(highlight, kWidth_px * kHeight_px / 50);
}

// With every ray of a pixel as a pixel of its own, their sum sees the same light, scattered or not.
TEST(Transport, RaysAsPixelsSeeTheSameLight) {
  const RadianceImage picture = random_picture(kWidth_px, kHeight_px);
  for (const std::string scene : {"crystal", "brushed", "wobble-lit"}) {
    const RadianceImage whole = respond(built(scene), picture);
    const RadianceImage rays = respond(*build_transport(scene, true, {{"back", kSize}},
                                                        kRaysAcross * kWidth_px, kRaysAcross * kHeight_px, 1),
                                       picture);
    RadianceImage sum(kWidth_px, kHeight_px);
    for (int y = 0; y < rays.height_px; ++y) {
      for (int x = 0; x < rays.width_px; ++x) {
        for (int c = 0; c < 3; ++c)
          sum.at(x / kRaysAcross, y / kRaysAcross, c) += rays.at(x, y, c) / (kRaysAcross * kRaysAcross);
      }
    }
    for (size_t i = 0; i < whole.samples.size(); ++i)
      ASSERT_NEAR(sum.samples[i], whole.samples[i], 1e-5) << scene;  // float sums
  }
}

TEST(Transport, AnyFocalLengthFillsThePictureWithTheBackMonitor) {
  const RadianceImage picture = random_picture(kWidth_px, kHeight_px);
  for (const double focal_widths : {1.0, 1.5, 40.0}) {
    const Transport transport =
        *build_transport("none", true, {{"back", kSize}}, kWidth_px, kHeight_px, kRaysAcross, focal_widths);
    EXPECT_EQ(respond(transport, picture).samples, picture.samples) << focal_widths;
  }
}

// With 1.6 pixels of the monitor to one of the camera, points of four rays fall on edges of pixels.
TEST(Transport, AreasOfRaysTileThePixel) {
  constexpr int kCamera_px = 10, kMonitor_px = 16;
  constexpr double kRatio = 1.6;
  const Transport transport = *build_transport("none", true, {{"back", {kMonitor_px, kMonitor_px}}},
                                               kCamera_px, kCamera_px, kRaysAcross, kFocalWidths, {}, true);
  const auto covered = [](int pixel, int of) {
    return std::max(std::min(kRatio * (pixel + 1), of + 1.0) - std::max(kRatio * pixel, 1.0 * of), 0.0) /
           kRatio;
  };
  for (int y = 0; y < kCamera_px; ++y) {
    for (int x = 0; x < kCamera_px; ++x) {
      double light = 0.0;
      for (const Tap& tap : transport.taps(x, y, 0)) {
        ASSERT_NEAR(tap.weight, covered(x, tap.x_px) * covered(y, tap.y_px), 1e-5) << x << " " << y;
        light += tap.weight;
      }
      ASSERT_NEAR(light, 1.0, 1e-5);
    }
  }
}

// What the rays of a pixel cover together does not depend on how many they are.
TEST(Transport, AreasOfFewRaysAreThoseOfMany) {
  const auto traced = [](int rays_across, bool areas) {
    return *build_transport("glass", true, {{"back", kSize}}, kWidth_px / 2, kHeight_px / 2, rays_across, 2.0,
                            {}, areas);
  };
  const Transport many = traced(48, false), few = traced(4, true), points = traced(4, false);
  std::vector<double> of_areas, of_points;  // how far their middles are off
  for (int y = 0; y < kHeight_px / 2; ++y) {
    for (int x = 0; x < kWidth_px / 2; ++x) {
      const Footprint truth = footprint_of(many.taps(x, y, 0));
      if (std::hypot(truth.x - (2 * x + 0.5), truth.y - (2 * y + 0.5)) < 1.0) continue;  // no object
      const auto off = [&](const Transport& transport) {
        const Footprint own = footprint_of(transport.taps(x, y, 0));
        return std::hypot(own.x - truth.x, own.y - truth.y);
      };
      of_areas.push_back(off(few)), of_points.push_back(off(points));
    }
  }
  const auto median = [](std::vector<double>& values) {
    std::ranges::nth_element(values, values.begin() + std::ssize(values) / 2);
    return values[values.size() / 2];
  };
  EXPECT_LT(median(of_areas), 0.01);
  EXPECT_LT(median(of_areas), 0.5 * median(of_points));
}

// Rays that meet the plane of a moved monitor, in the frame of a pinhole camera, by Cramer's rule.
TEST(Transport, AMovedMonitorIsSeenInPerspective) {
  constexpr int kCameraWidth_px = 80, kCameraHeight_px = 40;  // whose pixels are no squares
  constexpr double kFocalWidths = 1.5, kPitch_mm = 0.25, kDegree = std::numbers::pi / 180.0;
  const double distance_px = kFocalWidths * kWidth_px;
  const double fx_px = kFocalWidths * kCameraWidth_px, fy_px = distance_px * kCameraHeight_px / kHeight_px;
  for (const PanelPose& pose :
       {PanelPose{.away_mm = 6.0}, PanelPose{.tilt_deg = 25.0}, PanelPose{.turn_deg = -30.0},
        PanelPose{.away_mm = 3.0, .tilt_deg = -20.0, .turn_deg = 15.0}}) {
    const Transport transport = *build_transport("none", true, {{"back", kSize, kPitch_mm, pose}},
                                                 kCameraWidth_px, kCameraHeight_px, 1, kFocalWidths);
    const double a = pose.tilt_deg * kDegree, b = pose.turn_deg * kDegree;
    // The turn times the tilt: of a matrix each.
    const Vec3 right{std::cos(b), 0.0, std::sin(b)};
    const Vec3 down{-std::sin(b) * std::sin(a), std::cos(a), std::cos(b) * std::sin(a)};
    const Vec3 middle{0.0, 0.0, distance_px + pose.away_mm / kPitch_mm};
    int seen = 0;
    for (int y = 0; y < kCameraHeight_px; ++y) {
      for (int x = 0; x < kCameraWidth_px; ++x) {
        const Vec3 ray{(x + 0.5 - 0.5 * kCameraWidth_px) / fx_px, (y + 0.5 - 0.5 * kCameraHeight_px) / fy_px,
                       1.0};
        // middle + u right + v down = s ray
        const auto triple = [](Vec3 p, Vec3 q, Vec3 r) { return dot(p, cross(q, r)); };
        const double all = triple(ray, right, down);
        const double u = triple(ray, middle, down) / -all + 0.5 * kWidth_px;
        const double v = triple(ray, right, middle) / -all + 0.5 * kHeight_px;
        const auto is_near_edge = [](double at) { return std::abs(at - std::round(at)) < 1e-9; };
        if (is_near_edge(u) || is_near_edge(v)) continue;
        const std::vector<Tap> taps = transport.taps(x, y, 1);
        const bool inside = u > 0.0 && u < kWidth_px && v > 0.0 && v < kHeight_px;
        ASSERT_EQ(taps.size(), inside ? 1u : 0u) << x << " " << y;
        if (!inside) continue;
        ++seen;
        ASSERT_EQ(taps[0].x_px, static_cast<int>(u)) << x << " " << y;
        ASSERT_EQ(taps[0].y_px, static_cast<int>(v)) << x << " " << y;
      }
    }
    EXPECT_GT(seen, kCameraWidth_px * kCameraHeight_px / 2);
  }
}

}  // namespace
}  // namespace glasswing
