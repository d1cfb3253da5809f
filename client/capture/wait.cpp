#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <iostream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "client/capture/commands.h"
#include "client/capture/watch.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

using Clock = std::chrono::system_clock;

constexpr int kTimedOut = 124;  // as in timeout(1)
constexpr std::chrono::seconds kAskAgain(1);
constexpr size_t kMaxSessions = 100;  // each is a long-running call

struct WaitArguments {
  std::vector<std::string> sessions;
  double timeout_seconds = 0.0;  // 0: none
};

// The session's state at rest; DEADLINE_EXCEEDED: not yet at rest. Continues if a server was unavailable for
// a while.
absl::StatusOr<v1::Session> at_rest(const Peer<v1::SessionService>& server, const std::string& name,
                                    Clock::time_point until) {
  v1::WatchSessionRequest request;
  request.set_name(name);
  while (true) {
    grpc::ClientContext context;
    context.set_deadline(std::min<Clock::time_point>(until, Clock::now() + kLongCallTimeout));
    const auto reader = server.stub->WatchSession(&context, request);
    v1::WatchSessionResponse response;
    bool heard = false;
    while (reader->Read(&response)) heard = true;
    const grpc::Status status = reader->Finish();
    if (status.ok() && heard) return std::move(*response.mutable_session());
    if (Clock::now() >= until) return absl::DeadlineExceededError("it is not at rest yet");
    const grpc::StatusCode code = status.error_code();
    const bool again = status.ok() || code == grpc::StatusCode::DEADLINE_EXCEEDED ||
                       code == grpc::StatusCode::UNAVAILABLE || code == grpc::StatusCode::CANCELLED;
    if (!again) return status_from(status, server.title);
    if (code == grpc::StatusCode::DEADLINE_EXCEEDED) continue;
    static std::once_flag told;
    std::call_once(
        told, [&] { std::cerr << fmt::format("the {} does not answer; waiting for it\n", server.title); });
    std::this_thread::sleep_until(std::min<Clock::time_point>(until, Clock::now() + kAskAgain));
  }
}

// Prints each session as it comes to rest.
std::map<std::string, absl::StatusOr<v1::Session>> wait_for_all(const Client& client,
                                                                const WaitArguments& arguments) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  const std::chrono::duration<double> limit(arguments.timeout_seconds > 0.0 ? arguments.timeout_seconds
                                                                            : 1e8);
  const Clock::time_point until = Clock::now() + std::chrono::duration_cast<Clock::duration>(limit);
  std::map<std::string, absl::StatusOr<v1::Session>> ends;
  std::mutex mutex;
  std::vector<std::jthread> threads;
  for (const std::string& name : arguments.sessions) {
    threads.emplace_back([&, name] {
      absl::StatusOr<v1::Session> end = at_rest(server, name, until);
      const std::lock_guard lock(mutex);
      if (end.ok() && !client.json) std::cout << printable(summary_of(*end)) << "\n" << std::flush;
      ends.emplace(name, std::move(end));
    });
  }
  threads.clear();
  return ends;
}

absl::Status wait(Client& client, const WaitArguments& arguments) {
  const auto ends = wait_for_all(client, arguments);
  absl::Status first;
  std::vector<std::string> unfinished;
  nlohmann::ordered_json written = nlohmann::ordered_json::object();
  for (const auto& [name, end] : ends) {
    written[name] = end.ok() ? state_name(end->state()) : "";
    if (absl::IsDeadlineExceeded(end.status())) {
      unfinished.push_back(name);
    } else if (first.ok()) {
      first = end.ok() ? outcome_of(*end) : end.status();
    }
  }
  if (client.json) std::cout << written.dump(1) << "\n";
  GW_RETURN_IF_ERROR(first);
  if (unfinished.empty()) return absl::OkStatus();
  client.exit_status = kTimedOut;
  std::cerr << fmt::format("glasswing: after {} s not at rest: {}\n", arguments.timeout_seconds,
                           fmt::join(unfinished, ", "));
  return absl::OkStatus();
}

}  // namespace

void add_wait_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("wait",
                                          "Wait until sessions come to rest, without showing "
                                          "progress.");
  command.footer(
      "Prints a line for each session when it comes to rest. Exit status 0: all are then captured or done; "
      "1: "
      "one is paused, failed or cancelled, or does not exist; 124: the time is up. If the server restarts "
      "meanwhile, it waits for it.\n\n"
      "Examples:\n"
      "  glasswing wait vase && glasswing fetch vase -o vase.exr\n"
      "  glasswing wait vase glass crystal --timeout 28800");
  auto arguments = std::make_shared<WaitArguments>();
  command.add_option("sessions", arguments->sessions, "the sessions' names")
      ->required()
      ->expected(1, static_cast<int>(kMaxSessions));
  command
      .add_option("--timeout", arguments->timeout_seconds, "wait at most this many seconds; default: forever")
      ->check(CLI::Range(0.001, 1e8));
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return wait(client, *arguments); }; });
}

}  // namespace glasswing
