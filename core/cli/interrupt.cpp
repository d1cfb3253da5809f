#include "core/cli/interrupt.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdint>

namespace glasswing {
namespace {

// Becomes readable on Ctrl-C. One for the process, since a signal handler can reach only globals.
int event() {
  static const int fd = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  return fd;
}
int event_of_handler = -1;
int living = 0;  // number of Interruptibles; only the main thread creates them
struct sigaction before {};

void tell(int fd) {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(fd, &one, sizeof one);
}

void on_interrupt(int) {
  tell(event_of_handler);
}

void begin() {
  std::uint64_t ignored = 0;
  [[maybe_unused]] const ssize_t emptied = ::read(event(), &ignored, sizeof ignored);
  event_of_handler = event();
  ::sigaction(SIGINT, nullptr, &before);
  if (before.sa_handler == SIG_IGN) return;  // set by nohup, and by shells for background jobs
  struct sigaction once {};
  once.sa_handler = on_interrupt;
  once.sa_flags = static_cast<int>(SA_RESETHAND);
  ::sigaction(SIGINT, &once, nullptr);
}

}  // namespace

Interruptible::Interruptible(std::function<void()> cancel) {
  if (living++ == 0) begin();
  if (!cancel) return;
  ended_ = ::eventfd(0, EFD_CLOEXEC);
  waiting_ = std::jthread([ended = ended_, cancel = std::move(cancel)] {
    std::array<pollfd, 2> either = {pollfd{event(), POLLIN, 0}, pollfd{ended, POLLIN, 0}};
    while (::poll(either.data(), either.size(), -1) < 0) {
    }
    if (either[0].revents != 0 && either[1].revents == 0) cancel();
  });
}

Interruptible::~Interruptible() {
  if (ended_ >= 0) {
    tell(ended_);
    waiting_.join();
    ::close(ended_);
  }
  if (--living == 0) ::sigaction(SIGINT, &before, nullptr);
}

bool interrupted() {
  pollfd asked{event(), POLLIN, 0};
  return ::poll(&asked, 1, 0) == 1;
}

}  // namespace glasswing
