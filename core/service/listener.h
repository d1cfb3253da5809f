// Accepts the connections of a gRPC server. gRPC's own listener stops for good when the process runs out of
// file descriptors, and has no limit on connections; this one closes excess connections and carries on.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/server_builder.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/file/descriptor.h"
#include "core/service/connection_watch.h"

namespace glasswing {

class Listener {
 public:
  // Listens on all addresses of host:port (port 0: any free one, the same on all), but accepts nothing yet.
  // INVALID_ARGUMENT: there is no such host. UNAVAILABLE: the address is in use or not of this machine.
  static absl::StatusOr<std::unique_ptr<Listener>> open(const std::string& address);
  ~Listener();

  int port() const { return port_; }
  // True if a connection to this listener is accepted, and closed after its peer has shut down writing. A
  // successful connect() alone proves nothing: the kernel completes it without us.
  bool takes_connections(std::chrono::milliseconds within) const;

  using Acceptor = grpc::experimental::ExternalConnectionAcceptor;
  // Hands connections to `acceptor` from now on, and shows them to `watch`. Closes a connection at once if it
  // arrives while the process has `max_descriptors` open.
  void start(std::unique_ptr<Acceptor> acceptor, std::shared_ptr<ConnectionWatch> watch, int max_descriptors);
  void stop();

 private:
  Listener() = default;
  void take(const Descriptor& listening);
  void turn_away(const Descriptor& listening);

  std::vector<Descriptor> sockets_;
  Descriptor wake_;
  Descriptor spare_;  // released for a moment to accept and close a connection when no descriptor is left
  int port_ = 0;
  int max_descriptors_ = 0;
  bool told_ = false;  // it is logged that connections are turned away
  std::unique_ptr<Acceptor> acceptor_;
  std::shared_ptr<ConnectionWatch> watch_;
  std::jthread thread_;
};

}  // namespace glasswing
