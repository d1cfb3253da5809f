#include "core/process/run_program.h"

#include <absl/strings/str_split.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <optional>
#include <system_error>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/base/utf8.h"
#include "core/file/descriptor.h"

namespace glasswing {
namespace {

constexpr size_t kMaxSaid_bytes = 4096;       // of the program's errors, the last ones
constexpr size_t kMaxOutput_bytes = 1 << 20;  // the first part of it
constexpr std::chrono::seconds kGrace(2);
constexpr int kStep_ms = 20;

absl::StatusOr<Descriptor> file_in_memory(std::string_view bytes) {
  Descriptor file(::memfd_create("program", MFD_CLOEXEC));
  if (!file.is_open()) return absl::ErrnoToStatus(errno, "cannot create an in-memory file");
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t written = ::write(file.get(), bytes.data() + at, bytes.size() - at);
    if (written <= 0) return absl::ErrnoToStatus(errno, "cannot write an in-memory file");
    at += static_cast<size_t>(written);
  }
  ::lseek(file.get(), 0, SEEK_SET);
  return file;
}

// A running program, in its own process group.
class Child {
 public:
  static absl::StatusOr<Child> start(const std::vector<std::string>& words, const RunOptions& options) {
    int ends[2] = {-1, -1};
    if (::pipe2(ends, O_CLOEXEC) != 0) return absl::ErrnoToStatus(errno, "cannot create a pipe");
    Child child;
    child.errors_ = Descriptor(ends[0]);
    const Descriptor errors_end(ends[1]);
    Descriptor input;
    if (!options.input.empty()) {
      GW_ASSIGN_OR_RETURN(input, file_in_memory(options.input));
    }
    if (options.keep_output) {
      GW_ASSIGN_OR_RETURN(child.output_, file_in_memory({}));
    }
    std::vector<char*> argv;
    for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    if (input.is_open())
      ::posix_spawn_file_actions_adddup2(&actions, input.get(), STDIN_FILENO);
    else
      ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    const int output = options.keep_output ? child.output_.get() : options.output_file;
    if (output >= 0) ::posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions, errors_end.get(), STDERR_FILENO);
    sigset_t none;  // daemons block signals
    ::sigemptyset(&none);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setpgroup(&attributes, 0);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
    const int error = ::posix_spawnp(&child.pid_, argv[0], &actions, &attributes, argv.data(), ::environ);
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&actions);
    if (error != 0)
      return absl::FailedPreconditionError(
          fmt::format("cannot run {}: {}", words[0], std::generic_category().message(error)));
    return child;
  }

  // Reads its output for a moment. The exit status as reported by a shell, once it has ended.
  std::optional<int> step() {
    pollfd ready{.fd = errors_.get(), .events = POLLIN, .revents = 0};
    std::array<char, 1024> bytes{};
    if (open_ && ::poll(&ready, 1, kStep_ms) > 0) {
      const ssize_t count = ::read(errors_.get(), bytes.data(), bytes.size());
      if (count > 0) said_.append(bytes.data(), count);
      if (said_.size() > kMaxSaid_bytes) said_.erase(0, said_.size() - kMaxSaid_bytes);
      open_ = count > 0;
      if (open_) return std::nullopt;  // it may say more
    } else if (!open_) {
      ::poll(nullptr, 0, kStep_ms);
    }
    int status = 0;
    if (::waitpid(pid_, &status, WNOHANG) != pid_) return std::nullopt;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  // Lets it clean up, on SIGTERM; after kGrace kills it and its child processes if they still run.
  void end() {
    ::kill(-pid_, SIGTERM);
    const nanoseconds until = monotonic_now() + kGrace;
    siginfo_t ended{};
    while (ended.si_pid == 0 && monotonic_now() < until) {
      ::poll(nullptr, 0, 10);
      ::waitid(P_PID, static_cast<id_t>(pid_), &ended, WEXITED | WNOHANG | WNOWAIT);
    }
    ::kill(-pid_, SIGKILL);
    while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  std::string last_line() const {
    const std::vector<std::string> lines = absl::StrSplit(said_, '\n', absl::SkipWhitespace());
    return lines.empty() ? "" : printable(lines.back());
  }
  std::string output() const {
    std::string bytes(output_.is_open() ? kMaxOutput_bytes : 0, '\0');
    size_t size = 0;
    while (size < bytes.size()) {
      const ssize_t count =
          ::pread(output_.get(), bytes.data() + size, bytes.size() - size, static_cast<off_t>(size));
      if (count <= 0) break;
      size += static_cast<size_t>(count);
    }
    bytes.resize(size);
    return bytes;
  }

 private:
  Child() = default;
  pid_t pid_ = 0;
  Descriptor errors_, output_;
  bool open_ = true;
  std::string said_;
};

}  // namespace

absl::StatusOr<ProgramEnd> run_program(const std::vector<std::string>& words, const RunOptions& options) {
  GW_ASSIGN_OR_RETURN(Child child, Child::start(words, options));
  const nanoseconds until = monotonic_now() + options.limit;
  while (true) {
    if (const std::optional<int> status = child.step())
      return ProgramEnd{.status = *status, .output = child.output(), .error = child.last_line()};
    if (options.stop.stop_requested()) {
      child.end();
      return absl::CancelledError(words[0] + " was ended");
    }
    if (monotonic_now() < until) continue;
    child.end();
    return absl::DeadlineExceededError(fmt::format("{} did not end within {} s, and was terminated", words[0],
                                                   std::chrono::duration<double>(options.limit).count()));
  }
}

absl::Status run_command(const std::vector<std::string>& words, const RunOptions& options) {
  GW_ASSIGN_OR_RETURN(const ProgramEnd end, run_program(words, options));
  if (end.status == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format("{} failed with exit status {}{}{}", words[0], end.status,
                                                   end.error.empty() ? "" : ": ", end.error));
}

std::vector<std::string> command_words(const std::string& command) {
  return absl::StrSplit(command, ' ', absl::SkipEmpty());
}

}  // namespace glasswing
