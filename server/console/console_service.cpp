#include "server/console/console_service.h"

#include <fmt/chrono.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <regex>

#include "core/base/status.h"
#include "core/security/peer.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

std::string time_text(std::chrono::sys_seconds time) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::system_clock::to_time_t(time)));
}

std::string metadata_of(const grpc::ServerContext& context, const char* key) {
  const auto found = context.client_metadata().find(key);
  return found == context.client_metadata().end() ? ""
                                                  : std::string(found->second.data(), found->second.size());
}

void set(v1::Principal& message, const Principal& principal) {
  message.set_name(principal.name);
  message.set_role(names_of(principal.roles));
  message.set_expires_s(principal.expires.time_since_epoch().count());
  message.set_token_id(principal.token);
}

}  // namespace

absl::StatusOr<AccessTokens::Maker> ConsoleServiceImpl::maker_of(const grpc::ServerContext& context) const {
  if (const std::string login = metadata_of(context, kLoginMetadata); !login.empty()) {
    GW_ASSIGN_OR_RETURN(const Principal principal, tokens_.principal_of(login, AccessTokens::current_time()));
    return AccessTokens::Maker{
        .name = principal.name + " (console)", .expires = principal.expires, .token = principal.token};
  }
  if (const std::optional<CertifiedPeer> peer = peer_of(*context.auth_context()))
    return AccessTokens::Maker{.name = peer->name, .expires = peer->expires};
  return AccessTokens::Maker{.name = metadata_of(context, "glasswing-client").substr(0, 200)};
}

absl::StatusOr<std::string> ConsoleServiceImpl::console_url() {
  std::unique_lock lock(mutex_);
  const bool is_there = announcement_.wait_for(lock, kWait, [this] {
    return !url_.empty() && std::chrono::steady_clock::now() - announced_ < kAnnounced;
  });
  if (is_there) return url_;
  return absl::FailedPreconditionError(
      "no console has announced itself to this server; start one: glasswing-console --server HOST:PORT");
}

grpc::Status ConsoleServiceImpl::CreateToken(grpc::ServerContext* context,
                                             const v1::CreateTokenRequest* request,
                                             v1::CreateTokenResponse* response) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<AccessTokens::Maker> maker = maker_of(*context);
  if (!maker.ok()) return to_grpc(maker.status());
  constexpr double kMaxHours = 24.0 * 365.0;
  if (!(request->valid_hours() > 0.0 && request->valid_hours() <= kMaxHours))
    return to_grpc(absl::InvalidArgumentError("valid_hours must be above 0 and at most 8760"));
  const std::chrono::sys_seconds now = AccessTokens::current_time();
  const std::chrono::sys_seconds expires =
      now + std::chrono::seconds(std::llround(3600.0 * request->valid_hours()));
  absl::StatusOr<std::string> url = console_url();
  if (!url.ok()) return to_grpc(url.status());
  const absl::StatusOr<AccessTokens::Made> made =
      tokens_.make(*maker, request->name(), request->role(), expires, now);
  if (!made.ok()) return to_grpc(made.status());
  response->set_url(*std::move(url));
  response->set_token(made->secret);
  response->set_id(made->token.id);
  response->set_expires(time_text(made->token.expires));
  spdlog::info("audit console token={} name=\"{}\" role={} expires={} made_by=\"{}\"{}", made->token.id,
               made->token.name, made->token.role, response->expires(), maker->name,
               maker->token.empty() ? "" : " with_token=" + maker->token);
  return grpc::Status::OK;
}

grpc::Status ConsoleServiceImpl::ListTokens(grpc::ServerContext*, const v1::ListTokensRequest*,
                                            v1::ListTokensResponse* response) {
  const absl::StatusOr<std::vector<AccessToken>> tokens = tokens_.list(AccessTokens::current_time());
  if (!tokens.ok()) return to_grpc(tokens.status());
  for (const AccessToken& token : *tokens) {
    v1::ConsoleToken& listed = *response->add_tokens();
    listed.set_id(token.id);
    listed.set_name(token.name);
    listed.set_role(token.role);
    listed.set_made_by(token.made_by);
    listed.set_expires(time_text(token.expires));
    listed.set_login_count(token.login_count);
  }
  return grpc::Status::OK;
}

grpc::Status ConsoleServiceImpl::RevokeToken(grpc::ServerContext*, const v1::RevokeTokenRequest* request,
                                             v1::RevokeTokenResponse*) {
  GW_CHECK_LIMITS(*request);
  const absl::Status revoked = tokens_.revoke(request->id());
  if (revoked.ok()) spdlog::info("audit console token revoked token={}", request->id());
  return to_grpc(revoked);
}

grpc::Status ConsoleServiceImpl::Announce(grpc::ServerContext*, const v1::AnnounceRequest* request,
                                          v1::AnnounceResponse*) {
  GW_CHECK_LIMITS(*request);
  // It is printed for people to open.
  static const std::regex kUrl(R"(https?://([A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\]):[0-9]{1,5})");
  if (!std::regex_match(request->url(), kUrl)) {
    return to_grpc(absl::InvalidArgumentError(
        fmt::format("url is \"{}\"; it must be http://HOST:PORT or https://HOST:PORT", request->url())));
  }
  {
    const std::lock_guard lock(mutex_);
    if (url_ != request->url()) spdlog::info("audit console announced url={}", request->url());
    url_ = request->url();
    announced_ = std::chrono::steady_clock::now();
  }
  announcement_.notify_all();
  return grpc::Status::OK;
}

grpc::Status ConsoleServiceImpl::LogIn(grpc::ServerContext*, const v1::LogInRequest* request,
                                       v1::LogInResponse* response) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<Login> login = tokens_.log_in(request->token(), AccessTokens::current_time());
  if (!login.ok()) {
    if (!request->locked_out()) spdlog::warn("audit console login refused from={}", request->from());
    return to_grpc(login.status());
  }
  spdlog::info("audit console login caller=\"{}\" from={}", login->principal.title(), request->from());
  response->set_login(login->secret);
  set(*response->mutable_principal(), login->principal);
  return grpc::Status::OK;
}

grpc::Status ConsoleServiceImpl::LogOut(grpc::ServerContext*, const v1::LogOutRequest* request,
                                        v1::LogOutResponse*) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<Principal> principal =
      tokens_.principal_of(request->login(), AccessTokens::current_time());
  if (principal.ok()) spdlog::info("audit console logout caller=\"{}\"", principal->title());
  return to_grpc(tokens_.log_out(request->login()));
}

grpc::Status ConsoleServiceImpl::GetPrincipal(grpc::ServerContext*, const v1::GetPrincipalRequest* request,
                                              v1::GetPrincipalResponse* response) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<Principal> principal =
      tokens_.principal_of(request->login(), AccessTokens::current_time());
  if (principal.ok()) set(*response->mutable_principal(), *principal);
  return to_grpc(principal.status());
}

}  // namespace glasswing
