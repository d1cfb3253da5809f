// ConsoleService: the tokens by which browsers log in.
#pragma once

#include "glasswing/v1/console_service.grpc.pb.h"
#include "server/console/access_tokens.h"

namespace glasswing {

class ConsoleServiceImpl final : public v1::ConsoleService::Service {
 public:
  explicit ConsoleServiceImpl(AccessTokens& tokens) : tokens_(tokens) {}
  // Sets the address at which people reach the console; empty, as at first: there is no console.
  void serve_at(const std::string& url);

  grpc::Status CreateToken(grpc::ServerContext*, const v1::CreateTokenRequest*,
                           v1::CreateTokenResponse*) override;
  grpc::Status ListTokens(grpc::ServerContext*, const v1::ListTokensRequest*,
                          v1::ListTokensResponse*) override;
  grpc::Status RevokeToken(grpc::ServerContext*, const v1::RevokeTokenRequest*,
                           v1::RevokeTokenResponse*) override;

 private:
  AccessTokens& tokens_;
  std::mutex mutex_;
  std::string url_;
};

}  // namespace glasswing
