#include "server/console/console_service.h"

#include <fmt/chrono.h>

#include <cmath>

#include "core/service/service.h"

namespace glasswing {

void ConsoleServiceImpl::serve_at(const std::string& url) {
  const std::lock_guard lock(mutex_);
  url_ = url;
}

grpc::Status ConsoleServiceImpl::CreateToken(grpc::ServerContext*, const v1::CreateTokenRequest* request,
                                             v1::CreateTokenResponse* response) {
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
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const std::chrono::sys_seconds expires =
      now + std::chrono::seconds(std::llround(3600.0 * request->valid_hours()));
  const absl::StatusOr<std::string> token = key_.token_of(request->name(), request->role(), expires, now);
  if (!token.ok()) return to_grpc(token.status());
  response->set_token(*token);
  response->set_expires(
      fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::system_clock::to_time_t(expires))));
  return grpc::Status::OK;
}

}  // namespace glasswing
