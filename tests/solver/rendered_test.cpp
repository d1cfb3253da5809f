// Solves stacks that an independent renderer made, and holds the composites against its photographs.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/frame/archive.h"
#include "core/frame/image_file.h"
#include "core/matte/compositor.h"
#include "solver/method.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

struct Scene {
  const char* name;
  std::vector<const char*> photographs;
};

class Rendered : public testing::TestWithParam<Scene> {
 protected:
  fs::path directory() const {
    return fs::path(std::getenv("GLASSWING_DATA")) / "rendered/dev" / GetParam().name;
  }
};

double psnr(const RadianceImage& a, const RadianceImage& b, const Image16& mask) {
  double sum = 0.0, count = 0.0;
  for (size_t i = 0; i < a.samples.size(); ++i) {
    if (mask.samples[i] <= 32767) continue;
    const double difference = static_cast<double>(a.samples[i]) - static_cast<double>(b.samples[i]);
    sum += difference * difference;
    count += 1.0;
  }
  return -10.0 * std::log10(sum / count);
}

FrameStack read_stack(const fs::path& directory, const Method& method) {
  FrameStack stack{.manifest = read_any_manifest(directory).value(),
                   .first_row = 0,
                   .row_count = 0,
                   .rows = {},
                   .owner = nullptr};
  stack.row_count = stack.manifest.camera().height_px();
  stack.rows.resize(static_cast<size_t>(stack.manifest.frames_size()));
  const std::vector<int> needed = method.frames_needed(stack.manifest).value();
  const auto frames = std::make_shared<std::vector<Image16>>();
  stack.owner = frames;
  for (const int frame : needed) {
    frames->push_back(read_frame_file(directory / stack.manifest.frames(frame).file()).value());
  }
  for (size_t i = 0; i < needed.size(); ++i) {
    stack.rows[static_cast<size_t>(needed[i])] = (*frames)[i].samples;
  }
  return stack;
}

// 6 dB is half the error: the least that a matte with one footprint must gain over the bare background.
TEST_P(Rendered, BeatsTheBareBackground) {
  if (!fs::exists(directory())) GTEST_SKIP() << "no data at " << directory() << "; set GLASSWING_DATA";
  const auto method = make_method("gaussian", {}).value();
  const Matte matte = method->solve(read_stack(directory(), *method)).value();
  const Image16 mask = read_frame_file(directory() / "mask_true.png").value();
  for (const char* name : GetParam().photographs) {
    const auto picture = [&](const std::string& file) {
      return read_radiance(directory() / file, Encoding::kLinear).value();
    };
    const RadianceImage reference = picture(std::string("ref/") + name + "_obj.png");
    const RadianceImage plain = picture(std::string("ref/") + name + "_bg.png");
    std::vector<RadianceImage> backgrounds(static_cast<size_t>(matte.metadata.monitors_size()));
    backgrounds[0] = picture(std::string("stim/photo_") + name + ".png");
    const RadianceImage ours = composite(matte, backgrounds).value();
    const double got = psnr(ours, reference, mask);
    std::printf("%-14s %-10s %5.1f dB (bare background %5.1f)\n", GetParam().name, name, got,
                psnr(plain, reference, mask));
    EXPECT_GE(got, psnr(plain, reference, mask) + 6.0) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, Rendered,
                         testing::Values(Scene{"A_crystal", {"stilllife", "stone", "landscape"}},
                                         Scene{"B_bimodal", {"stilllife", "stone", "landscape"}},
                                         Scene{"C_brushed", {"stilllife", "stone", "landscape", "lines"}},
                                         Scene{"D_foreground", {"stilllife", "stone", "landscape"}},
                                         Scene{"E_twomonitors", {"stilllife", "stone", "landscape"}}),
                         [](const auto& scene) { return std::string(scene.param.name); });

}  // namespace
}  // namespace glasswing
