// Runs the built program `glasswing` as a process (GLASSWING_BIN: its directory).
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

namespace glasswing {

inline std::string program_path() {
  const char* directory = std::getenv("GLASSWING_BIN");
  return std::string(directory == nullptr ? "build/release/bin" : directory) + "/glasswing";
}

class Process {
 public:
  explicit Process(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), program_path());
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    int ends[2];
    EXPECT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::signal(SIGINT, SIG_DFL);  // some shells ignore it in background jobs
      ::dup2(ends[1], STDERR_FILENO);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
    ::close(ends[1]);
    errors_ = ends[0];
  }
  ~Process() {
    if (!ended_) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
    ::close(errors_);
  }

  void interrupt() const { ::kill(pid_, SIGINT); }

  // Returns once the first Ctrl-C was handled, which removes the handler.
  void wait_until_asked() const {
    while (handles_interrupt()) std::this_thread::yield();
  }
  void wait_until_handled() const {
    while (!handles_interrupt()) std::this_thread::yield();
  }

  // Returns the status of waitpid; `errors` then has all of standard error.
  int wait() {
    for (char buffer[4096];;) {
      const ssize_t count = ::read(errors_, buffer, sizeof buffer);
      if (count <= 0) break;
      errors.append(buffer, count);
    }
    int status = 0;
    ::waitpid(pid_, &status, 0);
    ended_ = true;
    return status;
  }

  std::string errors;

 private:
  bool handles_interrupt() const {
    std::ifstream in("/proc/" + std::to_string(pid_) + "/status");
    for (std::string line; std::getline(in, line);) {
      if (line.starts_with("SigCgt:"))
        return (std::stoull(line.substr(7), nullptr, 16) >> (SIGINT - 1) & 1) != 0;
    }
    ADD_FAILURE() << "it has ended";
    return false;
  }

  pid_t pid_ = -1;
  int errors_ = -1;
  bool ended_ = false;
};

}  // namespace glasswing
