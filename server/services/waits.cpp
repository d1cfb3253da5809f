#include "server/services/waits.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "core/pattern/describe_step.h"
#include "core/service/preparation.h"
#include "server/archives/replicas.h"
#include "server/selftest/rig_findings.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kFleetAge(1);  // counting the tiles of large jobs costs time

v1::Waiting waiting(const std::string& what, const std::string& since, const std::string& advice) {
  v1::Waiting waiting;
  waiting.set_what(what);
  waiting.set_since(since);
  waiting.set_advice(advice);
  return waiting;
}

// The beginnings of reasons that a running capture or solve gives for its own waiting.
struct OwnReason {
  std::string_view begin, what, advice;
};
constexpr OwnReason kOwnReasons[] = {
    {kWaitsForServerRoom,
     "the server's disk is full: ", "free space there; the solve then continues by itself"},
    {kWaitsForStore, "the job store does not answer: ", "start it; the solve then continues by itself"},
    {kWaitsForRoom,
     "the camera node's disk is full: ", "free space there; the capture then continues by itself"},
    {kWaitsForAnswer, "", "it is still working; the capture then continues by itself"},
    {kWaitsForPicture, "", "the capture continues by itself when it arrives"},
    {kWaitsForNode, "", "start it again; after half a minute the capture pauses, without losing anything"},
};

std::optional<v1::Waiting> stall_of(const v1::Session& session) {
  for (int cause = v1::RetakeCause_MIN; cause <= v1::RetakeCause_MAX; ++cause) {
    const auto why = static_cast<v1::RetakeCause>(cause);
    if (!v1::RetakeCause_IsValid(cause) || session.reason() != fmt::format("{}: {}", kStalled, describe(why)))
      continue;
    const auto counted = std::ranges::find(session.retakes(), why, &v1::RetakeCount::cause);
    const std::string count = counted == session.retakes().end()
                                  ? ""
                                  : fmt::format("{} steps were shown again for this; ", counted->count());
    return waiting(fmt::format("no step is being proven ({})", describe(why)), session.waiting().since(),
                   count + retake_advice(why));
  }
  return std::nullopt;
}

std::optional<v1::Waiting> own_waiting(const v1::Session& session) {
  if (auto stall = stall_of(session)) return stall;
  for (const OwnReason& own : kOwnReasons) {
    const std::string begin = fmt::format("{}: ", own.begin);
    if (!session.reason().starts_with(begin)) continue;
    return waiting(std::string(own.what) + session.reason().substr(begin.size()), session.waiting().since(),
                   std::string(own.advice));
  }
  return std::nullopt;
}

std::optional<v1::Waiting> node_waiting(const v1::Node& node, const std::string& role,
                                        const std::string& advice) {
  return waiting(fmt::format("{} \"{}\"{} is away", role, node.name(),
                             node.address().empty() ? "" : " at " + node.address()),
                 node.away_since(), advice);
}

// A capture that has begun; it continues when the camera is ready.
std::optional<v1::Waiting> camera_waiting(const v1::Session& session, const std::vector<v1::Node>& nodes) {
  const auto camera = std::ranges::find_if(nodes, [&](const v1::Node& node) {
    return node.kind() == v1::NODE_KIND_CAMERA && node.address() == session.archive_address();
  });
  if (camera == nodes.end() || !camera->has_preparation()) return std::nullopt;
  return waiting(fmt::format("camera node \"{}\" is not ready: {}", camera->name(),
                             preparation_text(camera->preparation())),
                 "", "the capture then continues by itself");
}

bool is_up(const std::vector<v1::Node>& nodes, const std::string& name) {
  return std::ranges::any_of(nodes, [&](const v1::Node& node) { return node.name() == name && node.up(); });
}

// The node that holds the frames, if it and all replicas are unavailable.
const v1::Node* missing_keeper(const v1::Session& session, const std::vector<v1::Node>& nodes) {
  const auto keeper = std::ranges::find(nodes, session.archive_address(), &v1::Node::address);
  if (session.archive_address().empty() || keeper == nodes.end() || keeper->up()) return nullptr;
  const bool copied = std::ranges::any_of(session.copies(), [&](const v1::ArchiveCopy& copy) {
    return is_whole(copy) && is_up(nodes, copy.node());
  });
  return copied ? nullptr : &*keeper;
}

std::optional<v1::Waiting> capture_waiting(const v1::Session& session, const Surroundings& around) {
  const std::string resume = "glasswing resume " + session.name();
  for (const v1::Node& node : around.nodes) {
    const bool display = node.kind() == v1::NODE_KIND_DISPLAY;
    const bool needed =
        display || (node.kind() == v1::NODE_KIND_CAMERA && node.address() == session.archive_address());
    if (!needed || node.up()) continue;
    return node_waiting(node, display ? "display node" : "camera node", "start it; then: " + resume);
  }
  if (around.holder && around.holder->what() != "session " + session.name()) {
    return waiting(fmt::format("the rig is in use: {}{}", around.holder->what(),
                               around.holder->client().empty() ? "" : ", by " + around.holder->client()),
                   around.holder->since(), "when it is free: " + resume);
  }
  return std::nullopt;
}

std::optional<v1::Waiting> solver_waiting(const v1::GetFleetResponse& fleet) {
  const v1::FleetSolver* refused = nullptr;
  for (const v1::FleetSolver& solver : fleet.solvers()) {
    if (solver.up() && solver.refused().empty()) return std::nullopt;
    if (solver.up()) refused = &solver;
  }
  if (refused != nullptr) {
    return waiting("no solver gets work: " + refused->refused(), "", "see them all: glasswing fleet");
  }
  return waiting("no solver is running", fleet.solver_heard(),
                 "start one: glasswing-solver --server HOST:PORT, or \"systemctl start glasswing-solver\" "
                 "where it is installed");
}

// A draft of its images decides whether it continues.
bool awaits_draft(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_CAPTURING && session.plan().has_adapt() &&
         is_wholly_proven(session);
}

bool is_own(const v1::FleetSolve& solve, const v1::Session& session) {
  return solve.session() == session.name() && solve.server().empty();
}

// Solvers work on the oldest solve first.
std::optional<v1::Waiting> queue_waiting(const v1::Session& session, const v1::GetFleetResponse& fleet) {
  int before = 0;
  const v1::FleetSolve* first = nullptr;
  for (const v1::FleetSolve& solve : fleet.solves()) {
    if (is_own(solve, session)) {
      if (first == nullptr) return std::nullopt;
      return waiting(before == 1 ? fmt::format("the solvers work on session \"{}\" first", first->session())
                                 : fmt::format("the solvers work on {} other sessions first, now on \"{}\"",
                                               before, first->session()),
                     "", "it begins by itself; sooner with more solvers");
    }
    if (solve.held() || solve.tiles_leased() == 0) continue;
    ++before;
    if (first == nullptr) first = &solve;
  }
  return std::nullopt;
}

std::optional<v1::Waiting> quarantine_waiting(const v1::Session& session) {
  if (session.quarantined().empty()) return std::nullopt;
  const v1::QuarantinedTile& first = session.quarantined(0);
  return waiting(fmt::format("tile {} could not be solved: {}", first.tile(), first.error()), "",
                 "the other tiles continue; afterwards: glasswing retry " + session.name());
}

std::optional<v1::Waiting> solve_waiting(const v1::Session& session, const Surroundings& around) {
  if (!around.fleet.ok()) {
    return waiting("the job store does not answer: " + std::string(around.fleet.status().message()),
                   around.store_away_since, "start it; the solve then continues by itself");
  }
  if (const v1::Node* keeper = missing_keeper(session, around.nodes)) {
    std::optional<v1::Waiting> away =
        node_waiting(*keeper, "camera node", "start it; the solve then continues by itself");
    away->set_what(away->what() + ", and with it the frames");
    return away;
  }
  const bool worked_on = std::ranges::any_of(around.fleet->solves(), [&](const v1::FleetSolve& solve) {
    return is_own(solve, session) && solve.tiles_leased() > 0;
  });
  if (worked_on) return quarantine_waiting(session);
  if (auto none = solver_waiting(*around.fleet)) return none;
  if (auto queue = queue_waiting(session, *around.fleet)) return queue;
  return quarantine_waiting(session);
}

}  // namespace

std::optional<v1::Waiting> waiting_of(const v1::Session& session, const Surroundings& around) {
  switch (session.state()) {
    case v1::SESSION_STATE_CAPTURING:
      if (auto own = own_waiting(session)) return own;
      if (auto camera = camera_waiting(session, around.nodes)) return camera;
      return awaits_draft(session) && around.fleet.ok() ? solver_waiting(*around.fleet) : std::nullopt;
    case v1::SESSION_STATE_PAUSED:
      return rests_in_solve(session) ? std::nullopt : capture_waiting(session, around);
    case v1::SESSION_STATE_SOLVING:
      if (auto own = own_waiting(session)) return own;
      return solve_waiting(session, around);
    default:
      return std::nullopt;
  }
}

absl::StatusOr<v1::GetFleetResponse> Waits::fleet() {
  const std::lock_guard lock(mutex_);
  const nanoseconds now = monotonic_now();
  if (!fleet_ || now - fleet_read_ >= kFleetAge) {
    fleet_ = server_.fleet();
    fleet_read_ = monotonic_now();
  }
  return *fleet_;
}

v1::Session Waits::told(v1::Session session) {
  Surroundings around;
  if (session.state() == v1::SESSION_STATE_CAPTURING || session.state() == v1::SESSION_STATE_PAUSED ||
      session.state() == v1::SESSION_STATE_SOLVING)
    around.nodes = server_.rig().nodes();
  if (session.state() == v1::SESSION_STATE_PAUSED) around.holder = server_.rig_lock().holder();
  if (session.state() == v1::SESSION_STATE_SOLVING || awaits_draft(session)) {
    around.fleet = fleet();
    around.store_away_since = server_.problems().since(kJobStore);
  }
  const std::optional<v1::Waiting> waiting = waiting_of(session, around);
  session.clear_waiting();
  if (waiting) *session.mutable_waiting() = *waiting;
  session.clear_draft();
  if (const std::optional<v1::Draft> draft = server_.drafts().of(session)) *session.mutable_draft() = *draft;
  return session;
}

}  // namespace glasswing
