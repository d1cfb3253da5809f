#include "server/solve/following_solves.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/process/pause.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kTryEvery(1);

bool shall_be_solved(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_CAPTURED && session.solve_follows();
}

}  // namespace

FollowingSolves::FollowingSolves(SessionStore& sessions, SolveRunner& solves)
    : sessions_(sessions), solves_(solves), thread_([this](std::stop_token stop) { run(stop); }) {}

void FollowingSolves::take_up(std::span<const v1::Session> sessions) {
  for (const v1::Session& session : sessions) {
    if (shall_be_solved(session)) look(session.name());
  }
}

void FollowingSolves::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    bool all_done = true;
    for (const std::string& name : to_look_at_.take(stop)) {
      if (!absl::IsUnavailable(solve(name))) continue;
      look(name);
      all_done = false;
    }
    if (!all_done) pause(stop, kTryEvery);
  }
}

absl::Status FollowingSolves::solve(const std::string& name) {
  const absl::StatusOr<v1::Session> captured = sessions_.find(name);
  if (!captured.ok() || !shall_be_solved(*captured)) return captured.status();
  v1::SolveSessionRequest request;
  request.set_name(name);
  *request.mutable_options() = captured->options();
  const absl::Status status = solves_.solve(request).status();
  if (status.ok()) return status;
  SessionStore::Edit edit = sessions_.edit();
  absl::StatusOr<v1::Session> now = edit.find(name);
  if (!now.ok() || !shall_be_solved(*now)) return now.status();  // solved otherwise, or deleted
  if (absl::IsUnavailable(status)) {
    now->set_reason(fmt::format("{}: {}", kWaitsForNode, std::string(status.message())));
    edit.show(*now);
    return status;
  }
  spdlog::error("not solved session={} error=\"{}\"", name, std::string(status.message()));
  now->clear_solve_follows();
  now->set_reason(fmt::format("captured, but not solved: {}", std::string(status.message())));
  return edit.change(*now);
}

}  // namespace glasswing
