// The console: the web page of a rig. It forwards calls to the same services that the command line uses, and
// has no permissions of its own:
//
//   POST /login {"token"}, POST /logout, GET /me     the logged-in principal: {"name", "role", "expires"}
//   POST /api/SERVICE/METHOD                         a call to this server, in protobuf's JSON mapping
//   POST /api/nodes/NODE/SERVICE/METHOD              to a node of the rig
//   POST /plans                                      parses a plan's text; answers the plan in JSON
//   POST /images                                     stores a PNG, for a plan's photos
//   GET  /mattes/SESSION.exr?frame=N&partial=1       a matte's file, by ranges
//   GET  /frames/SESSION/000017.tif                  a frame's file
//   GET  /frames/SESSION/000017.jpg?width=W&stops=S  the same, for display
//   GET  /pixels/SESSION?x=X&y=Y                     a pixel's samples in all frames
//   GET  /...                                        the page
//
// Streaming calls are answered by server-sent events; the last event is "end" with the status.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "server/console/access_tokens.h"
#include "server/console/http_host.h"
#include "server/console/login_limit.h"
#include "server/console/node_channels.h"
#include "server/console/session_routes.h"
#include "server/console/stream_places.h"

namespace glasswing {

struct ConsoleOptions {
  std::string address;          // host:port to listen on; empty: no console
  std::filesystem::path files;  // the page, as built
  std::string name = {};        // host name for url() if `address` is a wildcard
};

class Console {
 public:
  // `server` accepts calls to this server's services for any role: the console itself checks each call
  // against the principal's roles. Errors are those of HttpHost::bind.
  static absl::StatusOr<std::unique_ptr<Console>> start(const ConsoleOptions& options, AccessTokens& tokens,
                                                        std::shared_ptr<grpc::Channel> server);
  ~Console();

  // For people: "https://rig.lab:7480".
  const std::string& url() const { return url_; }

 private:
  using Handler = std::function<void(const Principal&, const httplib::Request&, httplib::Response&)>;
  using BodyHandler = std::function<void(const Principal&, const httplib::Request&, const std::string& body,
                                         httplib::Response&)>;

  Console(AccessTokens& tokens, std::shared_ptr<grpc::Channel> server)
      : tokens_(tokens), server_(std::move(server)), nodes_(server_), sessions_(server_, nodes_) {}
  void add_routes(const std::filesystem::path& files);
  // Wraps a handler so that it serves only known principals, and only requests of our own page.
  httplib::Server::Handler guarded(Handler handler) const;
  // The same, with at most `max_bytes` of body. The body of a refused request is read and dropped; otherwise
  // it would be taken for the connection's next request.
  httplib::Server::HandlerWithContentReader guarded(size_t max_bytes, BodyHandler handler) const;
  // The principal of a request. Errors are those of check_origin and principal_of.
  absl::StatusOr<Principal> authenticate(const httplib::Request& request) const;
  void log_in(const httplib::Request& request, const std::string& body, httplib::Response& response);
  void call(const std::shared_ptr<grpc::Channel>& channel, const std::string& peer,
            const Principal& principal, const httplib::Request& request, const std::string& body,
            httplib::Response& response) const;

  AccessTokens& tokens_;
  const std::shared_ptr<grpc::Channel> server_;
  LoginLimit logins_;
  NodeChannels nodes_;
  const SessionRoutes sessions_;
  mutable StreamPlaces streams_;
  std::unique_ptr<HttpHost> host_;
  std::string url_;
  std::atomic<bool> stopping_ = false;
};

// The directory of the page relative to this program: installed, or in a build directory.
std::filesystem::path default_console_files();

}  // namespace glasswing
