// Runs command lines in this process and keeps their output. The user's own configuration is ignored.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/cli/command_line.h"

namespace glasswing {

struct Outcome {
  int status = 0;
  std::string out;
  std::string err;
};

// Runs a program's command line: `run` is run_client(), say.
inline Outcome run_captured(const std::vector<std::string>& arguments,
                            const std::function<int(int argc, const char* const* argv)>& run) {
  std::vector<const char*> argv = {"glasswing"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  ::setenv("XDG_CONFIG_HOME", "/nonexistent", 0);
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.status = run(static_cast<int>(argv.size()), argv.data());
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

// Expects failure with a single line that contains `words`.
inline void expect_one_line_error(const Outcome& outcome, const std::string& words) {
  EXPECT_TRUE(outcome.status == kFailure || outcome.status == kUsageError) << outcome.status;
  EXPECT_EQ(outcome.out, "");
  EXPECT_TRUE(outcome.err.starts_with("glasswing: ") || outcome.err.starts_with("glasswing-compositing: "))
      << outcome.err;
  EXPECT_EQ(outcome.err.find('\n'), outcome.err.size() - 1) << outcome.err;
  EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
}

// A temporary directory for the running test.
class ScratchTest : public testing::Test {
 protected:
  ScratchTest()
      : scratch_(std::filesystem::temp_directory_path() /
                 ("glasswing-" + std::to_string(::getpid()) + "-" +
                  testing::UnitTest::GetInstance()->current_test_info()->name())) {
    std::filesystem::create_directories(scratch_);
  }
  ~ScratchTest() override { std::filesystem::remove_all(scratch_); }

  const std::filesystem::path scratch_;
};

}  // namespace glasswing
