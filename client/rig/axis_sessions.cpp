#include "client/rig/axis_sessions.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/cli/rpc.h"
#include "core/base/status.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {

absl::StatusOr<std::vector<v1::Session>> find_poses(const Client& client,
                                                    const std::vector<std::string>& names,
                                                    const std::string& series) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  std::vector<v1::Session> sessions;
  for (const std::string& name : names) {
    v1::GetSessionRequest request;
    request.set_name(name);
    GW_ASSIGN_OR_RETURN(v1::GetSessionResponse found,
                        call(server, &v1::SessionService::Stub::GetSession, request));
    sessions.push_back(std::move(*found.mutable_session()));
  }
  if (!series.empty()) {
    v1::ListSessionsRequest request;
    request.add_tags(series);
    GW_ASSIGN_OR_RETURN(v1::ListSessionsResponse found,
                        call_pages(server, &v1::SessionService::Stub::ListSessions, request));
    for (v1::Session& session : *found.mutable_sessions()) {
      if (!session.axes().empty()) sessions.push_back(std::move(session));
    }
    std::ranges::sort(sessions, {}, [](const v1::Session& session) { return session.name(); });
    if (sessions.empty()) {
      return absl::NotFoundError(fmt::format(
          "there is no series \"{}\"; glasswing capture PLAN --turn 0:345:15 --session {} captures one",
          series, series));
    }
  }
  return sessions;
}

absl::StatusOr<std::string> axis_of(const std::vector<v1::Session>& sessions, const std::string& named) {
  std::string axis = named;
  for (const v1::Session& session : sessions) {
    if (axis.empty() && session.axes().size() == 1) axis = session.axes().begin()->first;
    if (session.axes().contains(axis) && session.axes().size() == 1) continue;
    return absl::FailedPreconditionError(
        session.axes().empty()
            ? fmt::format(
                  "session \"{}\" has no pose; glasswing capture --turn captures sessions that have one",
                  session.name())
            : fmt::format("session \"{}\" has {} axes; a pose is known with one axis{}", session.name(),
                          session.axes().size(), axis.empty() ? "" : ", " + axis));
  }
  return axis;
}

}  // namespace glasswing
