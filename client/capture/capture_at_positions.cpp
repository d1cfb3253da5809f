#include "client/capture/capture_at_positions.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>

#include "client/capture/capture.h"
#include "client/capture/operator.h"
#include "client/capture/watch.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

std::string session_at(const std::string& session, double position_mm) {
  return fmt::format("{}-{}", session, position_mm);
}

std::vector<std::string> planned_monitors(const v1::Plan& plan) {
  std::vector<std::string> names;
  for (const v1::PlanMonitor& monitor : plan.monitors()) names.push_back(monitor.name());
  return names;
}

void print_what_follows(const std::string& session, const std::vector<v1::Session>& captured) {
  if (captured.size() < 2) return;
  std::vector<std::string> names;
  for (const v1::Session& each : captured) {
    names.push_back(each.name());
    if (each.state() != v1::SESSION_STATE_DONE)
      std::cout << fmt::format("glasswing solve {} --watch\n", each.name());
  }
  // Rays need two; the outer ones determine directions best.
  std::cout << fmt::format("glasswing rays {} {} --geometry rig.txtpb -o {}-rays.exr\n", names.front(),
                           names.back(), session);
}

// The series in progress.
class Series {
 public:
  Series(const Client& client, const v1::CreateSessionRequest& request, std::string monitor, bool has_rail)
      : client_(client), request_(request), monitor_(std::move(monitor)), has_rail_(has_rail) {}

  absl::StatusOr<v1::Session> capture(
      double position_mm, bool ask, const std::function<absl::StatusOr<v1::Session>(v1::Session)>& annotate) {
    if (has_rail_) {
      GW_RETURN_IF_ERROR(move_along_rail(client_, monitor_, position_mm));
    } else if (ask) {
      GW_RETURN_IF_ERROR(ask_operator(fmt::format("move monitor {} to {} mm", monitor_, position_mm)));
    }
    v1::CreateSessionRequest request = request_;
    request.set_name(session_at(request_.name(), position_mm));
    if (!has_rail_) (*request.mutable_rail_mm())[monitor_] = position_mm;
    GW_ASSIGN_OR_RETURN(v1::Session session, create_session(client_, std::move(request)));
    GW_RETURN_IF_ERROR(annotate(session).status());
    GW_ASSIGN_OR_RETURN(session, follow(client_, session.name(), Follow::kUntilCaptured));
    while (waits_for_object(session) && can_ask()) {
      GW_RETURN_IF_ERROR(ask_operator(what_to_do(session)));
      v1::ResumeSessionRequest resume;
      resume.set_name(session.name());
      GW_RETURN_IF_ERROR(
          call(server_, &v1::SessionService::Stub::ResumeSession, resume, kLongCallTimeout).status());
      GW_ASSIGN_OR_RETURN(session, follow(client_, session.name(), Follow::kUntilCaptured));
    }
    if (session.state() == v1::SESSION_STATE_SOLVING) return session;
    GW_RETURN_IF_ERROR(outcome_of(session));
    return session;
  }

 private:
  const Client& client_;
  const v1::CreateSessionRequest& request_;
  const std::string monitor_;
  const bool has_rail_;
  const Peer<v1::SessionService> server_{client_.server_title(), client_.server};
};

absl::Status check_range(const RailPositions& positions, const std::string& monitor, const v1::Rail& rail) {
  for (const double position_mm : positions.mm) {
    if (position_mm >= rail.min_mm() && position_mm <= rail.max_mm()) continue;
    return absl::InvalidArgumentError(
        fmt::format("--rail-mm has {}; the rail of monitor \"{}\" goes from {} to {} mm", position_mm,
                    monitor, rail.min_mm(), rail.max_mm()));
  }
  return absl::OkStatus();
}

// Anything that would be rejected at a later position is rejected before anything is moved.
absl::Status check_captures(const Client& client, const v1::CreateSessionRequest& request,
                            const RailPositions& positions) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  for (const double position_mm : positions.mm) {
    v1::EstimateSessionRequest estimate;
    estimate.set_name(session_at(request.name(), position_mm));
    *estimate.mutable_plan() = request.plan();
    GW_RETURN_IF_ERROR(
        call(server, &v1::SessionService::Stub::EstimateSession, estimate, kLongCallTimeout).status());
  }
  return absl::OkStatus();
}

// An error of one position, with what is left to do.
absl::Status with_rest(const absl::Status& status, const RailPositions& positions, size_t failed) {
  if (failed + 1 >= positions.mm.size()) return status;
  const std::vector<double> rest(positions.mm.begin() + static_cast<std::ptrdiff_t>(failed) + 1,
                                 positions.mm.end());
  return absl::Status(status.code(), fmt::format("{}; not captured: --rail-mm {}",
                                                 std::string(status.message()), fmt::join(rest, ",")));
}

}  // namespace

absl::Status check_series(const std::string& session, const RailPositions& positions) {
  if (session.empty()) {
    return absl::InvalidArgumentError(
        "--rail-mm needs --session: the sessions are named after it and their positions, such as vase-200");
  }
  for (const double position_mm : positions.mm)
    GW_RETURN_IF_ERROR(check_name("session", session_at(session, position_mm)));
  return absl::OkStatus();
}

absl::Status capture_at_positions(const Client& client, const v1::CreateSessionRequest& request,
                                  const RailPositions& positions,
                                  const std::function<absl::StatusOr<v1::Session>(v1::Session)>& annotate) {
  GW_ASSIGN_OR_RETURN(const RigView rig, read_rig_view(client, request.plan().camera()));
  GW_ASSIGN_OR_RETURN(const std::string monitor,
                      monitor_to_move(positions.monitor, rig, planned_monitors(request.plan())));
  const bool has_rail = rig.rails.contains(monitor), several = positions.mm.size() > 1;
  if (!has_rail && several && !can_ask()) {
    return absl::FailedPreconditionError(fmt::format(
        "monitor {0} has no rail (glasswing-display --rail), and standard input is not a terminal to ask at; "
        "move it by hand, and capture each position separately: --rail-mm {0}:{1}",
        monitor, positions.mm[0]));
  }
  if (has_rail) GW_RETURN_IF_ERROR(check_range(positions, monitor, rig.rails.at(monitor)));
  GW_RETURN_IF_ERROR(check_captures(client, request, positions));
  Series series(client, request, monitor, has_rail);
  v1::ListSessionsResponse captured;
  for (size_t i = 0; i < positions.mm.size(); ++i) {
    const absl::StatusOr<v1::Session> session = series.capture(positions.mm[i], several, annotate);
    if (!session.ok()) return with_rest(session.status(), positions, i);
    *captured.add_sessions() = *session;
  }
  absl::Status outcome;
  for (v1::Session& session : *captured.mutable_sessions()) {
    if (session.state() == v1::SESSION_STATE_SOLVING) {
      GW_ASSIGN_OR_RETURN(session, follow(client, session.name()));
      outcome.Update(outcome_of(session, Goal::kDone));
    }
    if (!client.json) print_session(session, false);
  }
  if (client.json) print_json(captured);
  GW_RETURN_IF_ERROR(outcome);
  if (!client.json)
    print_what_follows(request.name(), {captured.sessions().begin(), captured.sessions().end()});
  return absl::OkStatus();
}

}  // namespace glasswing
