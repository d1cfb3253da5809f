#include "core/import/photograph_response.h"

#include <gtest/gtest.h>

#include <cmath>

namespace glasswing {
namespace {

Image16 all_codes() {
  Image16 image(256, 256);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<std::uint16_t>(i / 3);
  return image;
}

std::uint16_t light_of(const std::string& name, double black, std::uint16_t code) {
  Image16 image(1, 1);
  image.samples = {code, code, code};
  PhotographResponse::create(name, black)->linearise(image);
  return image.samples[0];
}

TEST(PhotographResponse, LinearCodesStayAsTheyAre) {
  Image16 image = all_codes();
  for (const char* name : {"linear", "gamma:1"}) {
    PhotographResponse::create(name, 0.0)->linearise(image);
    EXPECT_EQ(image.samples, all_codes().samples) << name;
  }
}

TEST(PhotographResponse, IsItsEquation) {
  // Half a step of 16-bit light, plus rounding of a float.
  const double step = 1.0 / 65535.0, allowed = 0.51 * step;
  for (const std::uint16_t code :
       std::initializer_list<std::uint16_t>{0, 1, 257, 1000, 30000, 65534, 65535}) {
    const double u = code / 65535.0;
    EXPECT_NEAR(light_of("gamma:2.2", 0.0, code) * step, std::pow(u, 2.2), allowed);
    const double above = std::max(0.0, (u - 0.1) / 0.9);
    EXPECT_NEAR(light_of("gamma:0.5", 0.1, code) * step, std::sqrt(above), allowed);
    EXPECT_NEAR(light_of("linear", 0.1, code) * step, above, allowed);
  }
  // IEC 61966-2-1: the code of middle grey, and the end of the linear segment.
  EXPECT_NEAR(light_of("srgb", 0.0, std::uint16_t{188 * 257}) * step, 0.5029, 1e-4);
  EXPECT_NEAR(light_of("srgb", 0.0, 10 * 257) * step, 10.0 / 255.0 / 12.92, allowed);
  EXPECT_EQ(light_of("srgb", 0.0, 65535), 65535);
}

TEST(PhotographResponse, ComplaintsSayWhatIsAccepted) {
  for (const char* name : {"", "sRGB", "gamma:", "gamma:0.1", "gamma:6", "gamma:2.2x", "gamma:nan",
                           "gamma: 2", "gamma:1e999", "log"}) {
    EXPECT_EQ(
        PhotographResponse::create(name, 0.0).status().message(),
        "response is \"" + std::string(name) + "\"; it must be linear, srgb, or gamma:G with G 0.2 to 5");
  }
  for (const double black : {-0.1, 1.0, std::nan("")})
    EXPECT_TRUE(absl::IsInvalidArgument(PhotographResponse::create("linear", black).status()));
}

}  // namespace
}  // namespace glasswing
