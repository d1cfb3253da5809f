// The background map in an independent renderer's rigs, and object masks of real glass.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "core/composite/compositor.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/import/foreign_manifest.h"
#include "solver/background/empty_stage.h"
#include "solver/gaussian/stack_layout.h"
#include "solver/method/exposure_merge.h"
#include "solver/method/sample_noise.h"
#include "tests/solver/stack_of.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

fs::path data_directory() {
  const char* data = std::getenv("GLASSWING_DATA");
  return data == nullptr ? fs::path("/nonexistent") : fs::path(data);
}

struct Rig {
  v1::CaptureManifest manifest;
  std::vector<Image16> frames;

  Rig(const fs::path& directory, const std::vector<int>& wanted)
      : manifest(read_any_manifest(directory).value()), frames(static_cast<size_t>(manifest.frames_size())) {
    for (const int frame : wanted) {
      frames[frame] = read_frame_file(directory / manifest.frames(frame).file()).value();
    }
  }
  void add_noise(double sd) {
    std::mt19937 random(7);
    std::normal_distribution<float> normal(0.0f, static_cast<float>(sd));
    for (Image16& frame : frames) {
      for (std::uint16_t& code : frame.samples) code = code16_of(radiance_of(code) + normal(random));
    }
  }
  FrameStack stack() const { return stack_of(manifest, frames); }
};

// Continuous camera px to monitor px, from the renderer's manifest; no solver reads it.
struct TrueMap {
  std::vector<std::vector<double>> rows;

  explicit TrueMap(const fs::path& directory) {
    nlohmann::json json;
    std::ifstream(directory / "manifest.json") >> json;
    rows = json["cam_to_mon_affine"].get<std::vector<std::vector<double>>>();
  }
  double at(size_t axis, int x, int y) const {
    return rows[axis][0] * (x + 0.5) + rows[axis][1] * (y + 0.5) + rows[axis][2];
  }
};

double psnr_db(const RadianceImage& a, const RadianceImage& b) {
  double sum = 0.0;
  for (size_t i = 0; i < a.samples.size(); ++i) {
    sum += std::pow(static_cast<double>(a.samples[i]) - static_cast<double>(b.samples[i]), 2);
  }
  return -10.0 * std::log10(sum / static_cast<double>(a.samples.size()));
}

void expect_map_of_misregistered_rig(double noise_sd, double worst_allowed_px, double min_db) {
  const fs::path directory = data_directory() / "rendered/dev/G_misregistered";
  if (!fs::exists(directory)) GTEST_SKIP() << "no data at " << directory << "; set GLASSWING_DATA";
  const TrueMap truth(directory);
  const std::vector<EmptyMonitor> monitors = lay_out_empty_stage(read_any_manifest(directory).value());
  Rig rig(directory, frames_of(monitors));
  if (noise_sd > 0.0) rig.add_noise(noise_sd);
  const FrameStack stack = rig.stack();
  const v1::Camera& camera = rig.manifest.camera();
  const BackgroundMap map(monitors[0], sample_noise(camera, noise_sd));
  Matte matte(0, 0, camera.width_px(), camera.height_px(), 1);
  *matte.metadata.mutable_monitors() = rig.manifest.monitors();
  EmptyPixel pixel;
  double squares = 0.0, worst_px = 0.0;
  int ambiguous = 0;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      gather(stack, monitors[0], x, y, pixel);
      const BackgroundPoint point = map.point(pixel, straight_view(camera, monitors[0], x, y));
      ASSERT_TRUE(point.seen) << x << " " << y;
      if (point.ambiguous) ++ambiguous;
      for (size_t axis = 0; axis < 2; ++axis) {
        const double error_px = point.axis[axis].centre_px - truth.at(axis, x, y);
        squares += error_px * error_px;
        worst_px = std::max(worst_px, std::abs(error_px));
      }
      for (int c = 0; c < kChannels; ++c) {
        const size_t channel = c;
        matte.modes(x, y, c)[0] = point.mode(c, 0);
        matte.foreground(x, y)[channel] = static_cast<float>(point.foreground[channel]);
      }
    }
  }
  const RadianceImage photograph =
      read_radiance(directory / "ref/stilllife_bg.png", Encoding::kLinear).value();
  const RadianceImage background =
      read_radiance(directory / "stim/photo_stilllife.png", Encoding::kLinear).value();
  const double got_db = psnr_db(composite(matte, {background}).value(), photograph);
  const int pixels = matte.width_px() * matte.height_px();
  std::printf("noise %.2f: centre %.3f px rms, %.3f px worst, %d of %d ambiguous, photograph %.1f dB\n",
              noise_sd, std::sqrt(squares / (2.0 * pixels)), worst_px, ambiguous, pixels, got_db);
  EXPECT_LT(worst_px, worst_allowed_px);
  EXPECT_GT(got_db, min_db);
  EXPECT_LT(ambiguous, pixels / 100);
}

// The renderer's pixel is 4x4 rays 0.26 px apart: a position within that gives the same light.
TEST(RenderedRig, TheMapOfACameraThatIsNotRegisteredIsFound) {
  expect_map_of_misregistered_rig(0.0, 0.3, 60.0);
}

TEST(RenderedRig, TheMapIsFoundInNoiseOfOnePercent) {
  expect_map_of_misregistered_rig(0.01, 0.5, 45.0);
}

class Silhouette : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Scenes, Silhouette,
                         testing::Values("A_crystal", "B_bimodal", "C_brushed", "D_foreground",
                                         "E_twomonitors", "G_misregistered"),
                         [](const auto& test) { return std::string(test.param); });

TEST_P(Silhouette, IsTheRenderersMaskButForWhatChangesNoLight) {
  const fs::path directory = data_directory() / "rendered/dev" / GetParam();
  if (!fs::exists(directory)) GTEST_SKIP() << "no data at " << directory << "; set GLASSWING_DATA";
  const std::vector<StageLayout::Pair> layout =
      lay_out(read_any_manifest(directory).value()).value().stage.pairs;
  std::vector<int> wanted;
  for (const StageLayout::Pair& pair : layout) {
    for (const Shot& shot : {pair.object, pair.empty}) {
      for (const ExposedFrame& exposed : shot) wanted.push_back(exposed.frame);
    }
  }
  Rig rig(directory, wanted);
  const Image16 mask = read_frame_file(directory / "mask_true.png").value();
  constexpr double kNoise = 0.005;
  rig.add_noise(kNoise);
  const FrameStack stack = rig.stack();
  const SilhouetteTest test(0.006);
  const SampleNoise sample = sample_noise(rig.manifest.camera(), kNoise);
  std::array<int, 2> count{}, positive{};
  std::vector<SilhouetteTest::Pair> pairs;
  for (int y = 0; y < mask.height_px; ++y) {
    for (int x = 0; x < mask.width_px; ++x) {
      const int covered = mask.at(x, y, 0);
      if (covered > 0 && covered < 65535) continue;
      pairs.clear();
      for (const StageLayout::Pair& pair : layout) {
        for (int c = 0; c < kChannels; ++c) {
          const MergedSample object = merge(stack, pair.object, stack.sample_index(x, y, c), sample);
          const MergedSample empty = merge(stack, pair.empty, stack.sample_index(x, y, c), sample);
          pairs.push_back({.object = object.radiance,
                           .empty = empty.radiance,
                           .variance = object.variance + empty.variance,
                           .saturated = object.saturated && empty.saturated});
        }
      }
      const size_t inside = covered > 0 ? 1 : 0;
      ++count[inside];
      if (test.test(pairs).object) ++positive[inside];
    }
  }
  const double inside = 1.0 * positive[1] / count[1], outside = 1.0 * positive[0] / count[0];
  std::printf("%-15s %.2f %% of the object, %.2f %% of what is not\n", GetParam(), 100.0 * inside,
              100.0 * outside);
  EXPECT_GT(inside, 0.99);
  EXPECT_LT(outside, 0.002);
}

// Photographs of real glass, 8-bit JPEG, with and without it before one picture: three samples a pixel, where
// a session has about a hundred. Codes stand for radiance. Two codes are about the noise of such a photograph
// (half of the certain background's differences are below 2 to 3 codes). Within each object are pixels that
// show the same code as without it; only their neighbours tell what they are.
struct Glass {
  const char* name;
  double min_inside, max_outside;
};

class RealGlass : public testing::TestWithParam<Glass> {};

INSTANTIATE_TEST_SUITE_P(Objects, RealGlass,
                         testing::Values(Glass{"dragon", 0.97, 0.01}, Glass{"two_glass", 0.8, 0.01},
                                         Glass{"horse", 0.99, 0.02}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(RealGlass, IsToldFromItsBackgroundPixelByPixel) {
  const fs::path directory = data_directory() / "real/tomnet_real_glass/pairs";
  if (!fs::exists(directory)) GTEST_SKIP() << "no data at " << directory << "; set GLASSWING_DATA";
  const auto picture = [&](const std::string& suffix) {
    return read_radiance(directory / (GetParam().name + suffix), Encoding::kLinear).value();
  };
  const RadianceImage object = picture(".jpg"), empty = picture("_bg.jpg"), trimap = picture("_trimap.png");
  for (const double sd_codes : {1.0, 2.0, 3.0}) {
    const SilhouetteTest test(0.006);
    const SampleNoise sample{.read_sd = sd_codes / 255.0, .gain = 0.0};
    std::array<int, 2> count{}, positive{};
    for (int y = 0; y < object.height_px; ++y) {
      for (int x = 0; x < object.width_px; ++x) {
        const float known =
            trimap.at(x * trimap.width_px / object.width_px, y * trimap.height_px / object.height_px, 0);
        if (known > 0.1f && known < 0.9f) continue;
        std::array<SilhouetteTest::Pair, 3> pairs;
        for (int c = 0; c < kChannels; ++c) {
          const auto with = static_cast<double>(object.at(x, y, c)),
                     without = static_cast<double>(empty.at(x, y, c));
          pairs[c] = {.object = with,
                      .empty = without,
                      .variance = 2.0 * sample.variance(0.0),
                      .saturated = with == 1.0 && without == 1.0};
        }
        const size_t inside = known > 0.5f ? 1 : 0;
        ++count[inside];
        if (test.test(pairs).object) ++positive[inside];
      }
    }
    const double inside = 1.0 * positive[1] / count[1], outside = 1.0 * positive[0] / count[0];
    std::printf("%-9s sd %.0f codes: %.2f %% of the certain object, %.2f %% of the certain background\n",
                GetParam().name, sd_codes, 100.0 * inside, 100.0 * outside);
    if (sd_codes != 2.0) continue;
    EXPECT_GT(inside, GetParam().min_inside);
    EXPECT_LT(outside, GetParam().max_outside);
  }
}

}  // namespace
}  // namespace glasswing
