#include "display-node/backends/command_rail.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/syscall.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "core/file/descriptor.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

class CommandRailTest : public testing::Test {
 protected:
  // A program of the shell; the path has no spaces.
  std::string program(const std::string& script) const {
    std::ofstream(folder_ / "move") << "#!/bin/sh\n" << script << "\n";
    fs::permissions(folder_ / "move", fs::perms::owner_all);
    return (folder_ / "move").string();
  }
  static absl::Status moved(const std::string& command, double position_mm,
                            milliseconds limit = std::chrono::seconds(60)) {
    return CommandRail::create(command, "back", limit).value()->move(position_mm, {});
  }
  std::string written() const {
    std::stringstream text;
    text << std::ifstream(folder_ / "moved").rdbuf();
    return text.str();
  }

  const TemporaryDirectory folder_;
};

TEST_F(CommandRailTest, RunsTheProgramWithThePosition) {
  const std::string move = program("printf '%s|' \"$@\" > " + (folder_ / "moved").string());
  ASSERT_OK(moved(move + "  --to={mm} {monitor} $HOME;x", 251.2));
  EXPECT_EQ(written(), "--to=251.2|back|$HOME;x|") << "no shell reads the words";
}

TEST_F(CommandRailTest, PassesOnWhatAFailedProgramSaidLast) {
  const absl::Status status =
      moved(program("echo one >&2; echo 'axis 1: end switch' >&2; exit 3") + " {mm}", 1.0);
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_TRUE(std::string(status.message()).ends_with("failed with exit status 3: axis 1: end switch"))
      << status;
}

TEST_F(CommandRailTest, NamesAProgramThatIsNotThere) {
  const absl::Status status = moved("/nonexistent/move {mm}", 1.0);
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(std::string(status.message()).find("/nonexistent/move"), std::string::npos) << status;
}

TEST_F(CommandRailTest, KillsAProgramThatTakesTooLongAndWhatItStarted) {
  const std::string pid = (folder_ / "moved").string();
  const absl::Status status = moved(
      program("sleep 1000 & echo $! > " + pid + ".part; mv " + pid + ".part " + pid + "; wait") + " {mm}",
      1.0, milliseconds(2500));
  EXPECT_NE(std::string(status.message()).find("has not moved the monitor in 2.5 s"), std::string::npos)
      << status;
  const std::string child = written();
  ASSERT_FALSE(child.empty());
  // A process ends some time after it was killed; one that is collected already has no descriptor.
  const Descriptor process(static_cast<int>(::syscall(SYS_pidfd_open, std::stoi(child), 0)));
  if (process.get() < 0) {
    EXPECT_EQ(errno, ESRCH);
    return;
  }
  pollfd ended{.fd = process.get(), .events = POLLIN, .revents = 0};
  EXPECT_EQ(::poll(&ended, 1, 10'000), 1) << "it still runs";
}

TEST_F(CommandRailTest, EndsWhenItIsStopped) {
  std::stop_source stop;
  stop.request_stop();
  const absl::Status status =
      CommandRail::create("sleep {mm}", "back").value()->move(1000.0, stop.get_token());
  EXPECT_NE(std::string(status.message()).find("terminated before"), std::string::npos) << status;
}

TEST_F(CommandRailTest, LetsAStoppedProgramStopItsMotor) {
  const std::string moved = (folder_ / "moved").string();
  const std::string move =
      program("trap 'echo at rest > " + moved + "; exit 1' TERM; echo $$ > " + moved + "; sleep 1000 & wait");
  std::stop_source stop;
  std::jthread stopper([&] {
    while (written().empty()) std::this_thread::yield();
    stop.request_stop();
  });
  const absl::Status status =
      CommandRail::create(move + " {mm}", "back").value()->move(1.0, stop.get_token());
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_EQ(written(), "at rest\n");
}

TEST_F(CommandRailTest, KillsAStoppedProgramThatGoesOn) {
  const std::string moved = (folder_ / "moved").string();
  const std::string move = program("trap '' TERM; echo $$ > " + moved + "; while :; do sleep 0.01; done");
  std::stop_source stop;
  std::jthread stopper([&] {
    while (!written().ends_with('\n')) std::this_thread::yield();
    stop.request_stop();
  });
  const absl::Status status =
      CommandRail::create(move + " {mm}", "back").value()->move(1.0, stop.get_token());
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(::kill(std::stoi(written()), 0), 0) << "it still runs";  // move() has collected it
}

TEST_F(CommandRailTest, NeedsAPlaceForThePosition) {
  for (const char* command : {"", "move", "move {position}"})
    EXPECT_TRUE(absl::IsInvalidArgument(CommandRail::create(command, "back").status())) << command;
}

}  // namespace
}  // namespace glasswing
