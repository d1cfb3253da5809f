#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/rays/ray_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/web/made_for_web.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class WebFolder : public ScratchTest {
 protected:
  WebFolder() {
    fs::create_directories(player_ / "assets");
    EXPECT_OK(write_file_durably(player_ / "index.html", "<html>"));
    EXPECT_OK(write_file_durably(player_ / "assets/player.js", "1"));
    EXPECT_OK(write_file_durably(matte_, encode_matte(a_matte()).value()));
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
  ASSERT_OK(write_file_durably(picture, "png"));
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
  ASSERT_OK(write_file_durably(folder_ / "assets/old.js", "0"));
  ASSERT_EQ(web({}).status, 0);
  EXPECT_FALSE(fs::exists(folder_ / "assets/old.js"));
}

TEST_F(WebFolder, RefusesWhatItWouldSpoil) {
  fs::create_directories(folder_);
  ASSERT_OK(write_file_durably(folder_ / "thesis.tex", "x"));
  const Outcome run = web({});
  expect_one_line_error(run, "has other files");
  EXPECT_FALSE(fs::exists(folder_ / "index.html"));
}

TEST_F(WebFolder, RefusesPicturesThatBrowsersDoNotShow) {
  const Outcome run = web({"--background", "sky.exr"});
  expect_one_line_error(run, "sky.exr; browsers show .png");
}

TEST_F(WebFolder, OfRaysHasDirectionsAndEnvironments) {
  ASSERT_OK(write_file_durably(matte_, encode_rays(two_rays()).value()));
  const std::string street = (scratch_ / "street.exr").string(), sea = (scratch_ / "sea.jpg").string();
  RadianceImage light(16, 8);
  std::ranges::fill(light.samples, 40.0f);
  ASSERT_OK(write_radiance(street, light, Encoding::kLinear));
  ASSERT_OK(write_file_durably(sea, "jpg"));
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
  ASSERT_OK(write_file_durably(matte_, encode_rays(two_rays()).value()));
  expect_one_line_error(web({"--background", "sea.png"}), "need --environment");
}

}  // namespace
}  // namespace glasswing
