#include "core/base/scanner.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

struct Monitor {
  std::string name;
  int width_px = 0, height_px = 0;
  double refresh_hz = 0.0;
  bool read(std::string_view text) {
    return Scanner(text)
        .name(name, '=')
        .number(width_px)
        .then("x")
        .number(height_px)
        .then("@")
        .number(refresh_hz)
        .done();
  }
};

TEST(Scanner, ReadsWhatIsThere) {
  Monitor monitor;
  ASSERT_TRUE(monitor.read("back=1920x1080@59.94"));
  EXPECT_EQ(monitor.name, "back");
  EXPECT_EQ(monitor.width_px, 1920);
  EXPECT_EQ(monitor.height_px, 1080);
  EXPECT_EQ(monitor.refresh_hz, 59.94);
  EXPECT_TRUE(monitor.read("left=1x-1@+6e1"));
}

TEST(Scanner, RefusesAllElse) {
  for (const char* text : {"", "back", "=128x96@60", "back=128x96", "back=128x96@", "back=128x96@60 ",
                           "back= 128x96@60", "back=128X96@60", "back=12.5x96@60", "back=99999999999x96@60",
                           "back=128x96@inf", "back=128x96@nan", "back=128x96@1e999", "back=128x96@+-60"})
    EXPECT_FALSE(Monitor().read(text)) << text;
}

TEST(Scanner, KnowsWhatIsLeft) {
  int value = 0;
  Scanner scan("7ms");
  EXPECT_TRUE(scan.number(value).more());
  EXPECT_EQ(scan.rest(), "ms");
  EXPECT_FALSE(scan.done());
  EXPECT_FALSE(scan.then("s").more());  // wrong once, wrong to the end
  EXPECT_FALSE(scan.then("ms").done());
}

}  // namespace
}  // namespace glasswing
