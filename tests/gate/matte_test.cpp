// Mattes of footprints that are known exactly: what a matte says of itself must be true, not only the picture
// made of it. Frames are sums over a monitor's flat pixels (light.h).
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/gate/matte_report.h"
#include "tests/gate/scene.h"
#include "tests/solver/stack_of.h"
#include "tests/support/status.h"

namespace glasswing::gate {
namespace {

struct Lit {
  double weight = 0.0;
  Gaussian density;
};
using Footprints = std::vector<Lit>;
using Random = std::mt19937;

double in(Random& random, double low, double high) {
  return low + (high - low) * uniform(random);
}

// A camera: its noise, relative to full scale, what it reads without light, and its exposures.
struct Camera {
  double noise_sd = 0.002, black_level = 0.0;
  std::vector<double> exposures_ms = {4.0};
  bool noise_known = true;
};

// An object of which each pixel of an ellipse sees footprints of its own.
struct Object {
  Scene scene = empty_scene("object", {});
  std::vector<Footprints> truth;  // by pixel

  explicit Object(const std::function<Footprints(Random&)>& footprints, double foreground = 0.0) {
    Random random(17);
    truth.resize(scene.object.size());
    for (size_t i = 0; i < truth.size(); ++i) {
      const double x = (2.0 * static_cast<double>(i % 32) + 1.0) / 32.0 - 1.0,
                   y = (2.0 * static_cast<double>(i / 32) + 1.0) / 24.0 - 1.0;
      scene.inside[i] = std::hypot(x, y) < 0.8;
      if (!scene.inside[i]) continue;
      truth[i] = footprints(random);
      View view{.foreground = {foreground, foreground, foreground}, .paths = {}};
      for (const Lit& own : truth[i])
        view.paths.push_back({.tint = {own.weight, own.weight, own.weight},
                              .shares = shares_of(own.density, scene.monitors[0])});
      scene.object[i] = std::move(view);
    }
  }

  Truth modes() const {
    return [this](int x, int y, int) {
      std::vector<TrueMode> own;
      for (const Lit& lit : truth[y * 32 + x])
        own.push_back({.weight = lit.weight, .x_px = lit.density.x_px, .y_px = lit.density.y_px});
      std::ranges::sort(own, [](const TrueMode& a, const TrueMode& b) { return a.weight > b.weight; });
      return own;
    };
  }
};

std::string plan_of(const Camera& camera) {
  std::string plan =
      "method: 'gaussian' solids { colour: [0, 0, 0] } solids { colour: [1, 1, 1] } square_waves { levels: 6 "
      "} "
      "sweeps { orientation_deg: 0 sigma_px: 3 } sweeps { orientation_deg: 90 sigma_px: 3 } "
      "sweeps { orientation_deg: 45 sigma_px: 3 } sweeps { orientation_deg: -45 sigma_px: 3 } ";
  for (const double exposure_ms : camera.exposures_ms)
    plan += "exposure_ms: " + std::to_string(exposure_ms) + " ";
  return plan;
}

Matte solved(const Scene& scene, const Camera& camera) {
  Recording recording = recorded(scene, plan_of(camera));
  v1::CaptureManifest& manifest = recording.manifest;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    for (float& light : recording.frames[i].samples) {
      light *= static_cast<float>(manifest.frames(i).exposure_ms() / camera.exposures_ms.front());
      light =
          static_cast<float>(camera.black_level + (1.0 - camera.black_level) * static_cast<double>(light));
    }
  }
  if (camera.noise_known) manifest.mutable_camera()->set_read_sd(camera.noise_sd);
  if (camera.black_level > 0.0) {
    v1::CameraCalibration& calibration = *manifest.mutable_camera_calibration();
    calibration.set_format_version(1);
    calibration.set_saturation(1.0);
    if (camera.noise_known) calibration.set_read_sd(camera.noise_sd / (1.0 - camera.black_level));
    for (int c = 0; c < kChannels; ++c) {
      v1::CameraCurve& curve = *calibration.add_curves();
      curve.add_light(static_cast<float>(-camera.black_level / (1.0 - camera.black_level)));
      curve.add_light(1.0f);
    }
  }
  const std::vector<Image16> frames = noisy(recording.frames, camera.noise_sd);
  auto matte = solve_in_bands(*make_method("gaussian", {}).value(), manifest, stack_of(manifest, frames));
  EXPECT_OK(matte);
  return *std::move(matte);
}

MatteReport report_of(const Object& object, const Camera& camera) {
  const MatteReport report = report_on(solved(object.scene, camera), object.modes());
  std::printf("%s", report.text().c_str());
  return report;
}

// Some 1100 lanes in 370 pixels. Two coordinates each: a share of 0.68 is known to 0.01, so this allows three
// of its standard errors beyond 0.65 to 0.72.
void expect_honest(const MatteReport& report) {
  EXPECT_GE(report.within_one, 0.62);
  EXPECT_LE(report.within_one, 0.75);
  EXPECT_LE(report.rms_z, 1.3);
}

// A footprint inside one flat pixel cannot be placed within it: its error is that of an even distribution, at
// which one in sqrt(3) lies within.
TEST(Matte, ASingleNarrowFootprintIsOneMode) {
  const Object object([](Random& random) {
    return Footprints{{0.607, gaussian({in(random, 12, 52), in(random, 12, 36), 0.3, 0.3, 0.0})}};
  });
  const MatteReport report = report_of(object, {});
  EXPECT_EQ(report.phantoms, 0);
  EXPECT_LE(report.flagged_share(), 0.005);
  EXPECT_GE(report.with_modes[1], 0.995);
  EXPECT_LE(report.centre_sd_px.max, 0.5);
  EXPECT_LE(report.error_px.most, 0.5);
  EXPECT_GE(report.within_one, 0.57);
  EXPECT_LE(report.rms_z, 1.3);
}

TEST(Matte, AHighlightOnAWideLobeIsTwoModes) {
  const Object object([](Random& random) {
    const double x = in(random, 22, 42), y = in(random, 18, 30);
    return Footprints{{0.3, gaussian({x, y, 0.8, 0.8, 0.0})},
                      {0.4, gaussian({x, y, 7.0, 5.0, in(random, -90, 90)})}};
  });
  const MatteReport report = report_of(object, {});
  EXPECT_EQ(report.phantoms, 0);
  EXPECT_LE(report.flagged_share(), 0.05);  // those with more modes than two
  EXPECT_GE(report.with_modes[2], 0.95);
}

TEST(Matte, EdgesCutFootprintsNotTruth) {
  const Object object([](Random& random) {
    return Footprints{{0.7, gaussian({in(random, 0, 5), in(random, 10, 38), 3.0, 2.0, in(random, -90, 90)})}};
  });
  const MatteReport report = report_of(object, {});
  EXPECT_EQ(report.phantoms, 0);
  EXPECT_LE(report.rms_z, 1.3);
}

// Noise below a black level is light like any other.
TEST(Matte, ZeroIsNotDark) {
  const Object object([](Random& random) {
    return Footprints{
        {in(random, 0.01, 0.02), gaussian({in(random, 20, 44), in(random, 16, 32), 1.5, 1.5, 0.0})}};
  });
  const MatteReport report =
      report_of(object, {.noise_sd = 0.002, .black_level = 0.03, .exposures_ms = {4, 16, 64}});
  EXPECT_LE(report.flagged_share(), 0.005);
  EXPECT_GE(report.with_modes[1], 0.99);
  EXPECT_LE(report.weight_rms_z, 1.3);
  expect_honest(report);
}

// A peak of twenty standard deviations, though of a thousandth of full scale.
TEST(Matte, FaintLightIsFoundWhereNoiseIsLess) {
  const Object object([](Random& random) {
    return Footprints{{0.0012, gaussian({in(random, 20, 44), in(random, 16, 32), 2.0, 2.0, 0.0})}};
  });
  const MatteReport report = report_of(object, {.noise_sd = 5e-5});
  EXPECT_LE(report.flagged_share(), 0.01);
  EXPECT_GE(report.with_modes[1], 0.99);
  EXPECT_LE(report.error_px.most, 2.0);
}

TEST(Matte, WhatNoGaussianFitsIsFlagged) {
  const Object object([](Random& random) {
    const double x = in(random, 22, 42), y = in(random, 20, 28);
    Footprints ring;
    for (int i = 0; i < 48; ++i)
      ring.push_back({0.6 / 48, gaussian({x + 12.0 * std::cos(0.1309 * i), y + 12.0 * std::sin(0.1309 * i),
                                          1.0, 1.0, 0.0})});
    return ring;
  });
  const MatteReport report = report_of(object, {});
  EXPECT_GE(report.flagged_share(), 0.95);
  EXPECT_EQ(report.phantoms, 0);
}

TEST(Matte, ThreeModesCloseTogetherKnowHowLittleTheyKnow) {
  const Object object([](Random& random) {
    const double x = in(random, 22, 42), y = in(random, 18, 30), turn = in(random, 0, 3.1),
                 apart = in(random, 1.2, 2.0) * 3.3;
    Footprints three;
    for (int i = -1; i <= 1; ++i)
      three.push_back({0.25 + 0.05 * i, gaussian({x + apart * i * std::cos(turn),
                                                  y + apart * i * std::sin(turn), 1.2, 1.2, 0.0})});
    return three;
  });
  const MatteReport report = report_of(object, {});
  EXPECT_EQ(report.phantoms, 0);
  EXPECT_LE(report.rms_z, 1.4);  // of lanes with three; the others hold two that explain their samples
}

// Beside the object one pixel in ten thousand may differ by chance.
TEST(Matte, TheSilhouetteIsTheObjects) {
  const Object object([](Random& random) {
    return Footprints{{0.6, gaussian({in(random, 20, 44), in(random, 16, 32), 1.5, 1.5, 0.0})}};
  });
  for (const double black_level : {0.0, 0.02}) {
    for (const bool known : {true, false}) {
      const Matte matte =
          solved(object.scene, {.noise_sd = 0.003, .black_level = black_level, .noise_known = known});
      int wrong = 0;
      for (size_t i = 0; i < object.truth.size(); ++i)
        wrong += !object.scene.inside[i] &&
                 matte.coverage(static_cast<int>(i % 32), static_cast<int>(i / 32)) > 0.0f;
      EXPECT_EQ(wrong, 0) << black_level << " " << known;  // of 370
    }
  }
}

}  // namespace
}  // namespace glasswing::gate
