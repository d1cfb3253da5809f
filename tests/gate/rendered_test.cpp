// The scenes of an independent renderer (tests/results), where they are: all methods hold their floors.
#include <gtest/gtest.h>

#include <cstdlib>

#include "core/composite/fast_compositor.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/compare/candidate.h"
#include "tests/gate/floors.h"
#include "tests/results/rendered_scene.h"
#include "tests/results/rendered_video.h"

namespace glasswing::gate {
namespace {

namespace fs = std::filesystem;

fs::path rendered() {
  const char* const data = std::getenv("GLASSWING_DATA");
  return fs::path(data == nullptr ? "/nonexistent" : data) / "rendered";
}

// Rows of the table: a method's name there, and the candidate of tests/compare.
struct Way {
  const char *name, *family, *variant;
};
const std::vector<Way> kWays{{"alpha", "alpha", "two backings"},
                             {"hierarchical", "hierarchical", "7 levels"},
                             {"fringe", "fringe, two modes", "4 periods, oblique too"},
                             {"few", "gaussian, few images", "100 images"},
                             {"gaussian", "gaussian", "all sweeps"}};

class Rendered : public testing::TestWithParam<const char*> {};

TEST_P(Rendered, HoldsItsFloors) {
  const fs::path directory = rendered() / GetParam();
  if (!fs::exists(directory)) GTEST_SKIP() << "no data at " << directory << "; set GLASSWING_DATA";
  const RenderedScene scene(directory);
  std::vector<Photograph> photographs;
  for (const std::string& name : scene.photograph_names()) photographs.push_back(scene.photograph(name));
  const std::vector<Candidate> all = candidates();
  for (const Way& way : kWays) {
    const auto own = std::ranges::find_if(
        all, [&](const Candidate& one) { return one.family == way.family && one.variant == way.variant; });
    ASSERT_NE(own, all.end()) << way.family << ", " << way.variant;
    const auto method = make_method(own->method, own->options).value();
    const SynthesizedCapture capture = own->capture(scene).value();
    Floors floors(scene.name(), way.name);
    for (const auto& [noise, noise_sd] : {std::pair{"0", 0.0}, {"0.5", 0.005}, {"2", 0.02}}) {
      const FrameStack stack = scene.stack(*method, capture, {.noise_sd = noise_sd}).value();
      const Matte matte = solve_in_bands(*method, capture.manifest, stack).value();
      // Its own error is about -70 dB; the exact compositor takes minutes for broad modes.
      const FastCompositor compositor = FastCompositor::create(matte).value();
      for (const Photograph& photograph : photographs) {
        const RadianceImage composited = compositor.composite(photograph.backgrounds).value();
        floors.reached(noise, photograph.name, scene.psnr(composited, photograph.seen));
      }
    }
  }
}

constexpr const char* kScenes[] = {"dev/A_crystal",        "dev/B_bimodal",     "dev/C_brushed",
                                   "dev/D_foreground",     "dev/E_twomonitors", "dev/G_misregistered",
                                   "dev2/H_threemonitors", "dev2/I_diffuse",    "dev2/J_edges"};
INSTANTIATE_TEST_SUITE_P(Scenes, Rendered, testing::ValuesIn(kScenes),
                         [](const auto& scene) { return fs::path(scene.param).filename().string(); });

// A raw sensor's frames, with its noise: composites in all colours, and in those that each photosite
// measures, in front of NAME and NAME_native. A third of the fits, so what interpolated frames reach (31, 32
// and 26 dB) is far below.
TEST(RenderedMosaic, HoldsItsFloors) {
  const fs::path directory = rendered() / "dev2/K_mosaic";
  if (!fs::exists(directory)) GTEST_SKIP() << "no data at " << directory << "; set GLASSWING_DATA";
  const RenderedScene scene(directory);
  const auto method = make_method("gaussian", {}).value();
  const SynthesizedCapture capture = as_recorded(scene.manifest());
  const Matte matte =
      solve_in_bands(*method, capture.manifest, scene.stack(*method, capture).value()).value();
  EXPECT_EQ(matte.metadata.mosaic(), "RGGB");
  const FastCompositor compositor = FastCompositor::create(matte).value();
  Floors floors(scene.name(), "gaussian");
  for (const std::string& name : scene.photograph_names()) {
    const Photograph photograph = scene.photograph(name);
    const RadianceImage composited = compositor.composite(photograph.backgrounds).value();
    floors.reached("0", name, scene.psnr(composited, photograph.seen));
    floors.reached("0", name + "_native", scene.native_psnr(composited, photograph.seen));
  }
}

// Noise is in the recorded frames: 1 %.
TEST(RenderedVideo, HoldsItsFloors) {
  const fs::path directory = rendered() / "dev/F_video";
  if (!fs::exists(directory)) GTEST_SKIP() << "no data at " << directory << "; set GLASSWING_DATA";
  std::map<std::string, std::vector<VideoScore>> sequences;
  const std::vector<VideoScore> all = score_video(directory, {}).value();
  for (const VideoScore& score : all) sequences[score.sequence].push_back(score);
  for (const auto& [sequence, scores] : sequences) {
    Floors floors(sequence, "ramp");
    for (const VideoScore& score : scores)
      floors.reached(sequence.ends_with("_noise") ? "1" : "0", score.photograph, score.psnr_db);
  }
}

TEST(RenderedFloors, AreOfThese) {
  std::map<std::string, std::vector<std::string>> measured;
  for (const char* scene : kScenes) {
    for (const Way& way : kWays) measured[fs::path(scene).filename().string()].push_back(way.name);
  }
  measured["K_mosaic"] = {"gaussian"};
  for (const char* sequence : {"ramp_dark", "ramp_dark_noise", "ramp_light", "ramp_light_noise"})
    measured[sequence] = {"ramp"};
  expect_no_other_floors(measured);
}

}  // namespace
}  // namespace glasswing::gate
