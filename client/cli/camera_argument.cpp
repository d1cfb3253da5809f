#include "client/cli/camera_argument.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "client/cli/rpc.h"
#include "core/base/status.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {

void add_view_option(CLI::App& command, std::string& camera) {
  command.add_option("--camera", camera, "of a session with several cameras, this one; default: all")
      ->type_name("CAMERA");
}

void add_cameras_option(CLI::App& command, std::vector<std::string>& cameras) {
  command
      .add_option(
          "--camera", cameras,
          "the camera node, in place of the plan's; repeat it for several, which see each step together")
      ->type_name("NODE")
      ->allow_extra_args(false);
}

void use_cameras(const std::vector<std::string>& cameras, v1::Plan& plan) {
  if (cameras.empty()) return;
  plan.clear_camera();
  plan.clear_cameras();
  if (cameras.size() == 1)
    plan.set_camera(cameras.front());
  else
    plan.mutable_cameras()->Assign(cameras.begin(), cameras.end());
}

const std::string& first_camera(const v1::Plan& plan) {
  return plan.cameras().empty() ? plan.camera() : plan.cameras(0);
}

absl::StatusOr<v1::Session> session_of(const Client& client, const std::string& session,
                                       const std::string& camera) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::GetSessionRequest request;
  request.set_name(session);
  GW_ASSIGN_OR_RETURN(v1::GetSessionResponse found,
                      call(server, &v1::SessionService::Stub::GetSession, request));
  if (camera.empty() || found.session().plan().camera() == camera) return std::move(*found.mutable_session());
  std::vector<std::string> cameras;
  for (const v1::Session& view : found.session().views()) {
    cameras.push_back(view.view_camera());
    if (view.view_camera() != camera) continue;
    request.set_name(view.name());  // with its plan
    GW_ASSIGN_OR_RETURN(found, call(server, &v1::SessionService::Stub::GetSession, request));
    return std::move(*found.mutable_session());
  }
  return absl::InvalidArgumentError(
      fmt::format("--camera is {}; session {} {}", camera, session,
                  cameras.empty() ? "has one camera, and is not named with it"
                                  : fmt::format("has these: {}", fmt::join(cameras, ", "))));
}

absl::StatusOr<std::string> session_name_of(const Client& client, const std::string& session,
                                            const std::string& camera) {
  if (camera.empty()) return session;
  GW_ASSIGN_OR_RETURN(const v1::Session found, session_of(client, session, camera));
  return found.name();
}

}  // namespace glasswing
