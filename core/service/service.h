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

// How long a daemon's call to itself may take (ServiceHost::answers).
inline constexpr std::chrono::milliseconds kSelfCall(3000);

// What callers can take of one daemon. Beyond it calls get RESOURCE_EXHAUSTED, and connections are closed.
struct ServiceLimits {
  int message_bytes = 8 << 20;                    // of one that is received
  size_t buffer_bytes = 256 << 20;                // of gRPC's own, for all connections
  int calls = 1024;                               // that are answered at once, streams too: each has a thread
  int calls_of_a_connection = 100;                // more wait
  int descriptors = 4096;                         // open in the process: a connection beyond it is closed
  std::chrono::milliseconds handshake{5000};      // from connecting to the first call that can be made
  std::chrono::milliseconds idle{5 * 60 * 1000};  // a connection without a call for so long is closed
  std::chrono::milliseconds stalled{60 * 1000};   // core/service/stalled_calls.h
};

struct ListenOptions {
  std::string address = "127.0.0.1:0";  // port 0: any free one
  std::string advertised = {};          // host:port that others call; empty: `address`
  bool reflection = false;
  NodeClock clock = {};  // that ClockService tells
  ServiceLimits limits = {};
};

class Listener;

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
  // Whether connections are taken and a call is answered, both as others see it. Blocks up to twice `within`.
  bool answers(std::chrono::milliseconds within) const;
  // For calls to its own services, past TLS and roles.
  std::shared_ptr<grpc::Channel> to_itself() const;
  // Stops listening, gives running calls until `grace` to end, then cancels them.
  void stop(std::chrono::milliseconds grace);

 private:
  ServiceHost() = default;
  std::string address_, advertised_;
  std::unique_ptr<grpc::Service> clock_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<Listener> listener_;
};

}  // namespace glasswing
