// A listening HTTP server, with TLS where this program has it, and the limits of one that strangers reach.
#pragma once

#include <absl/status/statusor.h>
#include <httplib.h>

#include <memory>
#include <string>
#include <thread>

namespace glasswing {

class HttpHost {
 public:
  // Bound, and not answering yet. INVALID_ARGUMENT: the address is no HOST:PORT, or beyond this machine
  // without TLS. UNAVAILABLE: it cannot be listened on. Port 0: any free one.
  static absl::StatusOr<std::unique_ptr<HttpHost>> bind(const std::string& address);
  ~HttpHost();

  // Where routes are added, before serve().
  httplib::Server& routes() { return *server_; }
  void serve();
  // Returns when all requests are answered: those that last must have been told to end.
  void stop();

  const std::string& address() const { return address_; }  // with the real port
  bool has_tls() const { return has_tls_; }

 private:
  HttpHost() = default;

  std::unique_ptr<httplib::Server> server_;
  std::string address_;
  bool has_tls_ = false;
  std::thread thread_;
};

}  // namespace glasswing
