// gRPC as every daemon uses it: a server with health, limits and an orderly end, and channels to other
// daemons.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/node_clock.h"
#include "core/security/login.h"
#include "core/security/roles.h"

namespace glasswing {

inline constexpr size_t kChunkBytes = 1 << 20;  // maximum size of one streamed message

// absl and gRPC codes are equal.
grpc::Status to_grpc(const absl::Status& status);
absl::Status from_grpc(const grpc::Status& status);
// As above, but names a peer that cannot be reached: "camera node at 127.0.0.1:7442 does not answer".
absl::Status from_grpc(const grpc::Status& status, const std::string& peer);

// Ends a call: sets `response`, or returns the error.
template <typename Response>
grpc::Status answer(absl::StatusOr<Response> result, Response& response) {
  if (!result.ok()) return to_grpc(result.status());
  response = *std::move(result);
  return grpc::Status::OK;
}

// A channel to host:port; every call on it still needs its own deadline. `roles`: as for credentials_for().
std::shared_ptr<grpc::Channel> dial(const std::string& address, Roles roles = 0);

// Sets the deadline `timeout` from now.
void set_deadline(grpc::ClientContext& context, std::chrono::milliseconds timeout);

// Timeout of a daemon's call to itself (ServiceHost::answers).
inline constexpr std::chrono::milliseconds kSelfCall(3000);

// What callers may use of one daemon. Calls beyond it fail with RESOURCE_EXHAUSTED; connections are closed.
// With TLS, calls are shared out among certificates (core/security/call_shares.h).
struct ServiceLimits {
  int message_bytes = 8 << 20;                    // of a received message
  size_t buffer_bytes = 256 << 20;                // gRPC's buffers, for all connections together
  int calls = 1024;                               // running at once, streams included: each has a thread
  int calls_of_a_connection = 100;                // running at once; further ones wait
  int descriptors = 4096;                         // open in the process: connections beyond it are closed
  std::chrono::milliseconds handshake{5000};      // from connecting until calls can be made
  std::chrono::milliseconds idle{5 * 60 * 1000};  // a connection without calls is closed after this time
  std::chrono::milliseconds stalled{60 * 1000};   // core/service/stalled_calls.h
};

struct ListenOptions {
  std::string address = "127.0.0.1:0";  // port 0: any free one
  std::string advertised = {};          // host:port at which others call; empty: `address`
  bool reflection = false;
  NodeClock clock = {};  // served by ClockService
  ServiceLimits limits = {};
};

// INVALID_ARGUMENT: `advertised` is not what others can call, or it is empty while `address` is every address
// of this machine.
absl::Status check_advertised(const ListenOptions& options);

class Listener;

// A listening gRPC server with standard health (SERVING), ClockService, LogService and message limits, and
// TLS as use_tls() says. Borrowed services must outlive it.
class ServiceHost {
 public:
  // INVALID_ARGUMENT: the address is not loopback and use_tls() got no certificate, or it is every address of
  // this machine and none is advertised. UNAVAILABLE: the address is in use or not of this machine.
  // `principal_of`: for calls that the console makes for people (core/security/role_gate.h).
  static absl::StatusOr<std::unique_ptr<ServiceHost>> start(const ListenOptions& options,
                                                            const std::vector<grpc::Service*>& services,
                                                            PrincipalOf principal_of = nullptr);
  ~ServiceHost();

  const std::string& address() const { return address_; }        // with the real port
  const std::string& advertised() const { return advertised_; }  // for others, with the real port
  // True if a connection is accepted and a call is answered, as a peer would see it. Blocks for up to twice
  // `within`.
  bool answers(std::chrono::milliseconds within) const;
  // A channel to its own services that bypasses TLS and roles.
  std::shared_ptr<grpc::Channel> to_itself() const;
  // Stops listening, waits up to `grace` for running calls, then cancels them.
  void stop(std::chrono::milliseconds grace);

 private:
  ServiceHost() = default;
  std::string address_, advertised_;
  std::unique_ptr<grpc::Service> clock_, log_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<Listener> listener_;
};

}  // namespace glasswing
