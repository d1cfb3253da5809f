// httplib's server, with the limits that it lacks: on connections, on the bytes and lines before a request's
// body, and on the time of each part of a request.
#pragma once

#include <httplib.h>

#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <string>

#include "console/http/http_connection.h"

namespace glasswing {

struct HttpLimits {
  size_t threads = 64;                    // connections that are served at once; further ones wait
  size_t waiting = 128;                   // connections; further ones are closed
  size_t connections_of_an_address = 32;  // further ones are closed; loopback, where a proxy may be, has all
  size_t head_bytes = 32 << 10;           // request line and headers
  size_t head_lines = 100;
  std::chrono::milliseconds handshake{5000};
  std::chrono::milliseconds idle{15000};  // of a connection between requests, unless others wait
  std::chrono::milliseconds head{10000};  // to receive the head
  std::chrono::milliseconds body{300'000};
  std::chrono::milliseconds stalled{30000};  // without a byte of a body or an answer
};

class HttpServer final : public httplib::Server {
 public:
  // `tls`: null for plain HTTP; owned.
  HttpServer(const HttpLimits& limits, SSL_CTX* tls);
  ~HttpServer() override;

 private:
  bool process_and_close_socket(socket_t socket) override;
  void serve(HttpConnection& connection);
  // False: the address has too many connections.
  bool take_place(const std::string& address);
  void leave_place(const std::string& address);

  const HttpLimits limits_;
  SSL_CTX* const tls_;
  std::atomic<size_t> waiting_ = 0;  // for a thread
  std::mutex mutex_;
  std::map<std::string, size_t> connections_;  // by address; guarded by mutex_
};

}  // namespace glasswing
