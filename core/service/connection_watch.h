// Drops connections that send much without a call or message coming of it. gRPC 1.51 stores headers that
// never end (CONTINUATION frames), and parses long ones in quadratic time, before any limit of its own
// applies; what TCP received is seen from outside.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

namespace glasswing {

// Thread-safe.
class ConnectionWatch {
 public:
  // A connection is dropped once gRPC has read `max_bytes` of it since a call began on it or a message of a
  // call was received or sent; of the connections of one address the greediest are, once these bytes come to
  // twice as much. What the kernel still holds, as on a busy machine, is not counted. `max_bytes` must exceed
  // the largest message.
  explicit ConnectionWatch(std::int64_t max_bytes);
  ~ConnectionWatch();

  // An accepted connection. It may be closed at any time.
  void add(int fd);
  // A call began, or a message was received or sent, on the connection from `peer`, as gRPC calls it
  // ("ipv4:10.0.0.5:4711").
  void note_progress(const std::string& peer);

 private:
  struct Connection {
    int fd = -1;
    std::uint64_t cookie = 0;  // the kernel's name of the socket, since the number may be used again
    std::int64_t read = 0;     // bytes at the last progress
    bool progressed = true;
  };
  void look();
  void drop(const std::string& peer, std::int64_t bytes);  // mutex_ is held
  void give_back_memory();

  const std::int64_t max_bytes_;
  std::mutex mutex_;
  std::map<std::string, Connection> connections_;  // guarded by mutex_; by peer
  int looks_to_trim_ = 0;                          // of thread_
  std::jthread thread_;
};

// Tells a watch of each call and each message.
class ProgressFactory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit ProgressFactory(std::shared_ptr<ConnectionWatch> watch) : watch_(std::move(watch)) {}
  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override;

 private:
  const std::shared_ptr<ConnectionWatch> watch_;
};

}  // namespace glasswing
