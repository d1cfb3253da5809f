// STMaps in other programs: oiiotool --st_warp, and Blender's Map UV if installed.
#include "core/composite/stmap.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "core/composite/compositor.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 24, kHeight = 18;
// No smaller than the camera's picture: oiiotool warps no further than what it warps reaches.
constexpr int kBackWidth = 40, kBackHeight = 30, kLeftWidth = 26, kLeftHeight = 50;

Matte empty_matte() {
  Matte matte(0, 0, kWidth, kHeight, 2);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("vase");
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  const auto add = [&](const char* name, int width, int height) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(width);
    monitor.set_height_px(height);
  };
  add("back", kBackWidth, kBackHeight);
  add("left", kLeftWidth, kLeftHeight);
  return matte;
}

// Points at the middle of any pixel of a monitor, the same in all channels but for their weights; every pixel
// looks at one monitor, and its other mode has no weight.
Matte scattered() {
  std::mt19937 random(8);
  const auto below = [&random](int end) { return static_cast<int>(random() % static_cast<unsigned>(end)); };
  Matte matte = empty_matte();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int texture = below(2);
      const v1::Monitor& monitor = matte.metadata.monitors(texture);
      const auto at_x = static_cast<float>(below(monitor.width_px())) + 0.5f;
      const auto at_y = static_cast<float>(below(monitor.height_px())) + 0.5f;
      const size_t place = below(2);
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = static_cast<float>(below(64)) / 64.0f;
        matte.modes(x, y, c)[place] = {.weight = static_cast<float>(1 + below(64)) / 64.0f,
                                       .x_px = at_x,
                                       .y_px = at_y,
                                       .texture = texture};
      }
    }
  }
  return matte;
}

RadianceImage random_picture(int width, int height) {
  std::mt19937 random(3);
  RadianceImage image(width, height);
  for (float& sample : image.samples) sample = static_cast<float>(random() % 65) / 64.0f;
  return image;
}

// Float32, which read_radiance() would halve: by channel, row by row.
std::map<std::string, std::vector<float>> read_exr(const std::string& path) {
  const Said said = run_program("oiiotool -v --info --dumpdata " + path);
  EXPECT_EQ(said.status, 0) << said.text;
  std::map<std::string, std::vector<float>> planes;
  std::vector<std::string> channels;
  std::istringstream lines(said.text);
  for (std::string line; std::getline(lines, line);) {
    const std::string list = "    channel list: ";
    if (line.starts_with(list)) {
      std::istringstream names(line.substr(list.size()));
      for (std::string name; names >> name;) channels.push_back(name.substr(0, name.find(',')));
    } else if (line.starts_with("    Pixel (")) {
      std::istringstream values(line.substr(line.find("): ") + 3));
      for (const std::string& channel : channels) values >> planes[channel].emplace_back();
    }
  }
  return planes;
}

class StMap : public ScratchTest {
 protected:
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  std::string write_matte(const Matte& matte) const {
    EXPECT_OK(write_file_durably(path("vase.exr"), encode_matte(matte).value()));
    return path("vase.exr");
  }
};

TEST_F(StMap, HoldsPlaceWeightAndWidth) {
  Matte matte = empty_matte();
  // The stronger of two on the monitor; one beyond its edge; one elsewhere; none.
  matte.modes(0, 0, 2)[0] = {.weight = 0.25f, .x_px = 1.0f, .y_px = 1.0f};
  matte.modes(0, 0, 2)[1] = {.weight = 0.5f, .x_px = 10.0f, .y_px = 7.5f, .xx_px2 = 6.0f, .yy_px2 = 2.0f};
  matte.modes(0, 0, 0)[0] = {.weight = 0.125f, .x_px = 39.0f, .y_px = 29.0f};
  matte.modes(1, 0, 2)[0] = {.weight = 0.5f, .x_px = -1.0f, .y_px = 3.0f};
  matte.modes(2, 0, 2)[0] = {.weight = 0.5f, .x_px = 4.0f, .y_px = 3.0f, .texture = 1};
  const Outcome outcome = run_glasswing({"stmap", write_matte(matte), "-o", path("st.exr"), "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["channel"], "b");  // where nearly all light is
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["monitor"], "back");
  EXPECT_EQ(colour_of_file(path("st.exr"), Encoding::kLinear).interop_id, "data");
  const auto planes = read_exr(path("st.exr"));
  const std::map<std::string, float> first{{"R", 0.25f},       {"G", 0.75f},      {"B", 1.0f},
                                           {"A", 1.0f},        {"blur.Y", 2.0f},  {"weight.R", 0.125f},
                                           {"weight.G", 0.0f}, {"weight.B", 0.5f}};
  ASSERT_EQ(planes.size(), first.size());
  for (const auto& [name, value] : first) EXPECT_EQ(planes.at(name)[0], value) << name;
  for (const char* name : {"R", "G", "B", "A", "blur.Y"}) {
    for (size_t pixel = 1; pixel < planes.at(name).size(); ++pixel) EXPECT_EQ(planes.at(name)[pixel], 0.0f);
  }
  EXPECT_EQ(planes.at("weight.B")[1], 0.5f);
  EXPECT_EQ(planes.at("weight.B")[2], 0.0f);
}

// F + weight x warped picture is the matte's composite where every path is a point, for any of its monitors.
TEST_F(StMap, OiiotoolWarpsAsTheCompositorDoes) {
  const Matte matte = scattered();
  write_matte(matte);
  for (int texture = 0; texture < 2; ++texture) {
    const v1::Monitor& monitor = matte.metadata.monitors(texture);
    std::vector<RadianceImage> behind(2);
    behind[texture] = random_picture(monitor.width_px(), monitor.height_px());
    ASSERT_OK(write_radiance(path("behind.exr"), behind[texture], Encoding::kLinear));
    const RadianceImage expected = composite(matte, behind).value();
    ASSERT_EQ(
        run_glasswing({"stmap", path("vase.exr"), "--monitor", monitor.name(), "-o", path("st.exr")}).status,
        0);
    const Said said = run_program(
        fmt::format("cd {} && oiiotool behind.exr st.exr --st_warp:filter=triangle:flip_t=1 "
                    "st.exr --ch weight.R,weight.G,weight.B --paste +0+0 "
                    "st.exr --ch weight.R,weight.G,weight.B --mul "
                    "vase.exr --subimage foreground --ch foreground.F.R,foreground.F.G,foreground.F.B --add "
                    "--chnames R,G,B -d float -o out.exr",
                    scratch_.string()));
    ASSERT_EQ(said.status, 0) << said.text;
    const auto planes = read_exr(path("out.exr"));
    // s and t are rounded to 2^-24, twice where t is turned; a pixel's neighbours differ by 1 at most.
    const double tolerance = 4.0 * kLeftHeight * std::ldexp(1.0, -24);
    for (int c = 0; c < kChannels; ++c) {
      const std::vector<float>& plane = planes.at(std::string(1, "RGB"[c]));
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          ASSERT_NEAR(plane[y * kWidth + x], expected.at(x, y, c), tolerance)
              << x << " " << y << " " << monitor.name();
        }
      }
    }
  }
}

// A Blender compositor with one node, Map UV.
constexpr const char* kMapUv = R"(
import sys
import bpy
behind, stmap, output, width, height = sys.argv[sys.argv.index("--") + 1:]
scene = bpy.context.scene
scene.use_nodes = True
tree = scene.node_tree
tree.nodes.clear()
def image(path):
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(path)
    node.image.colorspace_settings.name = "Non-Color"
    return node.outputs[0]
warp = tree.nodes.new("CompositorNodeMapUV")
warp.alpha = 0
end = tree.nodes.new("CompositorNodeComposite")
tree.links.new(image(behind), warp.inputs["Image"])
tree.links.new(image(stmap), warp.inputs["UV"])
tree.links.new(warp.outputs["Image"], end.inputs["Image"])
render = scene.render
render.resolution_x, render.resolution_y, render.resolution_percentage = int(width), int(height), 100
render.image_settings.file_format = "OPEN_EXR"
render.image_settings.color_depth = "32"
render.image_settings.color_mode = "RGBA"
render.filepath = output
bpy.ops.render.render(write_still=True)
)";

// Blender filters by how far neighbours are apart, which leaves a ramp a ramp: where a straight view sees it
// is read off its light. A map that is half a pixel off, as conventions differ by, would show.
TEST_F(StMap, BlenderWarpsToTheSamePlace) {
  constexpr int kRampWidth = 400, kRampHeight = 300;
  RadianceImage ramp(kRampWidth, kRampHeight);
  for (int y = 0; y < kRampHeight; ++y) {
    for (int x = 0; x < kRampWidth; ++x) {
      ramp.at(x, y, 0) = (static_cast<float>(x) + 0.5f) / kRampWidth;
      ramp.at(x, y, 1) = (static_cast<float>(y) + 0.5f) / kRampHeight;
    }
  }
  ASSERT_OK(write_radiance(path("ramp.exr"), ramp, Encoding::kLinear));
  Matte matte = empty_matte();
  matte.metadata.mutable_monitors(0)->set_width_px(kRampWidth);
  matte.metadata.mutable_monitors(0)->set_height_px(kRampHeight);
  const auto seen_x = [](int x, int) { return 340.0f - 10.0f * static_cast<float>(x); };
  const auto seen_y = [](int x, int y) {
    return 40.0f + 2.0f * static_cast<float>(x) + 9.0f * static_cast<float>(y);
  };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c)
        matte.modes(x, y, c)[0] = {.weight = 1.0f, .x_px = seen_x(x, y), .y_px = seen_y(x, y)};
    }
  }
  for (int c = 0; c < kChannels; ++c) matte.modes(12, 9, c)[0].texture = 1;
  ASSERT_EQ(run_glasswing({"stmap", write_matte(matte), "-o", path("st.exr")}).status, 0);
  ASSERT_OK(write_file_durably(path("map_uv.py"), kMapUv));
  const Said said = run_program(
      fmt::format("cd {0} && blender -b --factory-startup -P map_uv.py -- {0}/ramp.exr {0}/st.exr "
                  "{0}/out.exr {1} {2}",
                  scratch_.string(), kWidth, kHeight));
  ASSERT_EQ(said.status, 0) << said.text;
  ASSERT_TRUE(std::filesystem::exists(path("out.exr"))) << said.text;
  const auto planes = read_exr(path("out.exr"));
  EXPECT_EQ(planes.at("A")[9 * kWidth + 12], 0.0f);  // looks at the other monitor
  for (int y = 2; y < kHeight - 2; ++y) {
    for (int x = 2; x < kWidth - 2; ++x) {
      if (std::abs(x - 12) <= 2 && std::abs(y - 9) <= 2) continue;  // its neighbours' filters are wide
      const size_t at = y * kWidth + x;
      EXPECT_NEAR(planes.at("R")[at] * kRampWidth, seen_x(x, y), 0.05);
      EXPECT_NEAR(planes.at("G")[at] * kRampHeight, seen_y(x, y), 0.05);
    }
  }
}

TEST_F(StMap, OfAFileIsThatOfTheMatte) {
  // More rows than are decoded at a time, somewhere in the picture.
  Matte matte(5, 3, 4, 37, 2);
  matte.metadata = empty_matte().metadata;
  matte.metadata.set_width_px(60);
  matte.metadata.set_height_px(60);
  for (int y = 0; y < 37; ++y) {
    for (int x = 0; x < 4; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        const float at = static_cast<float>(x + y), weight = 0.01f * static_cast<float>(1 + c + x * y % 7);
        matte.modes(x, y, c)[0] = {
            .weight = weight, .x_px = at, .y_px = 0.5f * at, .xx_px2 = at, .yy_px2 = 1.0f};
        matte.modes(x, y, c)[1] = {.weight = 0.03f, .x_px = 7.0f, .y_px = at, .texture = y % 2};
      }
    }
  }
  const std::string bytes = encode_matte(matte).value();
  for (const int path_number : {0, 1}) {
    const absl::StatusOr<WrittenStmap> written =
        write_stmap(bytes, {.monitor = "back", .path = path_number}, path("st.exr"));
    ASSERT_OK(written);
    EXPECT_EQ(written->channel, strongest_channel(matte, 0));
    EXPECT_EQ(read_file(path("st.exr")).value(),
              encode_stmap(matte, 0, written->channel, path_number).value());
  }
}

TEST_F(StMap, BadInputIsNamedAndNothingIsWritten) {
  const std::string matte = write_matte(scattered());
  expect_one_line_error(run_glasswing({"stmap", matte, "-o", path("st.png")}), "must end in .exr");
  expect_one_line_error(run_glasswing({"stmap", matte, "--monitor", "roof", "-o", path("st.exr")}),
                        "the monitor is \"roof\"; this matte has: back, left");
  expect_one_line_error(run_glasswing({"stmap", matte, "--channel", "x", "-o", path("st.exr")}), "--channel");
  expect_one_line_error(run_glasswing({"stmap", path("none.exr"), "-o", path("st.exr")}), path("none.exr"));
  Matte unsized = scattered();
  unsized.metadata.mutable_monitors(0)->set_width_px(0);
  expect_one_line_error(run_glasswing({"stmap", write_matte(unsized), "-o", path("st.exr")}),
                        "the size of its monitor \"back\"");
  expect_one_line_error(
      run_glasswing({"stmap", write_matte(empty_matte()), "--path", "1", "-o", path("st.exr")}),
      "path is 1; on monitor \"back\" the matte has 0");
  expect_one_line_error(run_glasswing({"stmap", matte, "--path", "9", "-o", path("st.exr")}), "--path");
  std::string cut = read_file(matte).value();
  cut.resize(cut.size() - 10);
  ASSERT_OK(write_file_durably(path("cut.exr"), cut));
  expect_one_line_error(run_glasswing({"stmap", path("cut.exr"), "--channel", "g", "-o", path("st.exr")}),
                        path("cut.exr"));
  for (const auto& left :
       std::filesystem::directory_iterator(std::filesystem::path(path("st.exr")).parent_path()))
    EXPECT_FALSE(left.path().filename().string().starts_with("st.exr")) << left.path();
}

}  // namespace
}  // namespace glasswing
