// Takes the connections of a gRPC server. gRPC's own listener stops for good when it meets the end of the
// file descriptors, and has no limit to connections; this one closes what is too many and goes on.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/server_builder.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/base/descriptor.h"

namespace glasswing {

class Listener {
 public:
  // Listens on all addresses of host:port (port 0: any free one, the same on all), not yet taking anybody.
  // INVALID_ARGUMENT: there is no such host; UNAVAILABLE: it cannot be listened on.
  static absl::StatusOr<std::unique_ptr<Listener>> open(const std::string& address);
  ~Listener();

  int port() const { return port_; }
  // Whether a connection to here is taken, and closed when its maker says no more. Connecting alone shows
  // nothing: the kernel does that without us.
  bool takes_connections(std::chrono::milliseconds within) const;

  using Acceptor = grpc::experimental::ExternalConnectionAcceptor;
  // Hands connections to `acceptor` from now on. One that comes while the process has `max_descriptors` open
  // is closed at once.
  void start(std::unique_ptr<Acceptor> acceptor, int max_descriptors);
  void stop();

 private:
  Listener() = default;
  void take(const Descriptor& listening);
  void turn_away(const Descriptor& listening);

  std::vector<Descriptor> sockets_;
  Descriptor wake_;
  Descriptor spare_;  // given up for a moment to turn somebody away when no descriptor is left
  int port_ = 0;
  int max_descriptors_ = 0;
  bool told_ = false;  // that connections are turned away
  std::unique_ptr<Acceptor> acceptor_;
  std::jthread thread_;
};

}  // namespace glasswing
