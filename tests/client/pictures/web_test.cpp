#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "client/pictures/web_matte.h"
#include "core/base/file.h"
#include "core/frame/image_file.h"
#include "core/matte/matte_file.h"
#include "core/rays/cube.h"
#include "core/rays/ray_file.h"
#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 5, kHeight = 4;

// The last row sees no picture; pixel (1, 1) is not solved.
Matte a_matte() {
  Matte matte(0, 0, kWidth, kHeight, 2);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("vase");
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(1920);
  monitor.set_height_px(1080);
  for (int y = 0; y < kHeight - 1; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x == 1 && y == 1) {
        matte.flags(x, y) = kFlagNoData;
        continue;
      }
      for (int c = 0; c < kChannels; ++c) {
        matte.modes(x, y, c)[0] = {.weight = 0.25f * static_cast<float>(c + 1),
                                   .x_px = static_cast<float>(100 + x),
                                   .y_px = static_cast<float>(200 + y),
                                   .xx_px2 = 4.0f,
                                   .xy_px2 = 0.0f,
                                   .yy_px2 = 1.0f,
                                   .texture = 0};
      }
      // Blue has a place of its own too, of which an eye sees nothing where it is weak.
      matte.modes(x, y, 2)[1] = {.weight = x == 0 ? 0.5f : 0.001f,
                                 .x_px = 1000.0f,
                                 .y_px = 500.0f,
                                 .xx_px2 = 1.0f,
                                 .xy_px2 = 0.0f,
                                 .yy_px2 = 1.0f,
                                 .texture = 0};
    }
  }
  return matte;
}

std::map<std::string, std::string> planes_of(const WebMatte& web) {
  std::map<std::string, std::string> planes;
  size_t at = 0;
  for (const WebPlane& plane : web.planes) {
    std::string bytes(1000, '\0');
    uLongf size = bytes.size();
    EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(bytes.data()), &size,
                         reinterpret_cast<const Bytef*>(web.bytes.data() + at), plane.bytes),
              Z_OK)
        << plane.name;
    at += plane.bytes;
    bytes.resize(size);
    planes[plane.name] = bytes;
  }
  EXPECT_EQ(at, web.bytes.size());
  return planes;
}

// The sum of differences, as docs/web.md folds them.
std::vector<int> numbers_of(const std::string& low, const std::string& high) {
  std::vector<int> numbers;
  int value = 0;
  for (size_t i = 0; i < low.size(); ++i) {
    const int folded = static_cast<unsigned char>(low[i]) | static_cast<unsigned char>(high[i]) << 8;
    value += folded % 2 == 0 ? folded / 2 : -(folded + 1) / 2;
    numbers.push_back(value & 0xffff);
  }
  return numbers;
}

TEST(WebMatte, HoldsWhatTheMatteHas) {
  const WebMatte web = encode_web_matte(a_matte()).value();
  EXPECT_EQ(web.region, (MatteRegion{0, 0, kWidth, kHeight - 1}));
  const auto planes = planes_of(web);
  // Two footprints in the first column, elsewhere one that the channels share; (1, 1) is as one of its
  // neighbours, each of which is as near.
  std::string counts;
  for (int y = 0; y < kHeight - 1; ++y) counts += "\2\1\1\1\1";
  counts[kWidth + 1] = planes.at("count")[kWidth + 1];
  EXPECT_EQ(planes.at("count"), counts);
  EXPECT_GT(counts[kWidth + 1], 0);
  ASSERT_EQ(web.unit_px, 0.0625);
  const double first_x = (100.0 - web.origin_px) / web.unit_px,
               first_y = (200.0 - web.origin_px) / web.unit_px;
  EXPECT_EQ(numbers_of(planes.at("x_low"), planes.at("x_high")).front(), first_x);
  EXPECT_EQ(numbers_of(planes.at("y_low"), planes.at("y_high")).front(), first_y);
  // sigma 2 px is 5 octaves above 1/16, sigma 1 four.
  EXPECT_EQ(planes.at("wide").front(), static_cast<char>(5 * 16));
  EXPECT_EQ(planes.at("narrow").front(), static_cast<char>(4 * 16));
  EXPECT_EQ(planes.at("angle").front(), 0);
  EXPECT_EQ(numbers_of(planes.at("red_low"), planes.at("red_high")).front(), 128);
  EXPECT_EQ(numbers_of(planes.at("green_low"), planes.at("green_high")).front(), 256);
  EXPECT_EQ(numbers_of(planes.at("blue_low"), planes.at("blue_high")).front(), 384);
}

TEST(WebMatte, AnglesAreThoseOfTheWideAxis) {
  Matte matte = a_matte();
  for (int c = 0; c < kChannels; ++c) {  // 4 along 30 degrees, 1 across
    Mode& mode = matte.modes(0, 0, c)[0];
    mode.xx_px2 = 3.25f;
    mode.yy_px2 = 1.75f;
    mode.xy_px2 = static_cast<float>(3.0 * std::sqrt(3.0) / 4.0);
  }
  const auto planes = planes_of(encode_web_matte(matte).value());
  // A turn of 0.2 narrow / wide = 0.1 rad is 8.1 of 256: angles are multiples of 8.
  EXPECT_EQ(planes.at("angle").front(), 40);  // 30 degrees are 42.7
  EXPECT_EQ(planes.at("wide").front(), static_cast<char>(5 * 16));
}

class WebFolder : public ScratchTest {
 protected:
  WebFolder() {
    fs::create_directories(player_ / "assets");
    EXPECT_TRUE(write_file_durably(player_ / "index.html", "<html>").ok());
    EXPECT_TRUE(write_file_durably(player_ / "assets/player.js", "1").ok());
    EXPECT_TRUE(write_file_durably(matte_, encode_matte(a_matte()).value()).ok());
  }
  Outcome web(std::vector<std::string> more) {
    std::vector<std::string> all{"web", matte_, "-o", folder_.string(), "--player", player_.string()};
    all.insert(all.end(), more.begin(), more.end());
    return run_glasswing(all);
  }
  const fs::path player_ = scratch_ / "player", folder_ = scratch_ / "folder";
  const std::string matte_ = (scratch_ / "vase.exr").string();
};

TEST_F(WebFolder, HasPlayerMatteAndPictures) {
  const std::string picture = (scratch_ / "sea.png").string();
  ASSERT_TRUE(write_file_durably(picture, "png").ok());
  const Outcome run = web({"--background", picture});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto description = nlohmann::json::parse(read_file(folder_ / "matte.json").value());
  EXPECT_EQ(description["title"], "vase");
  EXPECT_EQ(description["width_px"], kWidth);
  EXPECT_EQ(description["backgrounds"], nlohmann::json({"sea.png"}));
  EXPECT_EQ(read_file(folder_ / "sea.png").value(), "png");
  size_t bytes = 0;
  for (const auto& plane : description["planes"]) bytes += plane["bytes"].get<size_t>();
  EXPECT_EQ(read_file(folder_ / "matte.bin").value().size(), bytes);
  // Again: what an older player left goes.
  ASSERT_TRUE(write_file_durably(folder_ / "assets/old.js", "0").ok());
  ASSERT_EQ(web({}).status, 0);
  EXPECT_FALSE(fs::exists(folder_ / "assets/old.js"));
}

TEST_F(WebFolder, RefusesWhatItWouldSpoil) {
  fs::create_directories(folder_);
  ASSERT_TRUE(write_file_durably(folder_ / "thesis.tex", "x").ok());
  const Outcome run = web({});
  expect_one_line_error(run, "has other files");
  EXPECT_FALSE(fs::exists(folder_ / "index.html"));
}

TEST_F(WebFolder, RefusesPicturesThatBrowsersDoNotShow) {
  const Outcome run = web({"--background", "sky.exr"});
  expect_one_line_error(run, "sky.exr; browsers show .png");
}

// Two pixels that look ahead, one of them through something that takes half of the light.
RayMatte two_rays() {
  RayMatte rays(2, 1, 1);
  rays.metadata.set_format_version(1);
  rays.metadata.mutable_matte()->set_session("vase");
  v1::CameraGeometry& camera = *rays.metadata.mutable_geometry()->mutable_camera();
  camera.set_width_px(2);
  camera.set_fx_px(1.0);  // 90 degrees across
  for (int x = 0; x < 2; ++x) {
    for (int c = 0; c < kChannels; ++c) {
      Ray& ray = rays.rays(x, 0, c)[0];
      ray.weight = x == 0 ? 1.0f : 0.5f;
      ray.direction = Eigen::Vector3f(0.0f, 0.0f, 1.0f);
      ray.direction_spread[0] = {0.01f, 0.0f, 0.0f};
      ray.direction_spread[1] = {0.0f, 0.005f, 0.0f};
    }
  }
  return rays;
}

TEST_F(WebFolder, OfRaysHasDirectionsAndEnvironments) {
  ASSERT_TRUE(write_file_durably(matte_, encode_rays(two_rays()).value()).ok());
  const std::string street = (scratch_ / "street.exr").string(), sea = (scratch_ / "sea.jpg").string();
  RadianceImage light(16, 8);
  std::ranges::fill(light.samples, 40.0f);
  ASSERT_TRUE(write_radiance(street, light, Encoding::kLinear).ok());
  ASSERT_TRUE(write_file_durably(sea, "jpg").ok());
  const Outcome run = web({"--environment", street, "--environment", sea, "--environment-turn", "-30",
                           "--environment-gain", "0.5"});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto description = nlohmann::json::parse(read_file(folder_ / "matte.json").value());
  EXPECT_EQ(description["title"], "vase");
  EXPECT_EQ(description["environments"], nlohmann::json({"street.hdr", "sea.jpg"}));
  EXPECT_FALSE(description.contains("backgrounds"));
  EXPECT_EQ(description["turn_deg"], -30.0);
  EXPECT_EQ(description["gain"], 0.5);
  EXPECT_NEAR(description["view_deg"].get<double>(), 90.0, 1e-9);
  EXPECT_EQ(description["metadata"]["monitors"].size(), 6u);
  EXPECT_EQ(description["footprints"], 2);
  EXPECT_EQ(read_radiance(folder_ / "street.hdr", Encoding::kDisplay).value().at(3, 3, 1), 40.0f);
  EXPECT_EQ(read_file(folder_ / "sea.jpg").value(), "jpg");
}

TEST_F(WebFolder, TellsPicturesFromEnvironments) {
  expect_one_line_error(web({"--environment", "street.exr"}), "glasswing rays makes one");
  ASSERT_TRUE(write_file_durably(matte_, encode_rays(two_rays()).value()).ok());
  expect_one_line_error(web({"--background", "sea.png"}), "--environment is");
}

// On the face ahead, whose pixel is 2 / 3600 at distance 1: the middle, and widths of 18 and 9 px.
TEST(WebMatte, OfDirectionsIsInPixelsOfACube) {
  const Matte matte = matte_of_directions(two_rays(), {.half_side = 1.0, .side_px = 3600}, 1);
  const WebMatte web = encode_web_matte(matte).value();
  const auto planes = planes_of(web);
  ASSERT_EQ(web.unit_px, 0.0625);
  EXPECT_NEAR(web.origin_px + web.unit_px * numbers_of(planes.at("x_low"), planes.at("x_high")).front(),
              1800.0, 0.6);
  EXPECT_EQ(planes.at("texture").front(), 4);
  EXPECT_NEAR(static_cast<unsigned char>(planes.at("wide").front()), 16.0 * std::log2(18.0 * 16.0), 0.51);
  EXPECT_NEAR(static_cast<unsigned char>(planes.at("narrow").front()), 16.0 * std::log2(9.0 * 16.0), 0.51);
}

}  // namespace
}  // namespace glasswing
