// glasswing matte merge --ids: which object each pixel shows, as an independent decoder and Blender read it.
#include <fmt/format.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/footprint/matte_object.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 24, kHeight = 18;

class MatteIds : public ScratchTest {
 protected:
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  // A square with a soft left edge, from column `left` on.
  static float coverage(int left, int x) {
    const int in = x - left;
    return in < 0 || in >= 10 ? 0.0f : in < 3 ? 0.25f * static_cast<float>(in + 1) : 1.0f;
  }
  std::string write(const std::string& file, const std::string& session, int left) const {
    Matte matte = random_object(kWidth, kHeight, 1, 1);
    matte.metadata.set_session(session);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) matte.coverage(x, y) = y < 3 ? 0.0f : coverage(left, x);
    }
    EXPECT_OK(write_file_durably(path(file), encode_matte(matte).value()));
    return path(file);
  }
  Outcome merge(std::vector<std::string> mattes) const {
    mattes.insert(mattes.begin(), {"matte", "merge"});
    mattes.insert(mattes.end(), {"-o", path("all.exr"), "--ids", path("ids.exr")});
    return run_glasswing(mattes);
  }
  nlohmann::json decoded(const std::string& file = "ids.exr") const {
    const Said said = run_program(fmt::format("PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 {} {}",
                                              std::getenv("GLASSWING_DECODE_CRYPTOMATTE"), path(file)));
    EXPECT_EQ(said.status, 0) << said.text;
    return nlohmann::json::parse(said.text, nullptr, false);
  }
};

// The first is in front: each hides the next as far as it covers a pixel, and all together are the coverage.
TEST_F(MatteIds, AnIndependentDecoderFindsTheObjects) {
  const Outcome merged = merge({write("a.exr", "vase", 2), write("b.exr", "glass", 6),
                                write("c.exr", "Schüssel, \"groß\"", 9), write("d.exr", "", 13)});
  ASSERT_EQ(merged.status, 0) << merged.err;
  const nlohmann::json shares = decoded();
  ASSERT_EQ(shares.size(), 4u);
  const Matte all = read_matte(path("all.exr")).value();
  const std::array<std::pair<std::string, int>, 4> front_to_back{
      {{"vase", 2}, {"glass", 6}, {"Schüssel, \"groß\"", 9}, {"d", 13}}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const size_t i = y * kWidth + x;
      float left = 1.0f, sum = 0.0f;
      for (const auto& [name, from] : front_to_back) {
        const float alpha = y < 3 ? 0.0f : coverage(from, x);
        EXPECT_NEAR(shares[name][i].get<float>(), left * alpha, 1e-6) << name << " " << x << " " << y;
        sum += left * alpha;
        left *= 1.0f - alpha;
      }
      EXPECT_NEAR(all.coverage(x, y), sum, 1e-6);
    }
  }
}

// In a delivery file the ids are one more part, which leaves the matte as it is.
TEST_F(MatteIds, DeliveryFilesHaveThem) {
  ASSERT_EQ(merge({write("a.exr", "vase", 2), write("b.exr", "glass", 6)}).status, 0);
  const nlohmann::json whole = decoded();
  const auto deliver = [this](std::vector<std::string> more) {
    more.insert(more.begin(),
                {"matte", "deliver", path("all.exr"), "--ids", path("ids.exr"), "-o", path("delivery.exr")});
    return run_glasswing(more);
  };
  ASSERT_EQ(deliver({}).status, 0);
  EXPECT_EQ(decoded("delivery.exr"), whole);
  EXPECT_EQ(encode_matte(read_matte(path("delivery.exr")).value()).value(),
            encode_matte(read_matte(path("all.exr")).value()).value());
  ASSERT_EQ(deliver({"--half", "--hug"}).status, 0);
  const nlohmann::json hugged = decoded("delivery.exr");
  EXPECT_EQ(hugged["glass"].size(), size_t{14 * (kHeight - 3)});
  EXPECT_EQ(hugged["glass"][13], whole["glass"][3 * kWidth + 2 + 13]);
  expect_one_line_error(
      run_glasswing({"matte", "deliver", path("all.exr"), "--ids", path("a.exr"), "-o", path("none.exr")}),
      "a.exr: it is not a 32-bit Cryptomatte");
  ASSERT_EQ(run_glasswing({"matte", "crop", path("all.exr"), "9x9+0+0", "-o", path("part.exr")}).status, 0);
  expect_one_line_error(
      run_glasswing({"matte", "deliver", path("part.exr"), "--ids", path("ids.exr"), "-o", path("none.exr")}),
      "has a picture of 24x18 px, the matte one of 9x9");
  EXPECT_FALSE(std::filesystem::exists(path("none.exr")));
  // Tiles hold the same samples, which oiiotool compares.
  std::filesystem::rename(path("delivery.exr"), path("lines.exr"));
  ASSERT_EQ(deliver({"--half", "--hug", "--tile", "16"}).status, 0);
  EXPECT_OK(read_matte(path("delivery.exr")));
  const Said same =
      run_program(fmt::format("oiiotool -a {} {} --diff", path("lines.exr"), path("delivery.exr")));
  EXPECT_EQ(same.status, 0) << same.text;
}

TEST_F(MatteIds, ObjectsOfOneSessionAreCalledAsTheirFiles) {
  ASSERT_EQ(merge({write("near.exr", "vase", 2), write("far.exr", "vase", 6)}).status, 0);
  const nlohmann::json shares = decoded();
  EXPECT_TRUE(shares.contains("near") && shares.contains("far") && shares.size() == 2) << shares;
}

TEST_F(MatteIds, NothingIsWrittenIfIdsCannotBe) {
  const std::string vase = write("vase.exr", "vase", 2);
  expect_one_line_error(merge({vase, vase}), "two objects are named \"vase\"");
  EXPECT_FALSE(std::filesystem::exists(path("all.exr")));
  expect_one_line_error(
      run_glasswing({"matte", "merge", vase, vase, "-o", path("all.exr"), "--ids", path("ids.png")}),
      "must end in .exr");
}

constexpr const char* kPick = R"(
import sys
import bpy
file, name, output, width, height = sys.argv[sys.argv.index("--") + 1:]
scene = bpy.context.scene
scene.use_nodes = True
tree = scene.node_tree
tree.nodes.clear()
pick = tree.nodes.new("CompositorNodeCryptomatteV2")
pick.source = "IMAGE"
pick.image = bpy.data.images.load(file)
assert pick.layer_name == "object"  # which Blender finds in the file's header when it is asked for
pick.matte_id = name
end = tree.nodes.new("CompositorNodeComposite")
tree.links.new(pick.outputs["Matte"], end.inputs["Image"])
render = scene.render
render.resolution_x, render.resolution_y, render.resolution_percentage = int(width), int(height), 100
render.image_settings.file_format = "OPEN_EXR"
render.image_settings.color_depth = "32"
render.filepath = output
bpy.ops.render.render(write_still=True)
)";

// Of the file of ids alone, and of a delivery file that has them.
TEST_F(MatteIds, BlendersNodePicksAnObjectByItsName) {
  ASSERT_EQ(merge({write("a.exr", "vase", 2), write("b.exr", "glass", 6)}).status, 0);
  ASSERT_EQ(run_glasswing({"matte", "deliver", path("all.exr"), "--half", "--ids", path("ids.exr"), "-o",
                           path("delivery.exr")})
                .status,
            0);
  ASSERT_OK(write_file_durably(path("pick.py"), kPick));
  for (const char* file : {"ids.exr", "delivery.exr"}) {
    const Said said = run_program(
        fmt::format("cd {0} && HOME={0} blender -b --factory-startup --python-exit-code 1 -P pick.py -- "
                    "{0}/{3} glass {0}/picked.exr {1} {2}",
                    scratch_.string(), kWidth, kHeight, file));
    ASSERT_EQ(said.status, 0) << said.text;
    const absl::StatusOr<RadianceImage> picked = read_radiance(path("picked.exr"), Encoding::kLinear);
    ASSERT_OK(picked) << picked.status() << said.text;
    std::filesystem::remove(path("picked.exr"));
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float expected = y < 3 ? 0.0f : (1.0f - coverage(2, x)) * coverage(6, x);
        ASSERT_NEAR(picked->at(x, y, 0), expected, 1e-3) << file << " " << x << " " << y;
      }
    }
  }
}

}  // namespace
}  // namespace glasswing
