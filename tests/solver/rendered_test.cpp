// Solves stacks from an independent renderer and compares the composites with its photographs.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/composite/compositor.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/import/foreign_manifest.h"
#include "solver/method/method.h"
#include "solver/methods.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

struct Scene {
  const char* name;
  std::vector<const char*> photographs;
  std::vector<double> boxes;  // dB of an exhaustive search over boxes, as measured by the data's authors
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

FrameStack read_stack(const fs::path& directory, const v1::CaptureManifest& manifest,
                      const std::vector<int>& needed) {
  FrameStack stack{.width_px = manifest.camera().width_px(),
                   .first_row = 0,
                   .row_count = manifest.camera().height_px(),
                   .rows = {},
                   .owner = nullptr};
  stack.rows.resize(manifest.frames_size());
  const auto frames = std::make_shared<std::vector<Image16>>();
  stack.owner = frames;
  for (const int frame : needed) {
    frames->push_back(read_frame_file(directory / manifest.frames(frame).file()).value());
  }
  for (size_t i = 0; i < needed.size(); ++i) {
    stack.rows[needed[i]] = (*frames)[i].samples;
  }
  return stack;
}

// PSNR of a method's composites, by photograph.
std::vector<double> psnrs(const fs::path& directory, const Scene& scene, const Method& method) {
  const v1::CaptureManifest manifest = read_any_manifest(directory).value();
  const auto prepared = method.prepare(manifest).value();
  const Matte matte = prepared->solve(read_stack(directory, manifest, prepared->frames_needed())).value();
  const Image16 mask = read_frame_file(directory / "mask_true.png").value();
  std::vector<double> found;
  for (const std::string name : scene.photographs) {
    std::vector<RadianceImage> backgrounds(matte.metadata.monitors_size());
    backgrounds[0] = read_radiance(directory / ("stim/photo_" + name + ".png"), Encoding::kLinear).value();
    const RadianceImage reference =
        read_radiance(directory / ("ref/" + name + "_obj.png"), Encoding::kLinear).value();
    found.push_back(psnr(composite(matte, backgrounds).value(), reference, mask));
  }
  return found;
}

TEST_P(Rendered, HierarchicalIsAsGoodAsExhaustiveSearch) {
  if (!fs::exists(directory())) GTEST_SKIP() << "no data at " << directory() << "; set GLASSWING_DATA";
  const std::vector<double> got = psnrs(directory(), GetParam(), *make_method("hierarchical", {}).value());
  for (size_t i = 0; i < got.size(); ++i) {
    std::printf("%-14s %-10s %5.1f dB (one box %5.1f)\n", GetParam().name, GetParam().photographs[i], got[i],
                GetParam().boxes[i]);
    EXPECT_GE(got[i], GetParam().boxes[i]) << GetParam().photographs[i];
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, Rendered,
    testing::Values(Scene{"A_crystal", {"stilllife", "stone", "landscape"}, {27.4, 28.0, 22.5}},
                    Scene{"B_bimodal", {"stilllife", "stone", "landscape"}, {24.4, 26.9, 29.8}},
                    Scene{
                        "C_brushed", {"stilllife", "stone", "landscape", "lines"}, {31.8, 30.4, 31.4, 21.4}},
                    Scene{"D_foreground", {"stilllife", "stone", "landscape"}, {33.4, 36.8, 35.6}},
                    Scene{"E_twomonitors", {"stilllife", "stone", "landscape"}, {33.1, 34.5, 34.2}}),
    [](const auto& scene) { return std::string(scene.param.name); });

}  // namespace
}  // namespace glasswing
