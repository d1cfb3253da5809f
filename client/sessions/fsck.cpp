#include "core/archive/fsck.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "client/sessions/commands.h"
#include "client/sessions/compare_rig.h"
#include "core/archive/fsck_command.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/progress.h"
#include "core/file/descriptor.h"

namespace glasswing {
namespace {

constexpr char kServerProgram[] = "glasswing-server";

// The program beside this one, as in packages and builds; otherwise the one in $PATH.
std::string path_of(const std::string& program) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path beside = self.parent_path() / program;
  return !error && std::filesystem::exists(beside, error) ? beside.string() : program;
}

// A program under way. Its answer is buffered until it has ended, so that it never mixes with a progress bar.
class Child {
 public:
  static absl::StatusOr<Child> start(const std::vector<std::string>& command) {
    Child child;
    int ends[2] = {-1, -1};
    if (::pipe2(ends, O_CLOEXEC) != 0) return absl::ErrnoToStatus(errno, "cannot create a pipe");
    child.errors_ = Descriptor(ends[0]);
    const Descriptor errors_end(ends[1]);
    child.answer_ = Descriptor(::memfd_create("answer", MFD_CLOEXEC));
    if (!child.answer_.is_open()) return absl::ErrnoToStatus(errno, "cannot create an in-memory file");
    std::vector<char*> argv;
    for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, child.answer_.get(), STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions, errors_end.get(), STDERR_FILENO);
    const int error = ::posix_spawnp(&child.pid_, argv[0], &actions, nullptr, argv.data(), ::environ);
    ::posix_spawn_file_actions_destroy(&actions);
    if (error == ENOENT) {
      return absl::NotFoundError(fmt::format(
          "{0} is not installed here, and only it can check the data of a server; install the package {0}",
          command[0]));
    }
    if (error != 0) return absl::ErrnoToStatus(error, fmt::format("cannot run {}", command[0]));
    return child;
  }

  // Calls `tell` for every line on its standard error.
  void read_lines(const std::function<void(const std::string& line)>& tell) {
    const std::unique_ptr<FILE, decltype(&std::fclose)> in(::fdopen(errors_.release(), "r"), std::fclose);
    char* line = nullptr;
    size_t capacity = 0;
    for (ssize_t size = 0; (size = ::getline(&line, &capacity, in.get())) > 0;)
      tell(std::string(line, line[size - 1] == '\n' ? size - 1 : size));
    std::free(line);
  }

  // The exit status, as a shell reports it.
  int wait() {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

  // After it has ended.
  std::string answer() const {
    std::string text(std::max<off_t>(::lseek(answer_.get(), 0, SEEK_END), 0), '\0');
    const ssize_t size = ::pread(answer_.get(), text.data(), text.size(), 0);
    text.resize(std::max<ssize_t>(size, 0));
    return text;
  }

 private:
  Child() = default;
  pid_t pid_ = 0;
  Descriptor answer_, errors_;
};

// Runs `glasswing-server fsck`, and prints its answer. Returns its exit status: 0 or kDamage.
absl::StatusOr<int> check_by_server(const FsckArguments& arguments) {
  std::vector<std::string> command = {path_of(kServerProgram), "fsck", "--show-progress"};
  if (arguments.repair) command.push_back("--repair");
  if (arguments.json) command.push_back("--json");
  command.insert(command.end(), {"--", arguments.path});
  GW_ASSIGN_OR_RETURN(Child child, Child::start(command));
  std::string error;
  {
    Progress progress("checking");
    child.read_lines([&](const std::string& line) {
      if (line.starts_with(kProgressLine)) {
        progress.update(std::strtod(line.c_str() + sizeof(kProgressLine) - 1, nullptr));
      } else {
        error = line;
      }
    });
  }
  const int exit_status = child.wait();
  if (exit_status != 0 && exit_status != kDamage) {
    const std::string named = std::string(kServerProgram) + ": ";
    if (error.starts_with(named)) error.erase(0, named.size());
    return absl::InternalError(
        error.empty() ? fmt::format("{} ended with status {}", kServerProgram, exit_status) : error);
  }
  std::cout << child.answer();
  return exit_status;
}

absl::StatusOr<int> check_here(const FsckArguments& arguments) {
  GW_RETURN_IF_ERROR(become_owner(arguments.path));
  absl::StatusOr<CheckReport> report;
  {
    Progress progress("checking");
    report = fsck(arguments.path,
                  {.repair = arguments.repair, .tell = [&](double fraction) { progress.update(fraction); }});
  }
  GW_RETURN_IF_ERROR(report.status());
  return print_report(*report, arguments);
}

absl::Status check_rig(Client& client, FsckArguments arguments) {
  const Interruptible ctrl_c;
  absl::StatusOr<RigReport> report;
  {
    Progress progress("comparing");
    report = compare_rig(client, [&](double fraction) { progress.update(fraction); });
  }
  GW_RETURN_IF_ERROR(report.status());
  arguments.path = client.server;
  client.exit_status = print_report(report->found, arguments);
  if (report->unanswered.empty()) return absl::OkStatus();
  return absl::UnavailableError(
      fmt::format("the data of these was not compared: {}", fmt::join(report->unanswered, "; ")));
}

absl::Status check(Client& client, FsckArguments arguments, bool rig) {
  arguments.json = client.json;
  if (rig) return check_rig(client, std::move(arguments));
  if (arguments.path.empty())
    return absl::InvalidArgumentError("fsck needs a directory, a matte file, or --rig");
  GW_ASSIGN_OR_RETURN(const CheckTarget target, recognise(arguments.path));
  GW_ASSIGN_OR_RETURN(client.exit_status,
                      target.kind == "server" ? check_by_server(arguments) : check_here(arguments));
  return absl::OkStatus();
}

}  // namespace

void add_fsck_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("fsck", kFsckDescription);
  auto arguments = std::make_shared<FsckArguments>();
  add_fsck_arguments(command, *arguments,
                     "  glasswing fsck /var/lib/glasswing\n"
                     "  glasswing fsck /var/lib/glasswing-camera --repair\n"
                     "  glasswing fsck vase.exr --json\n"
                     "  glasswing fsck --rig");
  auto rig = std::make_shared<bool>(false);
  CLI::Option* directory = command.get_option("directory")->required(false);
  command
      .add_flag("--rig", *rig,
                "while the rig runs: compare the server's catalogue with the nodes' archives, and verify its "
                "mattes")
      ->excludes(directory)
      ->excludes("--repair");
  command.callback([&client, arguments, rig] {
    client.run = [&client, arguments, rig] { return check(client, *arguments, *rig); };
  });
}

}  // namespace glasswing
