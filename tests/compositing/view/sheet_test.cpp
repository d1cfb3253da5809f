#include <nlohmann/json.hpp>

#include "core/image/image_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 600, kHeight = 300;  // longer than a panel: pictures are reduced, 440 px wide

class Sheet : public ScratchTest {
 protected:
  std::string picture(const std::string& name, std::array<float, 3> light, int width_px = kWidth) {
    RadianceImage image(width_px, kHeight);
    for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = light[i % 3];
    const std::string file = (scratch_ / name).string();
    EXPECT_OK(write_radiance(file, image, Encoding::kDisplay));
    return file;
  }
  // Pixels of this light on the sheet.
  int count(const std::array<float, 3>& light) {
    const RadianceImage sheet = read_radiance(scratch_ / "sheet.png", Encoding::kDisplay).value();
    int found = 0;
    for (size_t i = 0; i < sheet.samples.size(); i += 3) {
      found += std::ranges::equal(std::span(sheet.samples).subspan(i, 3), light,
                                  [](float a, float b) { return std::abs(a - b) < 0.01f; });
    }
    return found;
  }
  const std::string output_ = (scratch_ / "sheet.png").string();
};

TEST_F(Sheet, HoldsEveryPictureAtOneScale) {
  const std::array<float, 3> red{0.8f, 0.1f, 0.1f}, green{0.1f, 0.8f, 0.1f}, blue{0.1f, 0.1f, 0.8f};
  const Outcome outcome =
      run_glasswing({"sheet", "red=" + picture("a.png", red), "green=" + picture("b.png", green),
                     picture("c.png", blue), "-o", output_, "--columns", "2", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const auto& light : {red, green, blue}) EXPECT_EQ(count(light), 440 * 220);
  const auto size = nlohmann::json::parse(outcome.out);
  EXPECT_GE(size["width_px"], 2 * 440);
  EXPECT_LT(size["width_px"], 3 * 440);
}

TEST_F(Sheet, PicturesOfSeveralSizesAreRefused) {
  const Outcome outcome = run_glasswing({"sheet", picture("a.png", {0.5f, 0.5f, 0.5f}),
                                         picture("b.png", {0.5f, 0.5f, 0.5f}, 590), "-o", output_});
  EXPECT_NE(outcome.status, 0);
  EXPECT_NE(outcome.err.find("590x300; the pictures of a sheet must have one size"), std::string::npos)
      << outcome.err;
}

TEST_F(Sheet, OnlyPngIsWritten) {
  const Outcome outcome =
      run_glasswing({"sheet", picture("a.png", {0.5f, 0.5f, 0.5f}), "-o", (scratch_ / "sheet.jpg").string()});
  EXPECT_NE(outcome.status, 0);
  EXPECT_NE(outcome.err.find(".png"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace glasswing
