// ConsoleService: creates the tokens by which browsers log in.
#pragma once

#include "glasswing/v1/console_service.grpc.pb.h"
#include "server/console/console_key.h"

namespace glasswing {

class ConsoleServiceImpl final : public v1::ConsoleService::Service {
 public:
  explicit ConsoleServiceImpl(const ConsoleKey& key) : key_(key) {}
  // Sets the address at which people reach the console; empty, as at first: there is no console.
  void serve_at(const std::string& url);

  grpc::Status CreateToken(grpc::ServerContext*, const v1::CreateTokenRequest*,
                           v1::CreateTokenResponse*) override;

 private:
  const ConsoleKey& key_;
  std::mutex mutex_;
  std::string url_;
};

}  // namespace glasswing
