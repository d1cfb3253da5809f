#include "camera-node/backends/serial_line.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "core/base/time.h"

namespace glasswing {
namespace {

constexpr size_t kMaxLine_bytes = 1024;
constexpr int kPoll_ms = 20;
constexpr int kWrite_ms = 2000;

absl::StatusOr<speed_t> speed_of(int baud) {
  constexpr std::pair<int, speed_t> kSpeeds[] = {{9600, B9600},     {19200, B19200},   {38400, B38400},
                                                 {57600, B57600},   {115200, B115200}, {230400, B230400},
                                                 {460800, B460800}, {921600, B921600}, {1000000, B1000000}};
  for (const auto& [rate, speed] : kSpeeds)
    if (rate == baud) return speed;
  return absl::InvalidArgumentError(fmt::format(
      "--axis-baud is {}; it must be 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600 or 1000000",
      baud));
}

}  // namespace

absl::StatusOr<SerialLine> SerialLine::open(const std::string& path, int baud) {
  const absl::StatusOr<speed_t> speed = speed_of(baud);
  if (!speed.ok()) return speed.status();
  Descriptor device(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!device.is_open()) return absl::ErrnoToStatus(errno, "cannot open " + path);
  termios settings{};
  if (::tcgetattr(device.get(), &settings) != 0)
    return absl::InvalidArgumentError(path + " is no serial line");
  ::cfmakeraw(&settings);
  ::cfsetspeed(&settings, *speed);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag &= ~static_cast<tcflag_t>(HUPCL | CRTSCTS);  // closing must not reset the controller
  if (::tcsetattr(device.get(), TCSANOW, &settings) != 0 || ::ioctl(device.get(), TIOCEXCL) != 0)
    return absl::ErrnoToStatus(errno, "cannot set up " + path);
  return SerialLine(path, std::move(device));
}

absl::Status SerialLine::write(std::string_view bytes) {
  while (!bytes.empty()) {
    pollfd ready{.fd = device_.get(), .events = POLLOUT, .revents = 0};
    if (::poll(&ready, 1, kWrite_ms) <= 0)
      return absl::UnavailableError(fmt::format("{} takes no bytes", path_));
    const ssize_t count = ::write(device_.get(), bytes.data(), bytes.size());
    if (count > 0) bytes.remove_prefix(static_cast<size_t>(count));
    if (count < 0 && errno != EAGAIN && errno != EINTR)
      return absl::UnavailableError(
          fmt::format("cannot write to {}: {}", path_, std::generic_category().message(errno)));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> SerialLine::read_line(std::chrono::milliseconds limit,
                                                  const std::stop_token& stop) {
  const nanoseconds until = monotonic_now() + limit;
  while (true) {
    if (const size_t end = pending_.find('\n'); end != std::string::npos) {
      std::string line = pending_.substr(0, end);
      pending_.erase(0, end + 1);
      if (!line.empty() && line.back() == '\r') line.pop_back();
      return line;
    }
    if (pending_.size() > kMaxLine_bytes) {
      return absl::ResourceExhaustedError(
          fmt::format("{} sends no ends of lines; is --axis-baud its rate?", path_));
    }
    if (stop.stop_requested()) return absl::CancelledError("stopped");
    if (monotonic_now() > until) return absl::DeadlineExceededError(fmt::format("{} is silent", path_));
    pollfd ready{.fd = device_.get(), .events = POLLIN, .revents = 0};
    if (::poll(&ready, 1, kPoll_ms) <= 0) continue;
    std::array<char, 256> bytes{};
    const ssize_t count = ::read(device_.get(), bytes.data(), bytes.size());
    if (count > 0) pending_.append(bytes.data(), static_cast<size_t>(count));
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR))
      return absl::UnavailableError(fmt::format("{} is gone", path_));
  }
}

void SerialLine::flush() {
  ::tcflush(device_.get(), TCIFLUSH);
  pending_.clear();
}

}  // namespace glasswing
