// What moves a stage: controllers behind a serial line, on a pseudo-terminal with a stand-in, and programs.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <sstream>
#include <thread>

#include "camera-node/backends/command_drive.h"
#include "camera-node/backends/serial_drive.h"
#include "camera-node/backends/sim_drive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

const StageAxis kTurn{.name = "turn", .turns = true, .min = 0.0, .max = 360.0, .letter = "A"};

// A controller at the other end of a pseudo-terminal. While `jammed`, it confirms no move until it is
// stopped.
class Controller {
 public:
  explicit Controller(SerialProtocol protocol)
      : protocol_(protocol), master_(::posix_openpt(O_RDWR | O_NOCTTY)) {
    ::grantpt(master_.get());
    ::unlockpt(master_.get());
    path_ = ::ptsname(master_.get());
    thread_ = std::jthread([this](std::stop_token stop) { serve(stop); });
  }
  const std::string& path() const { return path_; }
  std::vector<std::string> heard() {
    const std::lock_guard lock(mutex_);
    return heard_;
  }
  void wait_for(const std::string& line) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !heard_.empty() && heard_.back() == line; });
  }
  std::atomic<bool> jammed = false, silent = false;
  std::atomic<const char*> error = nullptr;  // the answer to the next line

 private:
  void say(const std::string& line) {
    const std::string bytes = line + "\r\n";
    ASSERT_EQ(::write(master_.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  void note(const std::string& line) {
    const std::lock_guard lock(mutex_);
    heard_.push_back(line);
    changed_.notify_all();
  }
  void serve(const std::stop_token& stop) {
    std::string line;
    while (!stop.stop_requested()) {
      pollfd ready{.fd = master_.get(), .events = POLLIN, .revents = 0};
      char byte = 0;
      // Nobody has opened the other end yet, or nothing comes.
      if (::poll(&ready, 1, 10) <= 0 || (ready.revents & POLLIN) == 0 || ::read(master_.get(), &byte, 1) != 1)
        continue;
      if (byte == '\x18') {
        note("reset");
        line.clear();
        say("Grbl 1.1h ['$' for help]");
      } else if (byte == '!' && protocol_ == SerialProtocol::kGrbl) {
        note("hold");
      } else if (byte == '\n') {
        note(line);
        answer(std::exchange(line, ""));
      } else {
        line += byte;
      }
    }
  }
  void answer(const std::string& line) {
    if (silent) return;
    if (const char* const words = error.exchange(nullptr)) return say(words);
    const bool plain = protocol_ == SerialProtocol::kPlain;
    if (line == "STOP") return say("STOPPED");
    if (line == "M410") {
      say("ok");  // of the move
      return say("ok");
    }
    const bool moves = plain ? line.starts_with("MOVE") : line.starts_with("G4");
    if (moves && jammed) return;
    if (!plain && moves) say("echo:busy: processing");
    say(plain ? "OK " + line.substr(line.find(' ') + 1) : "ok");
  }

  const SerialProtocol protocol_;
  const Descriptor master_;
  std::string path_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> heard_;  // guarded by mutex_
  std::jthread thread_;
};

std::unique_ptr<SerialDrive> drive_of(const Controller& controller, SerialProtocol protocol,
                                      std::chrono::milliseconds limit = std::chrono::seconds(60)) {
  return SerialDrive::create({.path = controller.path(), .protocol = protocol, .speed = 20.0, .limit = limit})
      .value();
}

using Lines = std::vector<std::string>;

TEST(SerialDrive, SpeaksGcode) {
  Controller grbl(SerialProtocol::kGrbl), marlin(SerialProtocol::kMarlin);
  const auto to_grbl = drive_of(grbl, SerialProtocol::kGrbl),
             to_marlin = drive_of(marlin, SerialProtocol::kMarlin);
  ASSERT_OK(to_grbl->home(kTurn, {}));
  ASSERT_OK(to_grbl->move(kTurn, 12.5, {}));
  EXPECT_EQ(grbl.heard(), (Lines{"$H", "G92 A0", "G90", "G1 A12.5000 F1200.0", "G4 P0"}));
  ASSERT_OK(to_marlin->home(kTurn, {}));
  ASSERT_OK(to_marlin->move(kTurn, -3.0, {}));
  EXPECT_EQ(marlin.heard(), (Lines{"G28 A", "G4 P0", "G92 A0", "G90", "G1 A-3.0000 F1200.0", "G4 P0"}));
}

TEST(SerialDrive, SpeaksThePlainProtocol) {
  Controller controller(SerialProtocol::kPlain);
  const auto drive = drive_of(controller, SerialProtocol::kPlain);
  ASSERT_OK(drive->home(kTurn, {}));
  ASSERT_OK(drive->move(kTurn, 90.0, {}));
  EXPECT_EQ(controller.heard(), (Lines{"HOME turn", "MOVE turn 90.0000"}));
}

TEST(SerialDrive, StopsTheMotorsInTheMiddleOfAMove) {
  const struct {
    SerialProtocol protocol;
    std::string move;
    Lines stop;
  } cases[] = {{SerialProtocol::kGrbl, "G4 P0", {"hold", "reset", "$X"}},
               {SerialProtocol::kMarlin, "G4 P0", {"M410"}},
               {SerialProtocol::kPlain, "MOVE turn 200.0000", {"STOP"}}};
  for (const auto& [protocol, move, stops] : cases) {
    Controller controller(protocol);
    const auto drive = drive_of(controller, protocol);
    controller.jammed = true;
    std::stop_source stop;
    const std::jthread stopper([&] {
      controller.wait_for(move);
      stop.request_stop();
    });
    const absl::Status moved = drive->move(kTurn, 200.0, stop.get_token());
    EXPECT_TRUE(absl::IsCancelled(moved)) << moved;
    const Lines heard = controller.heard();
    ASSERT_GE(heard.size(), stops.size());
    EXPECT_EQ(Lines(heard.end() - static_cast<std::ptrdiff_t>(stops.size()), heard.end()), stops);
    controller.jammed = false;
    EXPECT_OK(drive->move(kTurn, 10.0, {})) << "what was said of the stopped move is no answer to this one";
    EXPECT_EQ(controller.heard().back(), protocol == SerialProtocol::kPlain ? "MOVE turn 10.0000" : "G4 P0");
  }
}

TEST(SerialDrive, PassesOnWhatTheControllerReports) {
  for (const char* const words : {"error:9", "ALARM:1", "Error:Printer halted", "ERROR no such axis"}) {
    Controller controller(SerialProtocol::kGrbl);
    const auto drive = drive_of(controller, SerialProtocol::kGrbl);
    controller.error = words;
    const absl::Status moved = drive->move(kTurn, 1.0, {});
    EXPECT_TRUE(absl::IsFailedPrecondition(moved)) << moved;
    EXPECT_NE(moved.message().find(words), std::string::npos) << moved;
    EXPECT_OK(drive->move(kTurn, 1.0, {}));
  }
}

TEST(SerialDrive, StopsAMoveThatIsNotConfirmedInTime) {
  Controller controller(SerialProtocol::kPlain);
  const auto drive = drive_of(controller, SerialProtocol::kPlain, std::chrono::milliseconds(100));
  controller.jammed = true;
  const absl::Status moved = drive->move(kTurn, 1.0, {});
  EXPECT_TRUE(absl::IsUnavailable(moved)) << moved;
  EXPECT_NE(moved.message().find("has not confirmed \"MOVE turn 1.0000\" in 0.1 s"), std::string::npos)
      << moved;
  EXPECT_EQ(controller.heard().back(), "STOP");
}

TEST(SerialDrive, NamesALineThatIsNoneOrGone) {
  const fs::path file = fs::path(testing::TempDir()) / "no-line";
  std::ofstream(file) << "x";
  const auto status_of = [](const std::string& path, int baud = 115200) {
    return SerialDrive::create({.path = path, .baud = baud, .speed = {}}).status();
  };
  EXPECT_TRUE(absl::IsInvalidArgument(status_of(file))) << status_of(file);
  EXPECT_TRUE(absl::IsNotFound(status_of(file.string() + ".none")));
  auto controller = std::make_unique<Controller>(SerialProtocol::kGrbl);
  EXPECT_TRUE(absl::IsInvalidArgument(status_of(controller->path(), 115201)));
  const auto drive = drive_of(*controller, SerialProtocol::kGrbl);
  controller.reset();
  EXPECT_TRUE(absl::IsUnavailable(drive->move(kTurn, 1.0, {})));
}

TEST(CommandDrive, RunsProgramsWithoutAShell) {
  const fs::path folder = fs::path(testing::TempDir()) / ("command_drive." + std::to_string(::getpid()));
  fs::create_directories(folder);
  std::ofstream(folder / "move") << "#!/bin/sh\nprintf '%s|' \"$@\" > " << (folder / "moved").string()
                                 << "\n";
  fs::permissions(folder / "move", fs::perms::owner_all);
  const auto written = [&] {
    std::stringstream text;
    text << std::ifstream(folder / "moved").rdbuf();
    return text.str();
  };
  const std::string move = (folder / "move").string();
  const auto drive =
      CommandDrive::create(move + " {axis} --to={position} $HOME;x", move + " home {axis}").value();
  ASSERT_OK(drive->move(kTurn, 22.5, {}));
  EXPECT_EQ(written(), "turn|--to=22.5|$HOME;x|");
  ASSERT_OK(drive->home(kTurn, {}));
  EXPECT_EQ(written(), "home|turn|");
  EXPECT_FALSE(CommandDrive::create("move {position}", "").value()->homes());
  EXPECT_TRUE(absl::IsInvalidArgument(CommandDrive::create("move {axis}", "").status()));
  const auto slow = CommandDrive::create("sleep {position}", "", std::chrono::milliseconds(50)).value();
  EXPECT_NE(slow->move(kTurn, 1000.0, {}).message().find("has not moved axis \"turn\" in 0.05 s"),
            std::string::npos);
  std::stop_source stop;
  stop.request_stop();
  const auto endless = CommandDrive::create("sleep {position}", "").value();
  EXPECT_TRUE(absl::IsCancelled(endless->move(kTurn, 1000.0, stop.get_token())));
  fs::remove_all(folder);
}

TEST(SimDrive, StandsWhereItWasStopped) {
  double at = 0.0;
  std::stop_source stop;
  SimDrive drive(
      [&](double degrees) {
        at = degrees;
        if (degrees > 30.0) stop.request_stop();
      },
      1000.0);
  EXPECT_TRUE(absl::IsCancelled(drive.move(kTurn, 300.0, stop.get_token())));
  EXPECT_GT(at, 30.0);
  EXPECT_LT(at, 300.0);
  ASSERT_OK(drive.home(kTurn, {}));
  EXPECT_EQ(at, 0.0);
}

}  // namespace
}  // namespace glasswing
