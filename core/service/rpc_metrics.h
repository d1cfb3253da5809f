// Counts and times the calls that a server answers.
#pragma once

#include <grpcpp/support/server_interceptor.h>

namespace glasswing {

// For every call, streams too: glasswing_rpcs_total by method and code, glasswing_rpc_seconds and
// glasswing_rpcs_running by method. Messages are not inspected.
class RpcMetricsFactory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override;
};

}  // namespace glasswing
