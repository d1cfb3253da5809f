// What layouts say that a monitor showed, held to OpenCV's own pictures and to the definitions of the codes.
#include "client/layouts/photograph_layout.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/pattern/pattern.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

v1::Monitor monitor(int width_px, int height_px) {
  v1::Monitor result;
  result.set_name("monitor");
  result.set_width_px(width_px);
  result.set_height_px(height_px);
  return result;
}

std::vector<std::string> names(int count) {
  std::vector<std::string> files;
  for (int i = 0; i < count; ++i) files.push_back(fmt::format("{}.png", i));
  return files;
}

std::vector<v1::Frame> frames(const LayoutOptions& options, const v1::Monitor& of, int count) {
  const absl::StatusOr<std::vector<v1::Frame>> result =
      frames_of(layout_of(options).value(), of, names(count));
  EXPECT_OK(result);
  return result.value();
}

double radiance(const v1::Frame& frame, const v1::Monitor& of, int x, int y) {
  const Pattern pattern = Pattern::create(frame.stimulus(), {of.width_px(), of.height_px()}).value();
  return static_cast<double>(pattern.radiance(x + 0.5, y + 0.5)[1]);
}

// cv2.structured_light.GrayCodePattern.create(10, 6).generate(), OpenCV 4.6: the first row of each picture of
// columns, the first column of each picture of rows.
constexpr std::array kOpenCvColumns{"0000000011", "1111111100", "0000111111", "1111000000",
                                    "0011110000", "1100001111", "0110011001", "1001100110"};
constexpr std::array kOpenCvRows{"000011", "111100", "001111", "110000", "011001", "100110"};

TEST(PhotographLayout, GrayCodesAreThoseOfOpenCv) {
  const v1::Monitor small = monitor(10, 6);
  const std::vector<v1::Frame> shown = frames({.layout = "opencv-graycode"}, small, 16);
  for (size_t i = 0; i < 14; ++i) {
    for (int y = 0; y < 6; ++y) {
      for (int x = 0; x < 10; ++x) {
        const char expected = i < 8 ? kOpenCvColumns[i][x] : kOpenCvRows[i - 8][y];
        EXPECT_EQ(radiance(shown[i], small, x, y), expected == '1' ? 1.0 : 0.0)
            << i << ": " << x << ", " << y;
      }
    }
  }
  EXPECT_EQ(radiance(shown[14], small, 3, 3), 1.0);
  EXPECT_EQ(radiance(shown[15], small, 3, 3), 0.0);
  EXPECT_EQ(shown[3].file(), "3.png");
  EXPECT_TRUE(shown[3].object());
  EXPECT_EQ(shown[3].step(), -1);
  EXPECT_EQ(shown[3].stimulus().panel(), "monitor");
}

TEST(PhotographLayout, BitsAreThoseOfThePlace) {
  const v1::Monitor wide = monitor(300, 5);  // 9 and 3 bits
  const auto bit_of = [](int t, int bit, bool gray) { return ((gray ? t ^ (t >> 1) : t) >> bit & 1) != 0; };
  for (const bool gray : {true, false}) {
    const std::vector<v1::Frame> shown = frames(
        {.layout = gray ? "opencv-graycode" : "binary", .order = "black,rows,columns", .inverse = "before"},
        wide, 25);
    for (int t = 0; t < 300; ++t) {
      for (int bit = 0; bit < 9; ++bit) {
        const size_t at = 7 + 2 * (8 - bit);
        EXPECT_EQ(radiance(shown[at], wide, t, 2) == 0.0, bit_of(t, bit, gray));
        EXPECT_EQ(radiance(shown[at + 1], wide, t, 2) == 1.0, bit_of(t, bit, gray));
      }
      for (int bit = 0; bit < 3 && t < 5; ++bit)
        EXPECT_EQ(radiance(shown[2 + 2 * (2 - bit)], wide, 7, t) == 1.0, bit_of(t, bit, gray));
    }
  }
}

TEST(PhotographLayout, FringesMoveByAStep) {
  const v1::Monitor screen = monitor(64, 48);
  for (const bool backward : {false, true}) {
    const std::vector<v1::Frame> shown = frames({.layout = "phase-shift",
                                                 .order = "white,rows,columns",
                                                 .periods = "1,2.5,12px",
                                                 .shift = backward ? "backward" : "forward",
                                                 .steps = 3},
                                                screen, 19);
    for (int axis = 0; axis < 2; ++axis) {
      const double side_px = axis == 0 ? 64.0 : 48.0;
      const std::array<double, 3> period_px{side_px, side_px / 2.5, 12.0};
      for (int wave = 0; wave < 3; ++wave) {
        for (int step = 0; step < 3; ++step) {
          for (int t = 0; t < 48; ++t) {
            const double turns = (t + 0.5) / period_px[wave] + (backward ? step : -step) / 3.0;
            const size_t at = 1 + 9 * (1 - axis) + 3 * wave + step;
            // A float's rounding, 1e-7, of phases up to 30 rad.
            EXPECT_NEAR(radiance(shown[at], screen, axis == 0 ? t : 9, axis == 0 ? 9 : t),
                        0.5 + 0.5 * std::cos(2.0 * std::numbers::pi * turns), 1e-5);
          }
        }
      }
    }
  }
}

TEST(PhotographLayout, TheOptionsOfALayoutGiveItAgain) {
  for (const LayoutOptions& options :
       {LayoutOptions{.layout = "opencv-graycode"},
        LayoutOptions{.layout = "binary", .order = "white,rows,columns", .inverse = "before"},
        LayoutOptions{
            .layout = "phase-shift", .periods = "0.9,63.9,20px", .shift = "backward", .steps = 8}}) {
    const std::string text = options_of(layout_of(options).value());
    std::istringstream words(text);
    LayoutOptions again;
    for (std::string name, value; words >> name >> value;) {
      if (name == "--layout") again.layout = value;
      if (name == "--order") again.order = value;
      if (name == "--inverse") again.inverse = value;
      if (name == "--periods") again.periods = value;
      if (name == "--shift") again.shift = value;
      if (name == "--steps") again.steps = std::stoi(value);
    }
    EXPECT_EQ(options_of(layout_of(again).value()), text);
  }
}

TEST(PhotographLayout, ComplaintsNameTheOptionAndWhatIsAccepted) {
  struct Case {
    LayoutOptions options;
    const char* complaint;
  };
  for (const Case& each : {
           Case{{.layout = "gray"},
                "--layout is \"gray\"; it must be opencv-graycode, binary, phase-shift or auto"},
           {{.layout = "binary", .order = "rows,rows"},
            "--order is \"rows,rows\"; it must be some of columns"},
           {{.layout = "binary", .order = "white,black"}, "with columns or rows among them"},
           {{.layout = "binary", .order = "left"}, "--order is \"left\""},
           {{.layout = "binary", .inverse = "yes"}, "--inverse is \"yes\"; it must be after, before or none"},
           {{.layout = "binary", .steps = 4}, "--steps, --periods, --shift and --phase are for fringes"},
           {{.layout = "phase-shift", .periods = "1"}, "--steps is not given; fringes need the number"},
           {{.layout = "phase-shift", .periods = "1", .steps = 2}, "--steps is 2;"},
           {{.layout = "phase-shift", .steps = 4},
            "fringes need --periods, the number of fringes along a side"},
           {{.layout = "phase-shift", .periods = "1,,8", .steps = 4},
            "--periods is \"1,,8\"; it must be numbers"},
           {{.layout = "phase-shift", .periods = "0", .steps = 4}, "--periods is \"0\""},
           {{.layout = "phase-shift", .periods = "nan", .steps = 4}, "--periods is \"nan\""},
           {{.layout = "phase-shift", .periods = "1", .shift = "up", .steps = 4},
            "--shift is \"up\"; it must be"},
           {{.layout = "phase-shift", .inverse = "after", .periods = "1", .steps = 4},
            "--inverse and --cell are for"},
       }) {
    const absl::Status status = layout_of(each.options).status();
    EXPECT_NE(status.message().find(each.complaint), std::string::npos) << status;
  }
  const absl::Status status =
      frames_of(layout_of({.layout = "opencv-graycode"}).value(), monitor(1024, 768), names(41)).status();
  EXPECT_EQ(status.message(),
            "there are 41 photographs; --layout opencv-graycode --order columns,rows,white,black --inverse "
            "after has "
            "42 on a monitor of 1024x768 px: 20 columns, 20 rows, 1 white, 1 black");
}

}  // namespace
}  // namespace glasswing
