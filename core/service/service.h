// What every daemon does alike: a gRPC server with health and limits, and an orderly end.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "core/base/node_clock.h"

namespace glasswing {

inline constexpr const char* kVersion = "0.1.0";
inline constexpr size_t kChunkBytes = 1 << 20;  // most bytes in one streamed message

// absl and gRPC codes are equal.
grpc::Status to_grpc(const absl::Status& status);
absl::Status from_grpc(const grpc::Status& status);
// As from_grpc, and an unreachable peer is named: "camera node at 127.0.0.1:7442 does not answer".
absl::Status from_grpc(const grpc::Status& status, const std::string& peer);

// A channel to host:port; every call on it still needs its own deadline.
std::shared_ptr<grpc::Channel> dial(const std::string& address);

// Sets the deadline `timeout` from now.
void set_deadline(grpc::ClientContext& context, std::chrono::milliseconds timeout);

struct ListenOptions {
  std::string address = "127.0.0.1:0";  // port 0: any free one
  std::string advertised = {};          // host:port that others call; empty: `address`
  bool reflection = false;
  NodeClock clock = {};  // that ClockService tells
};

// A listening gRPC server with standard health (SERVING), the ClockService and message limits, and TLS as
// use_tls() says. Borrowed services must outlive it.
class ServiceHost {
 public:
  // INVALID_ARGUMENT: the address is not loopback, and use_tls() got no certificate; or it is every address
  // of this machine, and none is advertised. UNAVAILABLE: it cannot be listened on.
  static absl::StatusOr<std::unique_ptr<ServiceHost>> start(const ListenOptions& options,
                                                            const std::vector<grpc::Service*>& services);
  ~ServiceHost();

  const std::string& address() const { return address_; }        // with the real port
  const std::string& advertised() const { return advertised_; }  // where others call it, likewise
  // Stops listening, gives running calls until `grace` to end, then cancels them.
  void stop(std::chrono::milliseconds grace);

 private:
  ServiceHost() = default;
  std::string address_, advertised_;
  std::unique_ptr<grpc::Service> clock_;
  std::unique_ptr<grpc::Server> server_;
};

// Call first in main, before any thread: from then on SIGINT and SIGTERM wait for wait_for_signal().
void block_signals();
// Returns when one arrives.
void wait_for_signal();

}  // namespace glasswing
