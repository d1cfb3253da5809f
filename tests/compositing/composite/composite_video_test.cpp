#include <fmt/format.h>
#include <webp/demux.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "compositing/composite/sequence.h"
#include "compositing/picture/video_file.h"
#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr int kFrames = 3;
constexpr double kExrRounding = 1e-6;  // of sums of 32-bit floats

// Every pixel sees straight through; the object's own light rises from frame to frame.
Matte frame(int number) {
  Matte matte(0, 0, kWidth, kHeight, 1, true);
  v1::MatteMetadata& metadata = matte.metadata;
  metadata.set_format_version(1);
  metadata.set_method("ramp");
  metadata.set_frame(number);
  v1::Monitor& monitor = *metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(kWidth);
  monitor.set_height_px(kHeight);
  metadata.set_width_px(kWidth);
  metadata.set_height_px(kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      matte.coverage(x, y) = 1.0f;
      matte.foreground(x, y).fill(0.125f * static_cast<float>(number));
      matte.modes(x, y, 0)[0] = {
          .weight = 0.5f, .x_px = static_cast<float>(x) + 0.5f, .y_px = static_cast<float>(y) + 0.5f};
    }
  }
  return matte;
}

RadianceImage even(float light) {
  RadianceImage image(kWidth, kHeight);
  std::fill(image.samples.begin(), image.samples.end(), light);
  return image;
}

class CompositeVideo : public ScratchTest {
 protected:
  CompositeVideo() {
    std::filesystem::create_directories(path("pour"));
    std::filesystem::create_directories(path("behind"));
    for (int i = 0; i < kFrames; ++i) put_matte(i, frame(i));
    for (int i = 0; i < 2; ++i)
      EXPECT_OK(write_radiance(path(fmt::format("behind/{}.exr", i)), even(i == 0 ? 0.25f : 0.5f),
                               Encoding::kLinear));
  }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  void put_matte(int number, const Matte& matte) {
    EXPECT_OK(write_file_durably(path(fmt::format("pour/{:04d}.exr", number)), encode_matte(matte).value()));
  }
  RadianceImage written(const std::string& name) {
    return read_radiance(path(name), Encoding::kLinear).value();
  }
};

TEST_F(CompositeVideo, AStillStandsBehindEveryFrame) {
  const Outcome outcome = run_glasswing(
      {"composite", path("pour"), "--background", path("behind/1.exr"), "-o", path("out"), "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["frames"], kFrames);
  for (int i = 0; i < kFrames; ++i) {
    const RadianceImage picture = written(fmt::format("out/{:04d}.exr", i));
    for (const float sample : picture.samples) EXPECT_NEAR(sample, 0.125 * i + 0.25, kExrRounding);
  }
}

TEST_F(CompositeVideo, PicturesOfADirectoryBeginAgain) {
  ASSERT_EQ(run_glasswing({"composite", path("pour"), "--background", path("behind"), "-o", path("out"),
                           "--format", "png", "--linear", "--foreground-gain", "2"})
                .status,
            0);
  for (int i = 0; i < kFrames; ++i) {
    const RadianceImage picture = written(fmt::format("out/{:04d}.png", i));
    for (const float sample : picture.samples)
      EXPECT_NEAR(sample, 0.25 * i + (i % 2 == 0 ? 0.125 : 0.25), 1e-4);
  }
}

// A gray is the same in every codec but for rounding: that of YCbCr's 219 levels, and that of a block's mean,
// whose coarsest step is 46/8 of a level in MPEG-4 and less in the others, half of it either way. sRGB's
// steepest slope is 2.3 light a code.
TEST_F(CompositeVideo, AVideoIsWrittenAndReadAgain) {
  constexpr double kMaxLost = 2.3 * (0.5 + 0.5 * 46.0 / 8.0 + 0.5) / 219.0;
  for (const std::string suffix : {".mp4", ".avi"}) {
    const std::string video = path("pour" + suffix);
    const Outcome outcome = run_glasswing(
        {"composite", path("pour"), "--background", path("behind/1.exr"), "-o", video, "--fps", "25"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    VideoReader reader = VideoReader::open(video).value();
    EXPECT_NEAR(reader.frame_rate_hz(), 25.0, 0.01);
    for (int i = 0; i < kFrames; ++i) {
      const std::optional<Image16> read = reader.next();
      ASSERT_TRUE(read) << suffix << " " << i;
      ASSERT_EQ(read->width_px, kWidth);
      for (const std::uint16_t code : read->samples) {
        const float light = linear_of_srgb(static_cast<float>(code) / 65535.0f);
        EXPECT_NEAR(light, 0.125 * i + 0.25, kMaxLost) << suffix << " " << i;
      }
    }
    EXPECT_FALSE(reader.next()) << suffix;
    // The result may itself be a background.
    ASSERT_EQ(
        run_glasswing({"composite", path("pour"), "--background", video, "-o", path("over" + suffix)}).status,
        0);
  }
}

// WebP's grays are exact but for rounding to 219 levels and to the quantiser's: at quality 85 a code or two.
TEST_F(CompositeVideo, AnAnimationRepeatsForEver) {
  constexpr int kMaxLostCodes = 3, kFrame_ms = 40;
  const std::string file = path("pour.webp");
  const Outcome outcome = run_glasswing(
      {"composite", path("pour"), "--background", path("behind/1.exr"), "-o", file, "--fps", "25"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const std::string bytes = read_file(file).value();
  const WebPData data{reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()};
  WebPAnimDecoder* decoder = WebPAnimDecoderNew(&data, nullptr);
  ASSERT_NE(decoder, nullptr);
  WebPAnimInfo info;
  ASSERT_TRUE(WebPAnimDecoderGetInfo(decoder, &info));
  EXPECT_EQ(info.loop_count, 0U);  // for ever
  EXPECT_EQ(info.frame_count, static_cast<uint32_t>(kFrames));
  EXPECT_EQ(info.canvas_width, static_cast<uint32_t>(kWidth));
  for (int i = 0; i < kFrames; ++i) {
    uint8_t* rgba = nullptr;
    int end_ms = 0;
    ASSERT_TRUE(WebPAnimDecoderGetNext(decoder, &rgba, &end_ms));
    EXPECT_EQ(end_ms, (i + 1) * kFrame_ms);
    const auto code =
        static_cast<int>(std::lround(255.0f * srgb_of_linear(0.125f * static_cast<float>(i) + 0.25f)));
    for (size_t sample = 0; sample < size_t{4} * kWidth * kHeight; ++sample)
      EXPECT_NEAR(rgba[sample], sample % 4 == 3 ? 255 : code, kMaxLostCodes);
  }
  WebPAnimDecoderDelete(decoder);
}

TEST_F(CompositeVideo, OneMatteIsAsLongAsWhatMovesBehindIt) {
  const std::string matte = path("pour/0001.exr");
  const Outcome outcome =
      run_glasswing({"composite", matte, "--background", path("behind"), "-o", path("out"), "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["frames"], 2);
  for (int i = 0; i < 2; ++i) {
    const RadianceImage picture = written(fmt::format("out/{:04d}.exr", i));
    for (const float sample : picture.samples)
      EXPECT_NEAR(sample, 0.125 + (i == 0 ? 0.125 : 0.25), 2 * kExrRounding);
  }
  ASSERT_EQ(
      run_glasswing({"composite", matte, "--background", path("behind"), "-o", path("made.avi")}).status, 0);
  ASSERT_EQ(
      run_glasswing({"composite", matte, "--background", path("made.avi"), "-o", path("again.avi")}).status,
      0);
  VideoReader reader = VideoReader::open(path("again.avi")).value();
  EXPECT_TRUE(reader.next());
  EXPECT_TRUE(reader.next());
  EXPECT_FALSE(reader.next());
  for (const auto& entry : std::filesystem::directory_iterator(scratch_))
    EXPECT_EQ(entry.path().string().find("partial"), std::string::npos) << entry.path();
}

TEST_F(CompositeVideo, PanMovesAStillOnWithEveryFrame) {
  RadianceImage post(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int c = 0; c < 3; ++c) post.at(kWidth - 2, y, c) = 1.0f;
  }
  ASSERT_OK(write_radiance(path("post.exr"), post, Encoding::kLinear));
  const auto run = [this](std::vector<std::string> more) {
    std::vector<std::string> command{
        "composite", path("pour/0000.exr"), "--background", path("post.exr"), "-o", path("out")};
    command.insert(command.end(), more.begin(), more.end());
    return run_glasswing(command);
  };
  ASSERT_EQ(run({"--pan", "1.5,0", "--frames", "3", "--wrap"}).status, 0);
  // Wraps around the monitor's edge; at half a pixel, two pixels share it.
  const std::vector<std::vector<float>> light{{0, 0, 0.5f, 0}, {0, 0, 0, 0.25f}, {0, 0.5f, 0, 0}};
  const std::vector<int> columns{0, 1, kWidth - 2, kWidth - 1};
  for (size_t i = 0; i < light.size(); ++i) {
    const RadianceImage picture = written(fmt::format("out/{:04d}.exr", i));
    for (size_t k = 0; k < columns.size(); ++k) {
      const float expected = i == 1 && columns[k] == 0 ? 0.25f : light[i][k];
      EXPECT_NEAR(picture.at(columns[k], 5, 1), expected, kExrRounding) << i << " " << columns[k];
    }
  }
  expect_one_line_error(run({"--pan", "1,0"}), "--frames is not given");
  expect_one_line_error(run_glasswing({"composite", path("pour"), "--background", path("post.exr"), "-o",
                                       path("out"), "--frames", "3"}),
                        "--frames is for one matte");
}

TEST_F(CompositeVideo, ABackgroundTakesThePhotographsColours) {
  RadianceImage source = even(0.0f);
  for (size_t i = 0; i < source.samples.size(); ++i)
    source.samples[i] = static_cast<float>((i * 37) % 101) / 101.0f;
  RadianceImage dimmed = source;
  for (float& sample : dimmed.samples) sample *= 0.5f;
  ASSERT_OK(write_radiance(path("source.exr"), source, Encoding::kLinear));
  ASSERT_OK(write_radiance(path("dimmed.exr"), dimmed, Encoding::kLinear));
  ASSERT_EQ(run_glasswing({"composite", path("pour/0000.exr"), "--background", path("source.exr"), "--match",
                           path("dimmed.exr"), "-o", path("matched.exr")})
                .status,
            0);
  const RadianceImage picture = written("matched.exr");
  for (size_t i = 0; i < picture.samples.size(); ++i)
    EXPECT_NEAR(picture.samples[i], 0.25f * source.samples[i], 2 * kExrRounding) << i;
}

TEST_F(CompositeVideo, BadInputIsNamedAndFramesThatAreWrittenStay) {
  const auto run = [this](const std::string& mattes, const std::string& background,
                          const std::string& output) {
    return run_glasswing({"composite", mattes, "--background", background, "-o", output});
  };
  expect_one_line_error(run(path("behind"), path("behind/1.exr"), path("none.png")),
                        "it must be a directory");
  std::filesystem::create_directories(path("empty"));
  expect_one_line_error(run(path("empty"), path("behind/1.exr"), path("out")), "contains no mattes");
  expect_one_line_error(run(path("pour"), path("empty"), path("out")), "contains no picture");
  std::filesystem::resize_file(path("pour/0002.exr"), 1000);
  expect_one_line_error(run(path("pour"), path("behind/1.exr"), path("out")), path("pour/0002.exr"));
  EXPECT_TRUE(std::filesystem::exists(path("out/0001.exr")));
  Matte other = frame(1);
  other.metadata.mutable_monitors(0)->set_width_px(kWidth + 1);
  put_matte(1, other);
  expect_one_line_error(run(path("pour"), path("behind/1.exr"), path("out")), "different monitors");
}

}  // namespace
}  // namespace glasswing
