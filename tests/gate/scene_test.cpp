// Composites of the scenes, solved and composited as in production, hold their floors.
#include "tests/gate/scene.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cstdlib>

#include "core/composite/compositor.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/gate/floors.h"
#include "tests/gate/ways.h"
#include "tests/solver/stack_of.h"
#include "tests/support/status.h"

namespace glasswing::gate {
namespace {

// The frames of a video in memory.
class Clip final : public VideoSource {
 public:
  Clip(const v1::CaptureManifest& manifest, const std::vector<Image16>& frames)
      : manifest_(manifest), frames_(frames) {}
  const v1::CaptureManifest& manifest() const override { return manifest_; }
  absl::StatusOr<VideoFrame> read(int frame) override {
    const Image16& image = frames_.at(static_cast<size_t>(frame));
    return VideoFrame{
        .view = {.width_px = image.width_px, .height_px = image.height_px, .samples = image.samples},
        .owner = nullptr};
  }

 private:
  const v1::CaptureManifest& manifest_;
  const std::vector<Image16>& frames_;
};

// A still, or the frames of a video.
std::vector<Matte> solved(const Way& way, const v1::CaptureManifest& manifest,
                          const std::vector<Image16>& frames) {
  if (const auto video = make_video_method(way.method, way.options).value()) {
    Clip clip(manifest, frames);
    std::vector<Matte> mattes;
    const absl::Status status =
        video->solve(clip, 0, manifest.plan().ramp().frames(), 0, {}, [&](int, absl::StatusOr<Matte> matte) {
          if (matte.ok()) mattes.push_back(*std::move(matte));
          return matte.status();
        });
    EXPECT_OK(status);
    return mattes;
  }
  auto matte =
      solve_in_bands(*make_method(way.method, way.options).value(), manifest, stack_of(manifest, frames));
  EXPECT_OK(matte);
  if (!matte.ok()) return {};
  return {*std::move(matte)};
}

const std::vector<Scene>& scenes() {
  static const std::vector<Scene> all = [] {
    std::vector<Scene> both = analytic_scenes();
    for (Scene& scene : traced_scenes()) both.push_back(std::move(scene));
    return both;
  }();
  return all;
}

// Floors hold on every processor: they are recorded with new vector instructions and with old ones, which
// round differently, and the lower result counts.
void set_vector_target() {
  if (const char* const name = std::getenv("GLASSWING_GATE_VECTORS"); name != nullptr)
    hwy::SetSupportedTargetsForTest(std::string(name) == "sse4" ? HWY_SSE4 : HWY_AVX2);
}

TEST(Gate, HoldsItsFloors) {
  set_vector_target();
  std::map<std::string, std::vector<std::string>> measured;
  for (const Scene& scene : scenes()) {
    measured[scene.name] = scene.methods;
    for (const std::string& name : scene.methods) {
      const Way& way = ways().at(name);
      const Recording recording = recorded(scene, way.plan);
      Floors floors(scene.name, name);
      for (const auto& [noise, noise_sd] : {std::pair{"0", 0.0}, {"0.5", 0.005}, {"2", 0.02}}) {
        const std::vector<Matte> mattes = solved(way, recording.manifest, noisy(recording.frames, noise_sd));
        for (const char* background : {"waves", "checks", "grain"}) {
          const std::vector<RadianceImage> shown = pictures(scene, background);
          const RadianceImage truth = photograph(scene, true, shown);
          double db = 0.0;
          for (const Matte& matte : mattes)
            db += psnr(scene, composite(matte, shown).value(), truth) / static_cast<double>(mattes.size());
          floors.reached(noise, background, db);
        }
      }
    }
  }
  measured["letters"] = {"gaussian"};  // letters_test.cpp
  expect_no_other_floors(measured);
}

}  // namespace
}  // namespace glasswing::gate
