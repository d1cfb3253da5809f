#include "display-node/backends/x11_display.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>

#include "tests/display-node/backends/display_contract.h"
#include "tests/display-node/backends/xvfb.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

// One server for all tests of this program, with two monitors side by side.
const Xvfb* server() {
  static const std::unique_ptr<Xvfb> started = [] {
    std::unique_ptr<Xvfb> xvfb = Xvfb::start();
    if (xvfb == nullptr) return xvfb;
    const bool both = xvfb->set_monitors({{"DP-1", 0, 0, 320, 240}, {"DP-2", 320, 100, 128, 96}});
    return both ? std::move(xvfb) : nullptr;
  }();
  return started.get();
}

absl::StatusOr<std::unique_ptr<X11Display>> open_two(const Xvfb& xvfb) {
  return X11Display::open({.server = xvfb.name(),
                           .monitors = {{"back", "DP-1"}, {"left", "DP-2"}},
                           .lag = milliseconds(3),
                           .settle = milliseconds(1)});
}

std::unique_ptr<Display> make_x11() {
  if (server() == nullptr) return nullptr;
  return open_two(*server()).value();
}

INSTANTIATE_TEST_SUITE_P(X11, DisplayContract, testing::Values(make_x11));

Picture noise(int width, int height, unsigned seed, int bits = 8) {
  auto image = std::make_shared<Image<std::uint16_t>>(width, height);
  std::mt19937 random(seed);
  for (std::uint16_t& code : image->samples) code = static_cast<std::uint16_t>(random() >> (32 - bits));
  return image;
}

// The screen as another client reads it, a word per pixel.
std::vector<std::uint32_t> on_screen(const std::string& name, int x, int y, int width, int height) {
  xcb_connection_t* connection = xcb_connect(name.c_str(), nullptr);
  const xcb_window_t root = xcb_setup_roots_iterator(xcb_get_setup(connection)).data->root;
  xcb_get_image_reply_t* reply = xcb_get_image_reply(
      connection,
      xcb_get_image(connection, XCB_IMAGE_FORMAT_Z_PIXMAP, root, static_cast<std::int16_t>(x),
                    static_cast<std::int16_t>(y), static_cast<std::uint16_t>(width),
                    static_cast<std::uint16_t>(height), ~0u),
      nullptr);
  std::vector<std::uint32_t> words;
  if (reply != nullptr) {
    words.resize(static_cast<size_t>(xcb_get_image_data_length(reply)) / sizeof(std::uint32_t));
    std::memcpy(words.data(), xcb_get_image_data(reply), words.size() * sizeof(std::uint32_t));
  }
  std::free(reply);
  xcb_disconnect(connection);
  return words;
}

void expect_on_screen(const Xvfb& xvfb, const ScreenInfo& screen, int x, int y, const Picture& picture) {
  const std::vector<std::uint32_t> words = on_screen(xvfb.name(), x, y, screen.width_px, screen.height_px);
  const size_t pixels = static_cast<size_t>(screen.width_px) * screen.height_px;
  ASSERT_EQ(words.size(), pixels);
  size_t wrong = 0;
  for (size_t i = 0; i < pixels * 3; ++i) {
    const std::uint32_t code = words[i / 3] >> (static_cast<size_t>(screen.bits) * (2 - i % 3));
    const std::uint32_t shown = picture == nullptr ? 0u : picture->samples[i];
    wrong += (code & ((1u << screen.bits) - 1)) == shown ? 0 : 1;
  }
  EXPECT_EQ(wrong, 0u) << screen.name;
}

TEST(X11Display, TheFramebufferHoldsThePicturesCodes) {
  if (server() == nullptr) GTEST_SKIP() << "no Xvfb and xrandr here";
  const std::unique_ptr<X11Display> display = open_two(*server()).value();
  const std::vector<ScreenInfo>& screens = display->screens();
  ASSERT_EQ(screens.size(), 2u);
  EXPECT_EQ(screens[1].width_px, 128);
  for (unsigned i = 0; i < 4; ++i) {
    const Picture back = noise(320, 240, i), left = i == 2 ? nullptr : noise(128, 96, 100 + i);
    ASSERT_OK(display->show({back, left}, monotonic_now()));
    expect_on_screen(*server(), screens[0], 0, 0, back);
    expect_on_screen(*server(), screens[1], 320, 100, left);
  }
}

TEST(X11Display, CodesOf10BitsNeedAServerThatHasThem) {
  const std::unique_ptr<Xvfb> deep = Xvfb::start(30);
  if (deep == nullptr) GTEST_SKIP() << "no Xvfb of depth 30 here";
  const std::unique_ptr<X11Display> display =
      X11Display::open({.server = deep->name(), .monitors = {}, .bits = 10}).value();
  const ScreenInfo& screen = display->screens()[0];
  EXPECT_EQ(screen.bits, 10);
  for (unsigned i = 0; i < 4; ++i) {
    const Picture picture = i == 2 ? nullptr : noise(screen.width_px, screen.height_px, i, 10);
    ASSERT_OK(display->show({picture}, monotonic_now()));
    expect_on_screen(*deep, screen, 0, 0, picture);
  }
  const auto refused = [](const Xvfb& xvfb, int bits, const std::string& words) {
    const absl::Status status =
        X11Display::open({.server = xvfb.name(), .monitors = {}, .bits = bits}).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  refused(*deep, 8, "shows colour of 30 bits; codes of 8 bits need one of 24");
  if (server() != nullptr) refused(*server(), 10, "shows colour of 24 bits; codes of 10 bits need one of 30");
}

// The timer of a server without a screen is late when the machine is busy; see the contract.
TEST(X11Display, MeasuresTheRefresh) {
  if (server() == nullptr) GTEST_SKIP() << "no Xvfb and xrandr here";
  double measured_hz = 0.0;
  for (int opened = 0; opened < 20 && std::abs(measured_hz - 60.0) > 3.0; ++opened)
    measured_hz = open_two(*server()).value()->screens()[0].refresh_hz;
  EXPECT_NEAR(measured_hz, 60.0, 3.0);
}

TEST(X11Display, ShowsAtTheRefreshThatWasAskedFor) {
  if (server() == nullptr) GTEST_SKIP() << "no Xvfb and xrandr here";
  const std::unique_ptr<X11Display> display = open_two(*server()).value();
  constexpr int kInARow = 6;
  int in_time = 0;
  for (int shown = 0; in_time < kInARow && shown < 200; ++shown) {
    const nanoseconds at = monotonic_now() + milliseconds(100 + 3 * (shown % 10));
    const std::vector<Scanout> scanouts = display->show({}, at).value();
    const bool all = std::ranges::all_of(std::array{0, 1}, [&](int m) {
      const size_t monitor = m;
      const double late = static_cast<double>((scanouts[monitor].start - at).count()) /
                          period_ns_of(display->screens()[monitor]);
      return late >= -0.2 && late <= 1.2;
    });
    in_time = all ? in_time + 1 : 0;
  }
  EXPECT_EQ(in_time, kInARow);
}

TEST(X11Display, SaysWhatIsWrong) {
  const absl::Status nobody = X11Display::open({.server = ":9999", .monitors = {}}).status();
  EXPECT_TRUE(absl::IsUnavailable(nobody));
  EXPECT_NE(std::string(nobody.message()).find(":9999"), std::string::npos) << nobody;
  if (server() == nullptr) GTEST_SKIP() << "no Xvfb and xrandr here";
  const absl::Status unknown =
      X11Display::open({.server = server()->name(), .monitors = {{"back", "HDMI-7"}}}).status();
  EXPECT_TRUE(absl::IsNotFound(unknown));
  for (const std::string words : {"HDMI-7", "DP-1 (320 x 240 px)", "DP-2 (128 x 96 px)"})
    EXPECT_NE(std::string(unknown.message()).find(words), std::string::npos) << unknown;
}

TEST(X11Display, AServerThatDiesIsAnErrorSoon) {
  const std::unique_ptr<Xvfb> own = Xvfb::start();
  if (own == nullptr) GTEST_SKIP() << "no Xvfb and xrandr here";
  const std::unique_ptr<X11Display> display =
      X11Display::open({.server = own->name(), .monitors = {}}).value();
  ASSERT_OK(display->show({}, monotonic_now()));
  own->kill();
  EXPECT_TRUE(absl::IsUnavailable(display->show({}, monotonic_now()).status()));
}

}  // namespace
}  // namespace glasswing
