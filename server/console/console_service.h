// ConsoleService: the tokens with which browsers log in, and their logins.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>

#include "glasswing/v1/console_service.grpc.pb.h"
#include "server/console/access_tokens.h"

namespace glasswing {

class ConsoleServiceImpl final : public v1::ConsoleService::Service {
 public:
  // How long an announcement is valid, and how long CreateToken waits for one: a console announces itself
  // every second, but it or this server may have been started just now.
  static constexpr std::chrono::seconds kAnnounced{10}, kWait{2};

  explicit ConsoleServiceImpl(AccessTokens& tokens) : tokens_(tokens) {}

  grpc::Status CreateToken(grpc::ServerContext*, const v1::CreateTokenRequest*,
                           v1::CreateTokenResponse*) override;
  grpc::Status ListTokens(grpc::ServerContext*, const v1::ListTokensRequest*,
                          v1::ListTokensResponse*) override;
  grpc::Status RevokeToken(grpc::ServerContext*, const v1::RevokeTokenRequest*,
                           v1::RevokeTokenResponse*) override;
  grpc::Status Announce(grpc::ServerContext*, const v1::AnnounceRequest*, v1::AnnounceResponse*) override;
  grpc::Status LogIn(grpc::ServerContext*, const v1::LogInRequest*, v1::LogInResponse*) override;
  grpc::Status LogOut(grpc::ServerContext*, const v1::LogOutRequest*, v1::LogOutResponse*) override;
  grpc::Status GetPrincipal(grpc::ServerContext*, const v1::GetPrincipalRequest*,
                            v1::GetPrincipalResponse*) override;

 private:
  using Time = std::chrono::steady_clock::time_point;

  // The console's address, once it has announced itself. FAILED_PRECONDITION: it has not, or its announcement
  // has expired.
  absl::StatusOr<std::string> console_url();
  // From the caller's certificate, or from the login on whose behalf the console calls.
  absl::StatusOr<AccessTokens::Maker> maker_of(const grpc::ServerContext& context) const;

  AccessTokens& tokens_;
  std::mutex mutex_;
  std::condition_variable announcement_;
  std::string url_;      // guarded by mutex_
  Time announced_ = {};  // guarded by mutex_
};

}  // namespace glasswing
