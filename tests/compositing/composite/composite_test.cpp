#include <fmt/format.h>
#include <half.h>

#include <nlohmann/json.hpp>

#include "compositing/composite/backdrop.h"
#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 12, kHeight = 8;
constexpr double kExrRounding = 1e-6;  // of sums of 32-bit floats

v1::MatteMetadata two_monitors() {
  v1::MatteMetadata metadata;
  metadata.set_format_version(1);
  metadata.set_session("vase");
  metadata.set_method("gaussian");
  for (const std::string name : {"back", "left"}) {
    v1::Monitor& monitor = *metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(kWidth);
    monitor.set_height_px(kHeight);
  }
  metadata.set_width_px(kWidth);
  metadata.set_height_px(kHeight);
  return metadata;
}

// Every pixel sees its own position on the back monitor, and has a little light F.
Matte window(float foreground) {
  Matte matte(0, 0, kWidth, kHeight, 1);
  matte.metadata = two_monitors();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      matte.coverage(x, y) = 1.0f;
      for (int channel = 0; channel < 3; ++channel) {
        matte.foreground(x, y)[channel] = foreground;
        Mode& mode = matte.modes(x, y, channel)[0];
        mode.weight = 0.5f;
        mode.x_px = static_cast<float>(x) + 0.5f;
        mode.y_px = static_cast<float>(y) + 0.5f;
      }
    }
  }
  return matte;
}

RadianceImage gradient() {
  RadianceImage image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        image.at(x, y, channel) = static_cast<float>(x + y + channel) / (kWidth + kHeight);
      }
    }
  }
  return image;
}

class CompositeCommand : public ScratchTest {
 protected:
  CompositeCommand() {
    EXPECT_OK(write_file_durably(matte_, encode_matte(window(0.125f)).value()));
    EXPECT_OK(write_radiance(background_, gradient(), Encoding::kLinear));
  }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }

  const std::string matte_ = path("vase.exr");
  const std::string background_ = path("gradient.exr");
};

TEST(Background, TextureIsAMonitorsName) {
  const v1::MatteMetadata metadata = two_monitors();
  EXPECT_EQ(parse_background("sea.png", metadata)->texture, 0);
  EXPECT_EQ(parse_background("left=sea.png", metadata)->texture, 1);
  EXPECT_EQ(parse_background("left=a=b.png", metadata)->file, "a=b.png");
  const absl::Status unknown = parse_background("roof=sea.png", metadata).status();
  EXPECT_EQ(unknown.message(), "--background names the texture \"roof\"; this matte has: back, left");
}

TEST_F(CompositeCommand, AFileWithAnEqualsSignIsTakenWhole) {
  const std::string odd = path("roof=sea.exr");
  std::filesystem::copy_file(background_, odd);
  EXPECT_EQ(parse_background(odd, two_monitors())->file, odd);
}

TEST_F(CompositeCommand, ExrIsForegroundPlusWeightedBackground) {
  const Outcome outcome =
      run_glasswing({"composite", matte_, "--background", background_, "-o", path("out.exr")});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const RadianceImage picture = read_radiance(path("out.exr"), Encoding::kLinear).value();
  const RadianceImage background = gradient();
  for (size_t i = 0; i < background.samples.size(); ++i) {
    EXPECT_NEAR(picture.samples[i], 0.125f + 0.5f * background.samples[i], 2 * kExrRounding);
  }
}

TEST_F(CompositeCommand, StandardOutputTakesTheSameBytesAsAFile) {
  struct {
    std::vector<std::string> words;
    std::string ending;
  } const commands[] = {{{"composite", matte_, "--background", background_}, ".exr"},
                        {{"composite", matte_, "--background", background_, "--format", "png"}, ".png"},
                        {{"view", matte_}, ".png"},
                        {{"stmap", matte_}, ".exr"},
                        {{"nuke", matte_}, ".nk"},
                        {{"matte", "flip", matte_, "x"}, ".exr"},
                        {{"matte", "deliver", matte_}, ".exr"}};
  for (const auto& [words, ending] : commands) {
    SCOPED_TRACE(words[0] + " " + words[1] + ending);
    const auto with_output = [&](const std::string& output) {
      std::vector<std::string> all = words;
      all.insert(all.end(), {"-o", output});
      return run_glasswing(all);
    };
    const std::string file = path("out" + ending);
    const Outcome filed = with_output(file), piped = with_output("-");
    ASSERT_EQ(filed.status, 0) << filed.err;
    ASSERT_EQ(piped.status, 0) << piped.err;
    EXPECT_TRUE(piped.out == read_file(file).value());
    // What is said of it goes aside.
    EXPECT_EQ(filed.out.substr(file.size()), piped.err.substr(1));
  }
}

TEST_F(CompositeCommand, StandardOutputTakesOnePicture) {
  expect_one_line_error(
      run_glasswing({"composite", matte_, "--background", background_, "--frames", "2", "-o", "-"}),
      "for several pictures it must be a directory");
}

TEST_F(CompositeCommand, LinearPngHoldsRadiance) {
  ASSERT_EQ(
      run_glasswing({"composite", matte_, "--background", background_, "-o", path("out.png"), "--linear"})
          .status,
      0);
  ASSERT_EQ(run_glasswing({"composite", matte_, "--background", background_, "-o", path("out.exr")}).status,
            0);
  const Outcome outcome = run_glasswing({"compare", path("out.png"), path("out.exr"), "--linear", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_LE(nlohmann::json::parse(outcome.out)["rms"].get<double>(), 0.5 / 65535 + kExrRounding);
}

TEST_F(CompositeCommand, AMonitorWithoutABackgroundIsBlack) {
  ASSERT_EQ(run_glasswing({"composite", matte_, "--background", "left=" + background_, "-o", path("out.exr")})
                .status,
            0);
  const RadianceImage picture = read_radiance(path("out.exr"), Encoding::kLinear).value();
  for (const float sample : picture.samples) EXPECT_EQ(sample, 0.125f);
}

TEST_F(CompositeCommand, BackgroundsAreScaledToTheMonitor) {
  RadianceImage gray(50, 70);
  std::fill(gray.samples.begin(), gray.samples.end(), 0.5f);
  ASSERT_OK(write_radiance(path("gray.exr"), gray, Encoding::kLinear));
  ASSERT_EQ(
      run_glasswing({"composite", matte_, "--background", path("gray.exr"), "-o", path("out.exr")}).status,
      0);
  const RadianceImage picture = read_radiance(path("out.exr"), Encoding::kLinear).value();
  for (const float sample : picture.samples) EXPECT_NEAR(sample, 0.375f, kExrRounding);
}

TEST_F(CompositeCommand, ErrorsAreOfSolvedPixels) {
  Matte matte = window(0.125f);
  for (int monitor = 0; monitor < 2; ++monitor) {
    for (const double phi_deg : {0.0, 45.0, 90.0, 135.0}) {
      v1::StripeSweep& sweep = *matte.metadata.add_sweeps();
      sweep.set_texture(monitor);
      sweep.set_phi_deg(phi_deg);
      sweep.set_sigma_px(2.0);
      sweep.set_first_r_px(-15.0);
      sweep.set_last_r_px(25.0);
      sweep.set_count(41);
    }
  }
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        Mode& mode = matte.modes(x, y, channel)[0];
        mode.xx_px2 = mode.yy_px2 = 1.0f;
        mode.weight_sd = 0.01f;
        mode.centre_sd_px = 0.05f;
      }
    }
  }
  matte.coverage(3, 4) = 0.0f;
  matte.flags(5, 6) = kFlagPoorFit;
  ASSERT_OK(write_file_durably(matte_, encode_matte(matte).value()));
  const Outcome outcome = run_glasswing({"composite", matte_, "--background", background_, "-o",
                                         path("out.exr"), "--error", path("error.exr")});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const RadianceImage error = read_radiance(path("error.exr"), Encoding::kLinear).value();
  EXPECT_EQ(colour_of_file(path("error.exr"), Encoding::kLinear).interop_id, "data");
  // No sample is NaN: A tells what is not known, as the help says.
  const Said data = run_program(fmt::format("oiiotool --info -v --dumpdata {}", path("error.exr")));
  EXPECT_NE(data.text.find("channel list: R, G, B, A"), std::string::npos) << data.text;
  EXPECT_EQ(data.text.find("nan"), std::string::npos) << data.text;
  EXPECT_EQ(run_glasswing({"composite", "--help"}).out.find("NaN"), std::string::npos);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool solved = !(x == 3 && y == 4) && !(x == 5 && y == 6);
      EXPECT_EQ(error.at(x, y, 0) > 0.0f, solved) << x << " " << y;
      // The weight's error times the light there, at most full scale, and the gradient's 0.05 px.
      EXPECT_LT(error.at(x, y, 0), 0.02f);
    }
  }
}

TEST_F(CompositeCommand, ErrorsThatAreNotKnownAreRefused) {
  const auto run = [this](const std::string& error) {
    return run_glasswing(
        {"composite", matte_, "--background", background_, "-o", path("out.exr"), "--error", path(error)});
  };
  expect_one_line_error(run("error.png"), "must be an .exr");
  expect_one_line_error(run("error.exr"), "does not record how it was sampled");
  EXPECT_FALSE(std::filesystem::exists(path("out.exr")));
}

TEST_F(CompositeCommand, BadInputIsNamedAndNothingIsWritten) {
  const auto run = [this](const std::string& matte, const std::string& background,
                          const std::string& output) {
    return run_glasswing({"composite", matte, "--background", background, "-o", output});
  };
  expect_one_line_error(run(matte_, background_, path("out.gif")), "must end in .exr");
  expect_one_line_error(run(matte_, background_, path("nowhere/out.png")), path("nowhere"));
  expect_one_line_error(run(matte_, "roof=" + background_, path("out.png")), "back, left");
  expect_one_line_error(run(matte_, path("none.png"), path("out.png")), path("none.png"));
  expect_one_line_error(run(path("none.exr"), background_, path("out.png")), path("none.exr"));
  const Outcome twice = run_glasswing({"composite", matte_, "--background", background_, "--background",
                                       "back=" + background_, "-o", path("out.png")});
  expect_one_line_error(twice, "\"back\" twice");
  EXPECT_FALSE(std::filesystem::exists(path("out.png")));
}

TEST_F(CompositeCommand, ConvertMakesAFrameVisible) {
  ASSERT_OK(write_radiance(path("frame.tif"), gradient(), Encoding::kLinear));
  ASSERT_EQ(run_glasswing({"convert", "--linear", path("frame.tif"), path("look.png")}).status, 0);
  const RadianceImage seen = read_radiance(path("look.png"), Encoding::kDisplay).value();
  const RadianceImage truth = gradient();
  // Half an 8-bit sRGB code: the curve's steepest slope is 2.3, at white.
  for (size_t i = 0; i < truth.samples.size(); ++i)
    EXPECT_NEAR(seen.samples[i], truth.samples[i], 2.3 * 0.5 / 255 + 1e-4);
}

TEST_F(CompositeCommand, CropLeavesThePartThatItNames) {
  const auto run = [this](const std::string& region, const std::string& output) {
    return run_glasswing({"composite", matte_, "--background", background_, "--crop", region, "-o", output});
  };
  ASSERT_EQ(run("5x3+4+2", path("part.exr")).status, 0);
  ASSERT_EQ(run("12x8+0+0", path("whole.exr")).status, 0);
  const RadianceImage part = read_radiance(path("part.exr"), Encoding::kLinear).value(),
                      whole = read_radiance(path("whole.exr"), Encoding::kLinear).value();
  ASSERT_EQ(part.width_px, 5);
  ASSERT_EQ(part.height_px, 3);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) EXPECT_EQ(part.at(x, y, 1), whole.at(4 + x, 2 + y, 1));
  }
  for (const std::string region : {"5x3", "0x3+1+1", "5x3+8+0", "5x3+0+-1", "13x8+0+0", "5x3+1+1x"})
    expect_one_line_error(run(region, path("out.png")), "--crop is " + region);
}

// The matte sees straight through with half of the light; pixels are whole px apart.
TEST_F(CompositeCommand, ShiftMovesThePictureWhichGoesOnAsItEnds) {
  const auto run = [this](const std::string& shift, const std::string& output, bool wraps = false) {
    std::vector<std::string> command{"composite", matte_, "--background", background_,
                                     "--shift",   shift,  "-o",           output};
    if (wraps) command.push_back("--wrap");
    return run_glasswing(command);
  };
  const RadianceImage still = gradient();
  const auto expect = [&](int dx, int dy, bool wraps) {
    SCOPED_TRACE(fmt::format("{},{} {}", dx, dy, wraps));
    ASSERT_EQ(run(fmt::format("back={},{}", dx, dy), path("out.exr"), wraps).status, 0);
    const RadianceImage picture = read_radiance(path("out.exr"), Encoding::kLinear).value();
    const auto inside = [&](int at, int extent) {
      return wraps ? (at % extent + extent) % extent : std::clamp(at, 0, extent - 1);
    };
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float there = still.at(inside(x - dx, kWidth), inside(y - dy, kHeight), 1);
        EXPECT_NEAR(picture.at(x, y, 1), 0.125f + 0.5f * there, 2 * kExrRounding);
      }
    }
  };
  for (const bool wraps : {false, true}) {
    expect(3, -2, wraps);
    expect(-5 * kWidth - 1, 2 * kHeight, wraps);
  }
  expect_one_line_error(run("3", path("out.png")), "it must be DX,DY");
  expect_one_line_error(run("left=3,4", path("out.png")), "\"left\", which has no --background");
  expect_one_line_error(run("roof=3,4", path("out.png")), "--shift names the texture \"roof\"");
}

TEST_F(CompositeCommand, ExactIsAskedForByName) {
  for (const std::string output : {"fast.exr", "exact.exr"}) {
    std::vector<std::string> command{"composite", matte_, "--background", background_, "-o", path(output)};
    if (output == "exact.exr") command.push_back("--exact");
    ASSERT_EQ(run_glasswing(command).status, 0);
  }
  const RadianceImage fast = read_radiance(path("fast.exr"), Encoding::kLinear).value();
  const RadianceImage exact = read_radiance(path("exact.exr"), Encoding::kLinear).value();
  for (size_t i = 0; i < exact.samples.size(); ++i)
    EXPECT_NEAR(fast.samples[i], exact.samples[i], 2 * kExrRounding);
}

TEST_F(CompositeCommand, BitsAreThoseOfTheFile) {
  const auto run = [this](const std::string& output, const std::string& bits) {
    return run_glasswing(
        {"composite", matte_, "--background", background_, "-o", path(output), "--bits", bits});
  };
  for (const std::string output : {"out.png", "out.tif"}) {
    for (const int bits : {8, 16}) {
      ASSERT_EQ(run(output, std::to_string(bits)).status, 0);
      EXPECT_EQ(read_photograph(path(output))->bits, bits);
    }
  }
  ASSERT_EQ(run("half.exr", "16").status, 0);
  ASSERT_EQ(run("float.exr", "32").status, 0);
  const RadianceImage half = read_radiance(path("half.exr"), Encoding::kLinear).value(),
                      whole = read_radiance(path("float.exr"), Encoding::kLinear).value();
  for (size_t i = 0; i < whole.samples.size(); ++i)
    EXPECT_EQ(half.samples[i], static_cast<float>(Imath::half(whole.samples[i])));
  EXPECT_LT(std::filesystem::file_size(path("half.exr")), std::filesystem::file_size(path("float.exr")));
  expect_one_line_error(run("out8.exr", "8"), "an EXR has 16 or 32");
  expect_one_line_error(run("out32.png", "32"), "PNG and TIFF have 8 or 16");
}

TEST_F(CompositeCommand, UnsolvedPixelsAreToldAndFilledWhereAskedFor) {
  Matte matte = window(0.125f);
  matte.flags(5, 4) = kFlagNoData;
  for (int c = 0; c < kChannels; ++c) {
    matte.foreground(5, 4)[c] = 0.0f;
    matte.modes(5, 4, c)[0] = Mode{};
  }
  ASSERT_OK(write_file_durably(path("hole.exr"), encode_matte(matte).value()));
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"composite", path("hole.exr"), "--background", background_, "-o",
                               path("out.exr"), "--exact"});
    return run_glasswing(more);
  };
  const auto middle = [&] { return read_radiance(path("out.exr"), Encoding::kLinear)->at(5, 4, 1); };
  EXPECT_NE(run({}).out.find("; 1 pixel is not solved: black, or filled"), std::string::npos);
  EXPECT_EQ(middle(), 0.0f);
  const nlohmann::json written = nlohmann::json::parse(run({"--fill", "--json"}).out);
  EXPECT_EQ(written["unsolved_pixels"], 1);
  EXPECT_EQ(written["filled"], true);
  // Pixels that --crop leaves out do not count; the corner of this crop is the pixel.
  EXPECT_EQ(nlohmann::json::parse(run({"--crop", "5x3+6+2", "--json"}).out)["unsolved_pixels"], 0);
  EXPECT_EQ(nlohmann::json::parse(run({"--crop", "5x3+5+4", "--json"}).out)["unsolved_pixels"], 1);
  EXPECT_EQ(run({"--crop", "5x4+0+0"}).out.find("not solved"), std::string::npos);
  ASSERT_EQ(run({"--fill"}).status, 0);
  // The background is a plane, and so is what the object does to it.
  EXPECT_NEAR(middle(), 0.125f + 0.5f * gradient().at(5, 4, 1), kExrRounding);
}

// The object is the right half, and covers its first column by a quarter. There and on the left, light comes
// straight through; the rest dims it and adds its own.
Matte half_a_window() {
  Matte matte = window(0.125f);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x <= kWidth / 2; ++x) {
      matte.coverage(x, y) = x < kWidth / 2 ? 0.0f : 0.25f;
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = 0.0f;
        matte.modes(x, y, c)[0].weight = 1.0f;
      }
    }
  }
  return matte;
}

class CompositeObject : public CompositeCommand {
 protected:
  CompositeObject() { EXPECT_OK(write_file_durably(matte_, encode_matte(half_a_window()).value())); }
  Outcome run(const std::string& output, std::vector<std::string> more = {"--object"}) {
    more.insert(more.begin(), {"composite", matte_, "--background", background_, "-o", path(output)});
    return run_glasswing(more);
  }
  // What oiiotool reads, or makes, of files in the scratch directory.
  RadianceImage by_oiiotool(const std::string& words) {
    const Said said = run_program(
        fmt::format("cd {} && oiiotool {} -d float -o by_oiiotool.exr", scratch_.string(), words));
    EXPECT_EQ(said.status, 0) << said.text;
    return read_radiance(path("by_oiiotool.exr"), Encoding::kLinear).value();
  }
};

TEST_F(CompositeObject, IsPremultipliedWithCoverageAsAlpha) {
  ASSERT_EQ(run("object.exr").status, 0);
  const RadianceImage alpha = by_oiiotool("object.exr --ch A,A,A --chnames R,G,B"),
                      light = by_oiiotool("object.exr --ch R,G,B"), behind = gradient();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float covered = x < kWidth / 2 ? 0.0f : x == kWidth / 2 ? 0.25f : 1.0f;
      EXPECT_EQ(alpha.at(x, y, 0), covered);
      for (int c = 0; c < kChannels; ++c) {
        const float through = behind.at(x, y, c);
        const float seen = x > kWidth / 2 ? 0.125f + 0.5f * through : through;
        EXPECT_NEAR(light.at(x, y, c), covered * seen, 2 * kExrRounding);
      }
    }
  }
}

// Where the object covers a part of a pixel, the light beside it is as straight as what it is laid over.
TEST_F(CompositeObject, OverItsBackdropIsTheComposite) {
  for (const std::string more : {"--linear", "--fill", "--exact", "--crop"}) {
    std::vector<std::string> words{more};
    if (more == "--crop") words.push_back(fmt::format("{}x{}+0+0", kWidth, kHeight));
    ASSERT_EQ(run("composite.exr", words).status, 0);
    words.push_back("--object");
    ASSERT_EQ(run("object.exr", words).status, 0);
    const RadianceImage over = by_oiiotool("object.exr gradient.exr --over --ch R,G,B");
    const RadianceImage whole = read_radiance(path("composite.exr"), Encoding::kLinear).value();
    for (size_t i = 0; i < whole.samples.size(); ++i)
      EXPECT_NEAR(over.samples[i], whole.samples[i], 3 * kExrRounding);
  }
}

TEST_F(CompositeObject, EveryExrHasA) {
  for (const std::string bits : {"16", "32"}) {
    ASSERT_EQ(run("composite.exr", {"--bits", bits}).status, 0);
    const RadianceImage alpha = by_oiiotool("composite.exr --ch A,A,A --chnames R,G,B");
    for (const float sample : alpha.samples) EXPECT_EQ(sample, 1.0f);
  }
  ASSERT_EQ(run("frames", {"--frames", "2", "--object"}).status, 0);
  EXPECT_EQ(by_oiiotool("frames/0001.exr --ch A,A,A --chnames R,G,B").at(kWidth / 2, 3, 0), 0.25f);
}

// A PNG's colours are not premultiplied, as its specification has it: the over operator needs their product.
TEST_F(CompositeObject, APngHasStraightAlpha) {
  ASSERT_EQ(run("object.png", {"--object", "--bits", "16", "--linear"}).status, 0);
  ASSERT_EQ(run("composite.exr", {}).status, 0);
  const RadianceImage read = by_oiiotool("-i:unpremult=1 object.png --ch A,A,A --chnames R,G,B"),
                      straight = read_radiance(path("object.png"), Encoding::kLinear).value(),
                      whole = read_radiance(path("composite.exr"), Encoding::kLinear).value();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      EXPECT_NEAR(read.at(x, y, 0), x < kWidth / 2 ? 0.0f : x == kWidth / 2 ? 0.25f : 1.0f, 0.5 / 65535);
      for (int c = 0; c < kChannels; ++c)
        EXPECT_NEAR(straight.at(x, y, c), whole.at(x, y, c), 0.5 / 65535 + kExrRounding);
    }
  }
}

TEST_F(CompositeObject, WhatHoldsNoAlphaIsRefusedBeforeAnyWork) {
  expect_one_line_error(run("object.tif"), "object.tif cannot have alpha; use .exr or .png");
  expect_one_line_error(run("object.mp4", {"--object", "--frames", "2"}), "a video, which has no alpha");
  expect_one_line_error(run("frames", {"--object", "--frames", "2", "--format", "tif"}), "have alpha");
  EXPECT_FALSE(std::filesystem::exists(path("object.tif")));
}

// A picture twice as wide and half as high as the monitor: columns are means of two.
TEST_F(CompositeCommand, EachAxisIsScaledAsItNeeds) {
  RadianceImage stripes(2 * kWidth, kHeight / 2);
  for (int y = 0; y < stripes.height_px; ++y) {
    for (int x = 0; x < stripes.width_px; x += 2) {
      for (int c = 0; c < 3; ++c) stripes.at(x, y, c) = 1.0f;
    }
  }
  ASSERT_OK(write_radiance(path("stripes.exr"), stripes, Encoding::kLinear));
  ASSERT_EQ(
      run_glasswing({"composite", matte_, "--background", path("stripes.exr"), "-o", path("out.exr")}).status,
      0);
  const RadianceImage picture = read_radiance(path("out.exr"), Encoding::kLinear).value();
  for (const float sample : picture.samples) EXPECT_NEAR(sample, 0.375f, kExrRounding);
}

}  // namespace
}  // namespace glasswing
