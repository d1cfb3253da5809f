// The filter in ffmpeg and in MLT (melt), against `glasswing composite`.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/host_mattes.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 64, kHeight = 48;

class Frei0rHosts : public ScratchTest {
 protected:
  Frei0rHosts() {
    EXPECT_OK(write_file_durably(path("vase.exr"), encode_matte(mixed_matte(kWidth, kHeight)).value()));
    RadianceImage waves(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        for (int c = 0; c < 3; ++c)
          waves.at(x, y, c) = static_cast<float>(0.5 + 0.5 * std::sin(0.3 * (c + 1) * x + 0.2 * y));
      }
    }
    EXPECT_OK(write_radiance(path("waves.png"), waves, Encoding::kDisplay));
  }

  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  RadianceImage picture(const std::string& name) const {
    return read_radiance(path(name), Encoding::kLinear).value();
  }

  void expect_composite(const std::string& name) const {
    const Outcome outcome = run_glasswing(
        {"composite", path("vase.exr"), "--background", path("waves.png"), "-o", path("expected.png")});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const RadianceImage expected = picture("expected.png"), made = picture(name);
    ASSERT_EQ(made.samples.size(), expected.samples.size());
    // The code is rounded from light of 16 bits.
    for (size_t i = 0; i < made.samples.size(); ++i)
      ASSERT_NEAR(made.samples[i], expected.samples[i], 1.01f / 255.0f) << i;
  }

  Said ffmpeg(const std::string& parameters) const {
    return run_program(
        fmt::format("cd {} && ffmpeg -nostdin -v error -i waves.png -vf 'frei0r=glasswing:{}' "
                    "-pix_fmt rgb24 out.png",
                    scratch_.string(), parameters));
  }
};

TEST_F(Frei0rHosts, FfmpegCompositesAsGlasswingDoes) {
  const Said said = ffmpeg("vase.exr|0.5|0.5|1|y");
  ASSERT_EQ(said.status, 0) << said.text;
  EXPECT_EQ(said.text, "");
  expect_composite("out.png");
}

TEST_F(Frei0rHosts, MltCompositesAsGlasswingDoes) {
  const Said said = run_program(fmt::format(
      "cd {} && melt -silent waves.png out=0 -filter frei0r.glasswing 0={}/vase.exr 4=1 -consumer "
      "avformat:out.png width={} height={} sample_aspect_num=1 sample_aspect_den=1 progressive=1 "
      "real_time=-1 vcodec=png pix_fmt=rgb24",
      scratch_.string(), scratch_.string(), kWidth, kHeight));
  ASSERT_EQ(said.status, 0) << said.text;
  expect_composite("out.png");
}

TEST_F(Frei0rHosts, WhatIsWrongIsSaidOnceAndMarked) {
  const Said said =
      run_program(fmt::format("cd {} && ffmpeg -nostdin -v error -loop 1 -i waves.png -frames:v 3 -vf "
                              "'frei0r=glasswing:none.exr' -pix_fmt rgb24 out%d.png",
                              scratch_.string()));
  ASSERT_EQ(said.status, 0) << said.text;
  EXPECT_EQ(said.text, "glasswing: cannot open none.exr: No such file or directory\n");
  const RadianceImage made = picture("out3.png"), before = picture("waves.png");
  EXPECT_EQ(made.at(0, 0, 0), 1.0f);  // red
  EXPECT_EQ(made.at(0, 0, 1), 0.0f);
  EXPECT_EQ(made.at(kWidth / 2, kHeight / 2, 1), before.at(kWidth / 2, kHeight / 2, 1));
}

TEST_F(Frei0rHosts, WithoutAMatteFramesStay) {
  const Said said = ffmpeg("");
  ASSERT_EQ(said.status, 0) << said.text;
  EXPECT_EQ(said.text, "");
  EXPECT_EQ(picture("out.png").samples, picture("waves.png").samples);
}

}  // namespace
}  // namespace glasswing
