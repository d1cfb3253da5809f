// A listening HTTP server, with TLS if this program has certificates, and limits against untrusted clients.
#pragma once

#include <absl/status/statusor.h>
#include <httplib.h>

#include <memory>
#include <string>
#include <thread>

namespace glasswing {

class HttpHost {
 public:
  // Binds, but does not serve yet. Port 0: any free one. INVALID_ARGUMENT: not HOST:PORT, or an address that
  // other machines reach, without TLS. UNAVAILABLE: cannot listen on it.
  static absl::StatusOr<std::unique_ptr<HttpHost>> bind(const std::string& address);
  ~HttpHost();

  // Add routes before serve().
  httplib::Server& routes() { return *server_; }
  void serve();
  // Returns when all requests are answered; streaming requests must have been told to end.
  void stop();

  const std::string& address() const { return address_; }  // with the bound port
  bool has_tls() const { return has_tls_; }

 private:
  HttpHost() = default;

  std::unique_ptr<httplib::Server> server_;
  std::string address_;
  bool has_tls_ = false;
  std::thread thread_;
};

// Answers a request with an error.
void refuse(httplib::Response& response, const absl::Status& status);

}  // namespace glasswing
