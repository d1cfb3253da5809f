#include "console/routes/server_link.h"

#include <absl/strings/ascii.h>
#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "glasswing/v1/console_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

using Stub = v1::ConsoleService::Stub;
constexpr std::chrono::seconds kPatience(5), kSession(30);
// For a lost connection. Meanwhile announce(), which waits longer, makes a new one.
constexpr std::chrono::milliseconds kConnect(250), kConnectAgain(2000);
constexpr size_t kMaxSecret = 128;

template <typename Request, typename Response>
absl::StatusOr<Response> answer(const ServerLink& server,
                                grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                                const Request& request, std::chrono::milliseconds connect = kConnect) {
  wait_for(*server.channel(), connect);
  Stub stub(server.channel());
  grpc::ClientContext context;
  set_deadline(context, kPatience);
  Response response;
  const absl::Status status = from_grpc((stub.*method)(&context, request, &response), server.title());
  if (absl::IsDeadlineExceeded(status)) return absl::UnavailableError(status.message());
  GW_RETURN_IF_ERROR(status);
  return response;
}

Principal principal_in(const v1::Principal& message) {
  return {.name = message.name(),
          .roles = role_of_uri(fmt::format("{}{}", kRoleUri, message.role())),
          .expires = std::chrono::sys_seconds(std::chrono::seconds(message.expires_s())),
          .token = message.token_id()};
}

}  // namespace

void wait_for(grpc::Channel& channel, std::chrono::milliseconds time) {
  channel.WaitForConnected(std::chrono::system_clock::now() + time);
}

void call_for(const Login& login, grpc::ClientContext& context) {
  context.AddMetadata("glasswing-client", login.principal.name + " (console)");
  context.AddMetadata(kLoginMetadata, login.secret);
}

ServerLink::ServerLink(const std::string& address)
    : title_("the server at " + address), channel_(dial(address, only(Role::kServer))) {}

absl::StatusOr<Login> ServerLink::log_in(const std::string& token, const std::string& from,
                                         bool locked_out) const {
  v1::LogInRequest request;
  request.set_token(fitted(token));
  request.set_from(from);
  request.set_locked_out(locked_out);
  GW_ASSIGN_OR_RETURN(const v1::LogInResponse response, answer(*this, &Stub::LogIn, request));
  return Login{.secret = response.login(), .principal = principal_in(response.principal())};
}

absl::Status ServerLink::log_out(const Login& login) const {
  v1::LogOutRequest request;
  request.set_login(login.secret);
  return answer(*this, &Stub::LogOut, request).status();
}

absl::StatusOr<Principal> ServerLink::principal_of(const std::string& login) const {
  // Anything else would be no metadata either.
  if (login.empty() || login.size() > kMaxSecret || !std::ranges::all_of(login, absl::ascii_isalnum))
    return absl::UnauthenticatedError("nobody is logged in; `glasswing console token` makes a token");
  v1::GetPrincipalRequest request;
  request.set_login(login);
  GW_ASSIGN_OR_RETURN(const v1::GetPrincipalResponse response, answer(*this, &Stub::GetPrincipal, request));
  return principal_in(response.principal());
}

absl::StatusOr<v1::Session> ServerLink::session(const Login& login, const std::string& name) const {
  v1::GetSessionRequest request;
  request.set_name(name);
  v1::GetSessionResponse response;
  grpc::ClientContext context;
  set_deadline(context, kSession);
  call_for(login, context);
  GW_RETURN_IF_ERROR(
      from_grpc(v1::SessionService::NewStub(channel_)->GetSession(&context, request, &response), title_));
  return std::move(*response.mutable_session());
}

absl::Status ServerLink::announce(const std::string& url) const {
  v1::AnnounceRequest request;
  request.set_url(url);
  return answer(*this, &Stub::Announce, request, kConnectAgain).status();
}

}  // namespace glasswing
