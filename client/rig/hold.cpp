#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "client/cli/caller_metadata.h"
#include "client/cli/rpc.h"
#include "client/rig/commands.h"
#include "core/base/status.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {
namespace {

struct HoldArguments {
  std::string reason;
  std::vector<std::string> command;
};

// Holds the rig until destroyed.
class HeldRig {
 public:
  HeldRig(const Client& client, const std::string& reason) : server_(client.server_title(), client.server) {
    v1::HoldRigRequest request;
    request.set_reason(reason);
    reader_ = server_.stub->HoldRig(&context_, request);
  }
  ~HeldRig() {
    release();
    context_.TryCancel();
    if (waiting_.joinable()) waiting_.join();
  }

  // Returns the token. FAILED_PRECONDITION names the rig's holder.
  absl::StatusOr<std::string> take() {
    v1::HoldRigResponse response;
    if (!reader_->Read(&response)) return status_from(reader_->Finish(), server_.title);
    // Reads until the end, since the server treats a client that does not read as dead.
    waiting_ = std::thread([this] {
      v1::HoldRigResponse nothing;
      while (reader_->Read(&nothing)) {
      }
      end_ = status_from(reader_->Finish(), server_.title);
    });
    const char* const outer = std::getenv(kHoldVariable);
    if (outer == nullptr || response.token() != outer) token_ = response.token();
    return response.token();
  }
  // Blocks until the server ends the hold, and returns why.
  absl::Status wait() {
    waiting_.join();
    return end_;
  }

 private:
  // The server notices the end of a call slightly later; until then it would refuse the next hold.
  void release() {
    if (token_.empty()) return;
    ::setenv(kHoldVariable, token_.c_str(), 1);
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(2));
    v1::ReleaseRigResponse response;
    server_.stub->ReleaseRig(&context, {}, &response);  // if it fails, the end of the call frees the rig
  }

  const Peer<v1::RigService> server_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::HoldRigResponse>> reader_;
  std::thread waiting_;
  absl::Status end_;
  std::string token_;  // of a hold of our own; empty: none, or one within another
};

// Returns the exit status as a shell does: 128 + the signal's number if it was killed.
absl::StatusOr<int> run_command(const std::vector<std::string>& command) {
  std::vector<char*> argv;
  for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  // Ctrl-C is for the command; the rig is held until the command ends.
  struct sigaction ignore {};
  ignore.sa_handler = SIG_IGN;
  ::sigaction(SIGINT, &ignore, nullptr);
  ::sigaction(SIGQUIT, &ignore, nullptr);
  sigset_t defaults;
  ::sigemptyset(&defaults);
  ::sigaddset(&defaults, SIGINT);
  ::sigaddset(&defaults, SIGQUIT);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setsigdefault(&attributes, &defaults);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, argv[0], nullptr, &attributes, argv.data(), ::environ);
  ::posix_spawnattr_destroy(&attributes);
  if (error != 0) return absl::ErrnoToStatus(error, fmt::format("cannot run {}", command[0]));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

absl::Status hold(Client& client, const HoldArguments& arguments) {
  HeldRig rig(client, arguments.reason);
  GW_ASSIGN_OR_RETURN(const std::string token, rig.take());
  if (arguments.command.empty()) {
    std::cout << fmt::format("{}={}\n", kHoldVariable, token) << std::flush;
    std::cerr << "the rig is held for programs with this variable in their environment; Ctrl-C frees it\n";
    return rig.wait();
  }
  ::setenv(kHoldVariable, token.c_str(), 1);
  GW_ASSIGN_OR_RETURN(client.exit_status, run_command(arguments.command));
  return absl::OkStatus();
}

}  // namespace

void add_hold_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "hold", "Hold the rig for a series of sessions, so that no other client uses it in between.");
  command.footer(
      "The rig is held while COMMAND runs, and the exit status is COMMAND's; without a command it is held "
      "until Ctrl-C.\nOther clients see who holds it and why. If this client dies, the rig is freed at once; "
      "if "
      "its machine vanishes,\nwithin 20 s.\n\n"
      "Examples:\n"
      "  glasswing hold --reason \"turntable series\" -- ./turntable.py\n"
      "  glasswing hold --reason \"moving the camera\"");
  auto arguments = std::make_shared<HoldArguments>();
  command.add_option("--reason", arguments->reason, "the reason, shown to other clients")->required();
  command.add_option("command", arguments->command, "the command to run with its arguments, after --");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return hold(client, *arguments); }; });
}

}  // namespace glasswing
