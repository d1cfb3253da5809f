// The console: the web page of a rig. It forwards calls to the same services that the command line uses, for
// people whom the server knows by their logins; the console knows nobody, and stores nothing:
//
//   POST /login {"token"}, POST /logout, GET /me     the logged-in principal: {"name", "role", "expires"}
//   POST /api/SERVICE/METHOD                         a call to the server, in protobuf's JSON mapping
//   POST /api/nodes/NODE/SERVICE/METHOD              to a node of the rig: what viewers may call there
//   POST /plans                                      parses a plan's text; answers the plan in JSON
//   POST /images                                     stores a PNG, for a plan's photos
//   POST /imports/SESSION?camera=NODE                begins an import with the archive's manifest.json
//   POST /imports/SESSION/frames                     some of its frames (import_routes.h)
//   POST /geometries                                 parses a geometry's text; answers it in JSON
//   POST /rays?near=SESSION&far=SESSION, /rays.exr   rays of two mattes, by the body's geometry
//   (ray_routes.h) GET  /mattes/SESSION.exr?frame=N&partial=1       a matte's file, by ranges GET
//   /stmaps/SESSION.exr?monitor=M&frame=N       its STMap for a monitor, the first if none is named GET
//   /archives/SESSION.tar                       all frames and the manifest GET  /frames/SESSION/000017.tif
//   a frame's file GET  /frames/SESSION/000017.jpg?width=W&stops=S  the same, for display GET
//   /pixels/SESSION?x=X&y=Y                     a pixel's samples in all frames GET  /... the page
//
// Calls to the server carry the hold (RigService.HoldRig) whose token the header X-Glasswing-Hold names.
// Streaming calls are answered by server-sent events; the last event is "end" with the status. While the
// server does not answer, requests other than for the page are answered 503 with Retry-After.
#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "console/http/http_host.h"
#include "console/http/login_limit.h"
#include "console/routes/import_routes.h"
#include "console/routes/json_call.h"
#include "console/routes/node_channels.h"
#include "console/routes/ray_routes.h"
#include "console/routes/server_link.h"
#include "console/routes/session_routes.h"
#include "console/routes/stream_places.h"

namespace glasswing {

struct ConsoleOptions {
  std::string address = "127.0.0.1:7480";  // host:port to listen on
  std::filesystem::path files = {};        // the page, as built
  std::string advertised = {};             // host:port at which browsers find it; empty: `address`
};

class Console {
 public:
  // Errors are those of HttpHost::bind and check_advertised. The server may be away.
  static absl::StatusOr<std::unique_ptr<Console>> start(const ConsoleOptions& options,
                                                        const ServerLink& server);
  ~Console();

  // For people: "https://rig.lab:7480".
  const std::string& url() const { return url_; }

 private:
  using Handler = std::function<void(const Login&, const httplib::Request&, httplib::Response&)>;
  using BodyHandler =
      std::function<void(const Login&, const httplib::Request&, const std::string& body, httplib::Response&)>;

  explicit Console(const ServerLink& server)
      : server_(server), nodes_(server), sessions_(server, nodes_), imports_(server, nodes_), rays_(server) {}
  // Tells the server where browsers find the console, every second.
  void announce(const std::stop_token& stop) const;
  void add_routes(const std::filesystem::path& files);
  // Plans, images, imports, rays, and what SessionRoutes has.
  void add_data_routes();
  // Wraps a handler so that it serves only people who are logged in, and only requests of our own page.
  httplib::Server::Handler guarded(Handler handler) const;
  // Whether somebody may make a request, before its body is held.
  using Check = std::function<absl::Status(const httplib::Request&, const Principal&)>;
  // The same, with at most `max_bytes` of body. The body of a refused request is read and dropped; otherwise
  // it would be read as the connection's next request.
  httplib::Server::HandlerWithContentReader guarded(size_t max_bytes, Check may, BodyHandler handler) const;
  // Whose a request is. Errors are those of check_origin and ServerLink::principal_of.
  absl::StatusOr<Login> authenticate(const httplib::Request& request) const;
  void log_in(const httplib::Request& request, const std::string& body, httplib::Response& response);
  struct Callee {
    std::shared_ptr<grpc::Channel> channel;
    std::string title;             // for messages
    const Login* login = nullptr;  // of the person for whom the server is called; null: a node
    std::string hold = {};         // as JsonCall's
  };
  // A call to a node, or without one to the server.
  void call(const std::optional<std::string>& node, const Login& login, const httplib::Request& request,
            const std::string& body, httplib::Response& response);
  void stream(const JsonMethod& method, const Callee& callee, const Login& login, const std::string& body,
              httplib::Response& response);

  const ServerLink& server_;
  LoginLimit logins_;
  NodeChannels nodes_;
  const SessionRoutes sessions_;
  const ImportRoutes imports_;
  const RayRoutes rays_;
  StreamPlaces streams_;
  std::unique_ptr<HttpHost> host_;
  std::string url_;
  std::atomic<bool> stopping_ = false;
  std::jthread announcing_;
};

// The directory of the page relative to this program: installed, or in a build directory.
std::filesystem::path default_console_files();

}  // namespace glasswing
