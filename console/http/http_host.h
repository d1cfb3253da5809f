// A listening HTTP server, with TLS if this program has certificates, and limits against untrusted clients.
#pragma once

#include <absl/status/statusor.h>
#include <httplib.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "console/http/http_server.h"

namespace glasswing {

class HttpHost {
 public:
  // Binds, but does not serve yet. Port 0: any free one. INVALID_ARGUMENT: not HOST:PORT, or an address that
  // other machines reach, without TLS. UNAVAILABLE: cannot listen on it.
  static absl::StatusOr<std::unique_ptr<HttpHost>> bind(const std::string& address,
                                                        const HttpLimits& limits = {});
  ~HttpHost();

  // Before a request's body is read it must say its size, at most `max_bytes` of its path, without an
  // encoding. Absent: there is nothing to post to.
  using BodyLimit = std::function<std::optional<size_t>(const std::string& path)>;
  void limit_bodies(BodyLimit max_bytes);
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

// {"code": "NOT_FOUND", "message": "…"}, and the nearest HTTP status.
std::string json_of(const absl::Status& status);
int http_status(const absl::Status& status);
// Answers a request with an error.
void refuse(httplib::Response& response, const absl::Status& status);

}  // namespace glasswing
