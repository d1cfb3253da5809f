#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "compositing/view/contact_sheet.h"
#include "compositing/view/matte_panels.h"
#include "compositing/view/sampled_matte.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using Code = std::array<int, 3>;

// Monitor px of a centre for each camera px; sigma grows tenfold to the right.
constexpr int kWidth = 20, kHeight = 12, kStep_px = 10;

Matte a_matte() {
  Matte matte(0, 0, kWidth, kHeight, 2);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("vase");
  matte.metadata.set_method("gaussian");
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  for (const char* name : {"back", "left"}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(kWidth * kStep_px);
    monitor.set_height_px(kHeight * kStep_px);
  }
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      matte.coverage(x, y) = x < kWidth / 2 ? 1.0f : 0.5f;
      const auto variance = static_cast<float>(std::pow(10.0, 2.0 * x / (kWidth - 1)));
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = c == 0 ? 0.1f : 0.0f;
        matte.modes(x, y, c)[0] = {.weight = 0.5f,
                                   .x_px = static_cast<float>((x + 0.5) * kStep_px),
                                   .y_px = static_cast<float>((y + 0.5) * kStep_px),
                                   .xx_px2 = variance,
                                   .yy_px2 = variance,
                                   .centre_sd_px = 0.01f};
      }
    }
  }
  return matte;
}

// The same with a footprint of any shape.
Matte with_pyramid(int x, int y) {
  Matte matte = a_matte();
  matte.metadata.set_footprint(std::string(kPyramidFootprint));
  matte.add_pyramid(x, y, 1, {.coefficients = {{.level = 1, .column = 4, .row = 5, .weight = 0.5f}}});
  return matte;
}

Code at(const CodeImage& image, int x, int y) {
  return {image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)};
}

const Code kNone{kNoValue[0], kNoValue[1], kNoValue[2]};

MattePanel panel_of(const Matte& matte, const std::string& name) {
  for (MattePanel& panel : panels_of(matte, 1)) {
    if (panel.name == name) return panel;
  }
  ADD_FAILURE() << "no panel " << name;
  return {};
}

TEST(SampledMatte, HasEveryNthPixelAndTheCountOfAll) {
  Matte matte = a_matte();
  matte.flags(3, 3) = kFlagPoorFit;
  matte.flags(4, 4) = kFlagNoData;
  const SampledMatte sampled = sample_matte(encode_matte(matte).value(), 60).value();
  ASSERT_EQ(sampled.step, 2);
  EXPECT_EQ(sampled.outline.width_px, kWidth);
  EXPECT_EQ(sampled.pixels.object, kWidth * kHeight);
  EXPECT_EQ(sampled.pixels.flagged, 2);
  EXPECT_EQ(sampled.pixels.unsolved, 1);
  ASSERT_EQ(sampled.matte.width_px(), kWidth / 2);
  ASSERT_EQ(sampled.matte.height_px(), kHeight / 2);
  for (int y = 0; y < kHeight; y += 2) {
    for (int x = 0; x < kWidth; x += 2) {
      EXPECT_EQ(sampled.matte.flags(x / 2, y / 2), matte.flags(x, y));
      EXPECT_EQ(sampled.matte.modes(x / 2, y / 2, 2)[0].x_px, matte.modes(x, y, 2)[0].x_px);
      EXPECT_EQ(sampled.matte.modes(x / 2, y / 2, 0)[0].y_px, matte.modes(x, y, 0)[0].y_px);
    }
  }
  EXPECT_EQ(sample_matte(encode_matte(matte).value(), kWidth * kHeight).value().step, 1);
}

TEST(MattePanels, AreAsLargeAsTheMatteAndInTheOrderOfTheirNames) {
  const std::vector<MattePanel> panels = panels_of(a_matte(), 1);
  ASSERT_EQ(panels.size(), kPanelNames.size());
  for (size_t i = 0; i < panels.size(); ++i) {
    EXPECT_EQ(panels[i].name, kPanelNames[i]);
    EXPECT_EQ(panels[i].picture.width_px, kWidth);
    EXPECT_EQ(panels[i].picture.height_px, kHeight);
  }
}

TEST(MattePanels, LightIsSrgb) {
  const auto code = [](double light) {
    return static_cast<int>(std::lround(255.0f * srgb_of_linear(static_cast<float>(light))));
  };
  // F + half of the weights.
  EXPECT_EQ(at(panel_of(a_matte(), "preview").picture, 3, 4), (Code{code(0.35), code(0.25), code(0.25)}));
  const MattePanel foreground = panel_of(a_matte(), "foreground");
  // Its brightest light, 0.1, is white: full red here. The bar says so.
  EXPECT_EQ(at(foreground.picture, 3, 4), (Code{255, 0, 0}));
  EXPECT_EQ(foreground.bar->ticks.back().label, "0.1");
  EXPECT_EQ(foreground.bar->ticks.back().place, 1.0);
}

TEST(MattePanels, CoverageIsGray) {
  const MattePanel coverage = panel_of(a_matte(), "coverage");
  EXPECT_EQ(at(coverage.picture, 0, 0), (Code{255, 255, 255}));
  EXPECT_EQ(at(coverage.picture, kWidth - 1, 0), (Code{128, 128, 128}));
}

TEST(MattePanels, ModesAreCountedAndColouredAsTheirKeys) {
  Matte matte = a_matte();
  matte.modes(2, 3, 2)[1].weight = 0.1f;
  for (int c = 0; c < kChannels; ++c) matte.modes(5, 5, c)[0].weight = 0.0f;
  const MattePanel modes = panel_of(matte, "modes");
  ASSERT_EQ(modes.keys.size(), 3u);
  EXPECT_EQ(at(modes.picture, 0, 0), at(modes.keys[1].colours, 0, 0));
  EXPECT_EQ(at(modes.picture, 2, 3), at(modes.keys[2].colours, 0, 0));
  EXPECT_EQ(at(modes.picture, 5, 5), at(modes.keys[0].colours, 0, 0));
  // 1 of 240 pixels.
  EXPECT_EQ(modes.keys[2].name, "2: 0.417 %");
}

TEST(MattePanels, FootprintsOfAnyShapeAreShownWithTheirShare) {
  Matte matte = with_pyramid(3, 4);
  for (int c = 0; c < kChannels; ++c) matte.modes(5, 5, c)[0].weight = 0.0f;
  const MattePanel shape = panel_of(matte, "shape");
  ASSERT_EQ(shape.keys.size(), 3u);
  EXPECT_EQ(at(shape.picture, 5, 5), at(shape.keys[0].colours, 0, 0));
  EXPECT_EQ(at(shape.picture, 3, 5), at(shape.keys[1].colours, 0, 0));
  EXPECT_EQ(at(shape.picture, 3, 4), at(shape.keys[2].colours, 0, 0));
  // 1 of 240 pixels.
  EXPECT_EQ(shape.keys[2].name, "any shape: 0.417 %");
}

// Red grows to the right, green downwards, and the other monitor is bluer.
TEST(MattePanels, CentresAreTheColoursOfTheirPlaces) {
  Matte matte = a_matte();
  for (int c = 0; c < kChannels; ++c) matte.modes(4, 4, c)[0].texture = 1;
  const MattePanel centre = panel_of(matte, "centre");
  const auto shade = [](double share) { return static_cast<int>(std::lround(255.0 * (0.1 + 0.9 * share))); };
  // The top left square, which is light.
  EXPECT_EQ(at(centre.picture, 0, 0)[0], shade(0.5 / kWidth));
  EXPECT_EQ(at(centre.picture, 0, 0)[1], shade(0.5 / kHeight));
  EXPECT_GT(at(centre.picture, kWidth - 2, 0)[0], at(centre.picture, 1, 0)[0]);
  EXPECT_GT(at(centre.picture, 0, kHeight - 2)[1], at(centre.picture, 0, 1)[1]);
  EXPECT_GT(at(centre.picture, 4, 4)[2], at(centre.picture, 0, 0)[2]);
  ASSERT_EQ(centre.keys.size(), 2u);
  EXPECT_EQ(centre.keys[1].name, "left 200x120");
  // The key's chart shows the same positions: its top left corner.
  EXPECT_NEAR(at(centre.keys[0].colours, 0, 0)[0], at(centre.picture, 0, 0)[0], 255 * 0.9 * 0.5 / kWidth);
}

// The bar's colour at a tick equals that of pixels with its value.
TEST(MattePanels, SigmaIsReadOffItsBar) {
  const Matte matte = a_matte();
  const MattePanel sigma = panel_of(matte, "sigma");
  ASSERT_TRUE(sigma.bar);
  EXPECT_EQ(sigma.bar->ticks.front().label, "1");
  EXPECT_EQ(sigma.bar->ticks.back().label, "10");
  const int last = sigma.bar->colours.width_px - 1;
  for (int c = 0; c < 3; ++c) {
    // Half a pixel of the bar: no channel changes by more than 2 codes a pixel.
    EXPECT_NEAR(sigma.picture.at(0, 0, c), sigma.bar->colours.at(0, 0, c), 2);
    EXPECT_NEAR(sigma.picture.at(kWidth - 1, 0, c), sigma.bar->colours.at(last, 0, c), 2);
  }
}

TEST(MattePanels, WhatIsNotThereHasItsOwnColour) {
  Matte matte = a_matte();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  for (int c = 0; c < kChannels; ++c) {
    matte.modes(1, 1, c)[0].weight = 0.0f;
    Mode& broken = matte.modes(2, 2, c)[0];
    broken.x_px = broken.xx_px2 = broken.centre_sd_px = kNan;
    matte.modes(3, 3, c)[0].centre_sd_px = 0.0f;  // not known
    matte.foreground(2, 2)[c] = kNan;
  }
  matte.coverage(2, 2) = kNan;
  for (const char* name : {"centre", "sigma", "uncertainty"}) {
    const MattePanel panel = panel_of(matte, name);
    EXPECT_EQ(at(panel.picture, 1, 1), kNone) << name;
    EXPECT_EQ(at(panel.picture, 2, 2), kNone) << name;
    EXPECT_NE(at(panel.picture, 4, 4), kNone) << name;
  }
  EXPECT_EQ(at(panel_of(matte, "uncertainty").picture, 3, 3), kNone);
}

TEST(MattePanels, WhereNothingIsKnownTheBarGivesWay) {
  Matte matte = a_matte();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c) matte.modes(x, y, c)[0].centre_sd_px = 0.0f;
    }
  }
  const MattePanel panel = panel_of(matte, "uncertainty");
  EXPECT_FALSE(panel.bar);
  ASSERT_EQ(panel.keys.size(), 1u);
  EXPECT_EQ(panel.keys[0].name, "not known");
}

TEST(MattePanels, TheMostSeriousFlagIsShown) {
  Matte matte = a_matte();
  matte.flags(1, 1) = kFlagPoorFit | kFlagNoData;
  matte.flags(2, 2) = kFlagPoorFit;
  matte.coverage(3, 3) = 0.0f;
  const MattePanel flags = panel_of(matte, "flags");
  const auto key = [&](const std::string& name) {
    for (const PanelKey& each : flags.keys) {
      if (each.name.starts_with(name)) return at(each.colours, 0, 0);
    }
    return Code{};
  };
  EXPECT_EQ(at(flags.picture, 0, 0), key("good"));
  EXPECT_EQ(at(flags.picture, 1, 1), key("not solved"));
  EXPECT_EQ(at(flags.picture, 2, 2), key("poor fit"));
  EXPECT_EQ(at(flags.picture, 3, 3), kNone);  // beside the object
}

class ViewCommand : public ScratchTest {
 protected:
  ViewCommand() { EXPECT_OK(write_file_durably(matte_, encode_matte(a_matte()).value())); }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }

  // The codes of a PNG.
  CodeImage read(const std::string& name) const {
    const RadianceImage image = read_radiance(path(name), Encoding::kLinear).value();
    CodeImage codes(image.width_px, image.height_px);
    for (size_t i = 0; i < image.samples.size(); ++i)
      codes.samples[i] = static_cast<std::uint8_t>(std::lround(255.0f * image.samples[i]));
    return codes;
  }

  const std::string matte_ = path("vase.exr");
};

TEST_F(ViewCommand, OnePanelIsItsPixels) {
  for (const std::string name : kPanelNames) {
    ASSERT_EQ(run_glasswing({"view", matte_, "--only", name, "--channel", "g", "-o", path("one.png")}).status,
              0);
    EXPECT_EQ(read("one.png").samples, panel_of(a_matte(), name).picture.samples) << name;
  }
}

// Panels are enlarged by an integer factor and copied to the sheet pixel by pixel.
TEST_F(ViewCommand, TheSheetHoldsEveryPanel) {
  ASSERT_EQ(run_glasswing({"view", matte_, "-o", path("plain.png")}).status, 0);
  const Matte matte = with_pyramid(3, 4);
  ASSERT_OK(write_file_durably(matte_, encode_matte(matte).value()));
  const Outcome outcome = run_glasswing({"view", matte_, "-o", path("sheet.png")});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const CodeImage sheet = read("sheet.png");
  EXPECT_LT(read("plain.png").height_px, sheet.height_px);  // nothing could be of any shape
  const auto stands_at = [&](const CodeImage& picture, int left, int top, int scale) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        for (const int off : {0, scale - 1}) {
          if (at(sheet, left + x * scale + off, top + y * scale + off) != at(picture, x, y)) return false;
        }
      }
    }
    return true;
  };
  constexpr int kScale = 22;  // 20 pixels in 440
  for (const MattePanel& panel : panels_of(matte, 1)) {
    int found = 0;
    for (int top = 0; top + kHeight * kScale <= sheet.height_px; ++top) {
      for (int left = 0; left + kWidth * kScale <= sheet.width_px; ++left)
        found += stands_at(panel.picture, left, top, kScale) ? 1 : 0;
    }
    EXPECT_EQ(found, 1) << panel.name;
  }
}

TEST_F(ViewCommand, LargeMattesAreReducedAndLongTextsCut) {
  Matte matte(0, 0, 1000, 700, 1, true);
  matte.metadata = a_matte().metadata;
  matte.metadata.set_width_px(1000);
  matte.metadata.set_height_px(700);
  matte.metadata.add_warnings(std::string(2000, 'w'));
  ASSERT_OK(write_file_durably(path("large.exr"), encode_matte(matte).value()));
  ASSERT_EQ(run_glasswing({"view", path("large.exr"), "-o", path("sheet.png")}).status, 0);
  const CodeImage sheet = read("sheet.png");
  EXPECT_LT(sheet.width_px, 2000);
  EXPECT_LT(sheet.height_px, 1000);
}

TEST_F(ViewCommand, BadInputIsNamedAndNothingIsWritten) {
  expect_one_line_error(run_glasswing({"view", matte_, "-o", path("sheet.jpg")}), "must end in .png");
  expect_one_line_error(run_glasswing({"view", matte_, "--pixel", "20,0", "-o", path("sheet.png")}),
                        "it must be COLUMN,ROW from 0,0 to 19,11");
  expect_one_line_error(
      run_glasswing({"view", matte_, "--pixel", "3,4", "--monitor", "roof", "-o", path("sheet.png")}),
      "it has back, left");
  expect_one_line_error(
      run_glasswing({"view", matte_, "--pixel", "3,4", "--monitor", "left", "-o", path("sheet.png")}),
      "sees no light");
  expect_one_line_error(run_glasswing({"view", matte_, "--only", "roof", "-o", path("sheet.png")}), "--only");
  expect_one_line_error(run_glasswing({"view", path("none.exr"), "-o", path("sheet.png")}), path("none.exr"));
  expect_one_line_error(run_glasswing({"view", scratch_.string(), "-o", path("sheet.png")}),
                        scratch_.string());
  ASSERT_OK(write_file_durably(path("text.exr"), "no matte at all"));
  expect_one_line_error(run_glasswing({"view", path("text.exr"), "-o", path("sheet.png")}), "not a matte");
  expect_one_line_error(run_glasswing({"view", matte_, "-o", path("nowhere/sheet.png")}), path("nowhere"));
  EXPECT_FALSE(std::filesystem::exists(path("sheet.png")));
}

}  // namespace
}  // namespace glasswing
