#include "display-node/backends/trigger_lines.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/gpio.h>
#include <signal.h>
#include <spawn.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <system_error>
#include <vector>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/file/descriptor.h"
#include "core/process/run_program.h"

namespace glasswing {
namespace {

constexpr nanoseconds kPulse = std::chrono::milliseconds(1);

std::string system_error(const std::string& what) {
  return fmt::format("{}: {}", what, std::generic_category().message(errno));
}

// An output with two levels.
class LevelLine : public TriggerLine {
 public:
  absl::Status pulse() final {
    GW_RETURN_IF_ERROR(set(true));
    sleep_until_monotonic(monotonic_now() + kPulse);
    return set(false);
  }
  virtual absl::Status set(bool high) = 0;
};

class SerialTriggerLine final : public LevelLine {
 public:
  static absl::StatusOr<std::unique_ptr<TriggerLine>> open(const std::string& path, bool inverted) {
    Descriptor port(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!port.is_open()) return absl::FailedPreconditionError(system_error("--line: cannot open " + path));
    termios settings{};
    if (::tcgetattr(port.get(), &settings) != 0)
      return absl::FailedPreconditionError(fmt::format("--line: {} is no serial port", path));
    settings.c_cflag |= CLOCAL;
    settings.c_cflag &= ~static_cast<tcflag_t>(HUPCL | CRTSCTS);  // RTS is ours
    if (::tcsetattr(port.get(), TCSANOW, &settings) != 0 || ::ioctl(port.get(), TIOCEXCL) != 0)
      return absl::FailedPreconditionError(system_error("--line: cannot set up " + path));
    std::unique_ptr<SerialTriggerLine> line(new SerialTriggerLine(path, std::move(port), inverted));
    if (const absl::Status low = line->set(false); !low.ok()) {
      return absl::FailedPreconditionError(
          fmt::format("--line: {}; it must be a serial port with an RTS output", std::string(low.message())));
    }
    return line;
  }
  absl::Status set(bool high) override {
    const int rts = TIOCM_RTS;
    if (::ioctl(port_.get(), high != inverted_ ? TIOCMBIS : TIOCMBIC, &rts) == 0) return absl::OkStatus();
    return absl::UnavailableError(system_error("cannot set RTS of " + path_));
  }

 private:
  SerialTriggerLine(std::string path, Descriptor port, bool inverted)
      : path_(std::move(path)), port_(std::move(port)), inverted_(inverted) {}
  const std::string path_;
  const Descriptor port_;
  const bool inverted_;
};

class GpioTriggerLine final : public LevelLine {
 public:
  static absl::StatusOr<std::unique_ptr<TriggerLine>> open(const std::string& name, bool inverted) {
    const size_t colon = name.rfind(':');
    gpio_v2_line_request request{};
    const char* const number = name.data() + (colon == std::string::npos ? name.size() : colon + 1);
    const auto [end, error] = std::from_chars(number, name.data() + name.size(), request.offsets[0]);
    if (colon == std::string::npos || error != std::errc() || end != name.data() + name.size()) {
      return absl::InvalidArgumentError(fmt::format(
          "--line is gpio:{}; it must be gpio:DEVICE:LINE, such as gpio:/dev/gpiochip0:17", name));
    }
    const std::string path = name.substr(0, colon);
    const Descriptor chip(::open(path.c_str(), O_RDWR | O_CLOEXEC));
    if (!chip.is_open()) return absl::FailedPreconditionError(system_error("--line: cannot open " + path));
    request.num_lines = 1;
    request.config.flags = GPIO_V2_LINE_FLAG_OUTPUT | (inverted ? GPIO_V2_LINE_FLAG_ACTIVE_LOW : 0);
    std::strncpy(request.consumer, "glasswing-display", sizeof request.consumer - 1);
    if (::ioctl(chip.get(), GPIO_V2_GET_LINE_IOCTL, &request) != 0)
      return absl::FailedPreconditionError(
          system_error(fmt::format("--line: line {} of {} cannot be an output", request.offsets[0], path)));
    return std::unique_ptr<TriggerLine>(new GpioTriggerLine(name, Descriptor(request.fd)));
  }
  absl::Status set(bool high) override {
    gpio_v2_line_values values{.bits = high ? 1u : 0u, .mask = 1};
    if (::ioctl(line_.get(), GPIO_V2_LINE_SET_VALUES_IOCTL, &values) == 0) return absl::OkStatus();
    return absl::UnavailableError(system_error("cannot set " + name_));
  }

 private:
  GpioTriggerLine(std::string name, Descriptor line) : name_(std::move(name)), line_(std::move(line)) {}
  const std::string name_;
  const Descriptor line_;
};

class CommandTriggerLine final : public TriggerLine {
 public:
  static absl::StatusOr<std::unique_ptr<TriggerLine>> open(const std::string& command) {
    const std::vector<std::string> words = command_words(command);
    if (words.empty()) return absl::InvalidArgumentError("--line is command:; it must be command:PROGRAM");
    int ends[2] = {-1, -1};
    // Not a pipe, which can only be written to at the risk of SIGPIPE.
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
      return absl::ErrnoToStatus(errno, "cannot create a pair of sockets");
    const Descriptor input(ends[0]);
    Descriptor output(ends[1]);
    std::vector<char*> argv;
    for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, input.get(), STDIN_FILENO);
    sigset_t none;  // daemons block signals
    ::sigemptyset(&none);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    pid_t pid = 0;
    const int error = ::posix_spawnp(&pid, argv[0], &actions, &attributes, argv.data(), ::environ);
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&actions);
    if (error != 0)
      return absl::FailedPreconditionError(
          fmt::format("--line: cannot run {}: {}", words[0], std::generic_category().message(error)));
    return std::unique_ptr<TriggerLine>(new CommandTriggerLine(words[0], std::move(output), pid));
  }
  ~CommandTriggerLine() override {
    output_.reset();  // the end of its input
    ::kill(pid_, SIGTERM);
    while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  absl::Status pulse() override {
    // A program that does not read must not hold up pictures.
    if (::send(output_.get(), "\n", 1, MSG_NOSIGNAL | MSG_DONTWAIT) == 1) return absl::OkStatus();
    if (errno == EPIPE || errno == ECONNRESET) return absl::UnavailableError(program_ + " has ended");
    return absl::UnavailableError(errno == EAGAIN ? program_ + " does not read its standard input"
                                                  : system_error("cannot write to " + program_));
  }

 private:
  CommandTriggerLine(std::string program, Descriptor output, pid_t pid)
      : program_(std::move(program)), output_(std::move(output)), pid_(pid) {}
  const std::string program_;
  Descriptor output_;
  const pid_t pid_;
};

// Removes ",inverted".
bool take_inverted(std::string& name) {
  constexpr std::string_view kInverted = ",inverted";
  if (!name.ends_with(kInverted)) return false;
  name.resize(name.size() - kInverted.size());
  return true;
}

}  // namespace

absl::StatusOr<std::unique_ptr<TriggerLine>> open_trigger_line(const std::string& text) {
  const size_t colon = text.find(':');
  const std::string kind = text.substr(0, colon);
  std::string name = colon == std::string::npos ? "" : text.substr(colon + 1);
  if (name.empty() || (kind != "command" && kind != "serial" && kind != "gpio")) {
    return absl::InvalidArgumentError(
        fmt::format("--line is {}; it must be command:PROGRAM, serial:DEVICE or gpio:DEVICE:LINE, such as "
                    "serial:/dev/ttyUSB0",
                    text));
  }
  if (kind == "command") return CommandTriggerLine::open(name);
  const bool inverted = take_inverted(name);
  return kind == "serial" ? SerialTriggerLine::open(name, inverted) : GpioTriggerLine::open(name, inverted);
}

}  // namespace glasswing
