#include "server/console/console_service.h"

#include <fmt/chrono.h>
#include <spdlog/spdlog.h>

#include <charconv>
#include <cmath>

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

// The caller's certificate, or what the console says of its user. Metadata of other callers can only shorten
// their own tokens.
AccessTokens::Maker maker_of(const grpc::ServerContext& context) {
  AccessTokens::Maker maker{.name = metadata_of(context, "glasswing-client").substr(0, 200)};
  if (const std::optional<CertifiedPeer> peer = peer_of(*context.auth_context())) {
    maker.name = peer->name;
    maker.expires = peer->expires;
  }
  maker.token = metadata_of(context, "glasswing-token");
  const std::string expires = metadata_of(context, "glasswing-expires");
  std::int64_t seconds = 0;
  if (std::from_chars(expires.data(), expires.data() + expires.size(), seconds).ec == std::errc())
    maker.expires = std::min(maker.expires, std::chrono::sys_seconds(std::chrono::seconds(seconds)));
  return maker;
}

}  // namespace

void ConsoleServiceImpl::serve_at(const std::string& url) {
  const std::lock_guard lock(mutex_);
  url_ = url;
}

grpc::Status ConsoleServiceImpl::CreateToken(grpc::ServerContext* context,
                                             const v1::CreateTokenRequest* request,
                                             v1::CreateTokenResponse* response) {
  GW_CHECK_LIMITS(*request);
  {
    const std::lock_guard lock(mutex_);
    response->set_url(url_);
  }
  if (response->url().empty()) {
    return to_grpc(absl::FailedPreconditionError(
        "this server serves no console; start it with --console 127.0.0.1:7480"));
  }
  constexpr double kMaxHours = 24.0 * 365.0;
  if (!(request->valid_hours() > 0.0 && request->valid_hours() <= kMaxHours))
    return to_grpc(absl::InvalidArgumentError("valid_hours must be above 0 and at most 8760"));
  const std::chrono::sys_seconds now = AccessTokens::current_time();
  const std::chrono::sys_seconds expires =
      now + std::chrono::seconds(std::llround(3600.0 * request->valid_hours()));
  const AccessTokens::Maker maker = maker_of(*context);
  const absl::StatusOr<AccessTokens::Made> made =
      tokens_.make(maker, request->name(), request->role(), expires, now);
  if (!made.ok()) return to_grpc(made.status());
  response->set_token(made->secret);
  response->set_id(made->token.id);
  response->set_expires(time_text(made->token.expires));
  spdlog::info("audit console token={} name=\"{}\" role={} expires={} made_by=\"{}\"{}", made->token.id,
               made->token.name, made->token.role, response->expires(), maker.name,
               maker.token.empty() ? "" : " with_token=" + maker.token);
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

}  // namespace glasswing
