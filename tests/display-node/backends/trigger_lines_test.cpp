// Lines of devices that this machine lacks: calls to their drivers are recorded instead of made.
#include "display-node/backends/trigger_lines.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/gpio.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdarg>
#include <filesystem>
#include <fstream>
#include <vector>

#include "core/base/time.h"
#include "core/file/descriptor.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace {

// RTS and the GPIO line as they are set, with the time.
struct Level {
  bool high = false;
  glasswing::nanoseconds at{};
};
bool has_outputs = false;
std::vector<Level> levels;
std::uint64_t gpio_flags = 0;

}  // namespace

// Takes the place of the C library's.
extern "C" int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  const auto note = [](bool high) {
    levels.push_back({.high = high, .at = glasswing::monotonic_now()});
    return 0;
  };
  if (has_outputs && (request == TIOCMBIS || request == TIOCMBIC)) {
    EXPECT_EQ(*static_cast<int*>(argument), TIOCM_RTS);
    return note(request == TIOCMBIS);
  }
  if (has_outputs && request == GPIO_V2_GET_LINE_IOCTL) {
    auto* const line = static_cast<gpio_v2_line_request*>(argument);
    EXPECT_EQ(line->num_lines, 1u);
    EXPECT_EQ(line->offsets[0], 17u);
    gpio_flags = line->config.flags;
    line->fd = ::dup(fd);
    return 0;
  }
  if (has_outputs && request == GPIO_V2_LINE_SET_VALUES_IOCTL) {
    const auto* const values = static_cast<gpio_v2_line_values*>(argument);
    EXPECT_EQ(values->mask, 1u);
    return note(values->bits == 1);
  }
  return static_cast<int>(::syscall(SYS_ioctl, fd, request, argument));
}

namespace glasswing {
namespace {

using std::chrono::milliseconds;

class TriggerLinesTest : public testing::Test {
 protected:
  void SetUp() override {
    has_outputs = false;
    levels.clear();
  }
  static std::string error_of(const std::string& text) {
    const absl::Status status = open_trigger_line(text).status();
    EXPECT_FALSE(status.ok()) << text;
    return std::string(status.message());
  }
  static void expect_pulse(const std::string& text, bool inverted) {
    has_outputs = true;
    levels.clear();
    const auto line = open_trigger_line(text);
    ASSERT_OK(line.status());
    if (!levels.empty()) {
      EXPECT_EQ(levels.back().high, inverted);  // low when it opens
    }
    levels.clear();
    for (int i = 0; i < 3; ++i) {
      const nanoseconds before = monotonic_now();
      ASSERT_OK((*line)->pulse());
      ASSERT_EQ(levels.size(), 2u);
      EXPECT_EQ(levels[0].high, !inverted);
      EXPECT_EQ(levels[1].high, inverted);
      EXPECT_GE(levels[0].at, before);
      EXPECT_GE(levels[1].at - levels[0].at, milliseconds(1));
      levels.clear();
    }
  }
};

TEST_F(TriggerLinesTest, ASerialPortRaisesRts) {
  int controller = -1, port = -1;
  char name[64] = "";
  ASSERT_EQ(::openpty(&controller, &port, name, nullptr, nullptr), 0);
  const Descriptor held(controller);
  ::close(port);
  // This one has no RTS.
  EXPECT_NE(error_of(std::string("serial:") + name).find("a serial port with an RTS output"),
            std::string::npos);
  expect_pulse(std::string("serial:") + name, false);
  expect_pulse(std::string("serial:") + name + ",inverted", true);
}

TEST_F(TriggerLinesTest, AGpioLineIsAnOutput) {
  expect_pulse("gpio:/dev/null:17", false);
  EXPECT_EQ(gpio_flags, GPIO_V2_LINE_FLAG_OUTPUT);
  // The kernel swaps the levels.
  expect_pulse("gpio:/dev/null:17,inverted", false);
  EXPECT_EQ(gpio_flags, GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_ACTIVE_LOW);
  has_outputs = false;
  EXPECT_NE(error_of("gpio:/dev/null:17").find("line 17 of /dev/null cannot be an output"),
            std::string::npos);
}

TEST_F(TriggerLinesTest, AProgramGetsALineOfText) {
  const TemporaryDirectory folder;
  const std::string program = (folder.path() / "raise").string(),
                    raised = (folder.path() / "raised").string();
  std::ofstream(program) << "#!/bin/sh\nwhile read line; do echo x >>" << raised << "; done\n";
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  {
    const auto line = open_trigger_line("command:" + program);
    ASSERT_OK(line.status());
    for (int i = 1; i <= 3; ++i) {
      ASSERT_OK((*line)->pulse());
      std::error_code error;
      while (std::filesystem::file_size(raised, error) != 2u * i) {
      }
    }
  }
  const auto ended = open_trigger_line("command:true");
  ASSERT_OK(ended.status());
  while ((*ended)->pulse().message() != "true has ended") {
  }
}

TEST_F(TriggerLinesTest, WhatItIsNotIsRefused) {
  for (const char* text : {"", "serial", "serial:", "usb:/dev/ttyUSB0", "RTS"})
    EXPECT_NE(error_of(text).find("it must be command:PROGRAM, serial:DEVICE or gpio:DEVICE:LINE"),
              std::string::npos)
        << text;
  EXPECT_NE(error_of("serial:/dev/null").find("/dev/null is no serial port"), std::string::npos);
  EXPECT_NE(error_of("serial:/dev/none").find("cannot open /dev/none"), std::string::npos);
  EXPECT_NE(error_of("gpio:/dev/gpiochip0").find("gpio:DEVICE:LINE"), std::string::npos);
  EXPECT_NE(error_of("command:no-such-program").find("cannot run no-such-program"), std::string::npos);
}

}  // namespace
}  // namespace glasswing
