// The x11 backend on an X server with real refreshes, $GLASSWING_TEST_X_SERVER; tests/vm/run has Xorg on the
// kernel's vkms driver. It covers that server's monitors.
#include <cstdlib>

#include "display-node/backends/x11_display.h"
#include "tests/display-node/backends/display_contract.h"
#include "tests/display-node/backends/refresh_stamps.h"

namespace glasswing {
namespace {

std::unique_ptr<Display> make_x11() {
  const char* const server = std::getenv("GLASSWING_TEST_X_SERVER");
  if (server == nullptr) return nullptr;
  return X11Display::open({.server = server, .monitors = {}}).value();
}

INSTANTIATE_TEST_SUITE_P(X11Vblank, DisplayContract, testing::Values(make_x11));

TEST(X11Vblank, RefreshesAreStampedToAMicrosecond) {
  const std::unique_ptr<Display> display = make_x11();
  if (display == nullptr) GTEST_SKIP() << "GLASSWING_TEST_X_SERVER names no X server";
  // The period is measured over at least 28 refreshes, between stamps truncated to microseconds.
  expect_stamps_to_a_microsecond(*display, 1000.0 / 28.0);
}

}  // namespace
}  // namespace glasswing
