#include "core/process/run_program.h"

#include <gtest/gtest.h>

#include <string>

namespace glasswing {
namespace {

TEST(RunProgram, PassesInputOnAndKeepsOutput) {
  const std::string input(300'000, 'x');  // more than a pipe holds
  const auto end = run_program({"cat"}, {.input = input, .keep_output = true});
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_EQ(end->status, 0);
  EXPECT_EQ(end->output, input);
}

TEST(RunProgram, NoShellReadsItsWords) {
  const auto end = run_program({"printf", "%s|", "$HOME;x", "a b"}, {.keep_output = true});
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_EQ(end->output, "$HOME;x|a b|");
}

TEST(RunProgram, NothingIsThereToReadWithoutInput) {
  EXPECT_EQ(run_program({"cat"}, {.keep_output = true})->output, "");
}

TEST(RunProgram, GivesStatusAndLastErrorOfAFailure) {
  const auto end = run_program({"sh", "-c", "echo one >&2; echo two >&2; exit 3"}, {});
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_EQ(end->status, 3);
  EXPECT_EQ(end->error, "two");
  EXPECT_EQ(run_program({"sh", "-c", "kill -TERM $$"}, {})->status, 128 + 15);
}

TEST(RunProgram, KeepsTheFirstMiB) {
  const auto end = run_program({"head", "-c", "3000000", "/dev/zero"}, {.keep_output = true});
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_EQ(end->output.size(), size_t{1} << 20);
}

TEST(RunProgram, EndsAtItsLimitAndWhenStopped) {
  EXPECT_TRUE(absl::IsDeadlineExceeded(
      run_program({"sleep", "1000"}, {.limit = std::chrono::milliseconds(50)}).status()));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(absl::IsCancelled(run_program({"sleep", "1000"}, {.stop = stop.get_token()}).status()));
}

TEST(RunProgram, NamesAProgramThatIsNotThere) {
  const absl::Status status = run_program({"/nonexistent/program"}, {}).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(std::string(status.message()).find("/nonexistent/program"), std::string::npos);
}

}  // namespace
}  // namespace glasswing
