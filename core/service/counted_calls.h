// Counts the running calls of each certificate, for the shares that the role gate gives out (call_shares.h).
#pragma once

#include <grpcpp/support/server_interceptor.h>

namespace glasswing {

class CountedCallsFactory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override;
};

}  // namespace glasswing
