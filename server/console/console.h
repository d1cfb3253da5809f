// The console: what a browser shows of a rig. It hands calls of the same services on that the command line
// uses, and has no powers of its own:
//
//   POST /login {"token"}, POST /logout, GET /me     who is there: {"name", "role", "expires"}
//   POST /api/SERVICE/METHOD                         a call to this server, in protobuf's JSON mapping
//   POST /api/nodes/NODE/SERVICE/METHOD              to a node of the rig
//   POST /plans                                      a plan's text; the answer is the plan in JSON
//   POST /images                                     a PNG, for a plan's photos
//   GET  /mattes/SESSION.exr?frame=N&partial=1       a matte's file, by ranges
//   GET  /frames/SESSION/000017.tif                  a frame's file
//   GET  /frames/SESSION/000017.jpg?width=W&stops=S  the same to look at
//   GET  /pixels/SESSION?x=X&y=Y                     a pixel's samples in all frames
//   GET  /...                                        the page
//
// Calls that stream answers are answered by server-sent events, the last of which is "end" with the status.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/console/captured_frames.h"
#include "server/console/console_key.h"
#include "server/console/http_host.h"
#include "server/console/json_call.h"

namespace glasswing {

struct ConsoleOptions {
  std::string address;          // host:port to listen on; empty: nowhere
  std::filesystem::path files;  // the page, as built
  std::string name = {};  // of the host, as others call it, where `address` is every one of this machine
};

class Console {
 public:
  // `server`: for calls to this server's services, whatever the caller's role:
  // the console holds each against the roles. Errors are HttpHost::bind's.
  static absl::StatusOr<std::unique_ptr<Console>> start(const ConsoleOptions& options, const ConsoleKey& key,
                                                        std::shared_ptr<grpc::Channel> server);
  ~Console();

  // For people: "https://rig.lab:7480".
  const std::string& url() const { return url_; }

 private:
  using Handler = std::function<void(const Principal&, const httplib::Request&, httplib::Response&)>;
  using BodyHandler = std::function<void(const Principal&, const httplib::Request&, const std::string& body,
                                         httplib::Response&)>;

  Console(const ConsoleKey& key, std::shared_ptr<grpc::Channel> server)
      : key_(key), server_(std::move(server)) {}
  void add_routes(const std::filesystem::path& files);
  // Of known visitors alone, and from our own page.
  httplib::Server::Handler guarded(Handler handler) const;
  // The same, with at most so many bytes of body. The body of a request that is refused is read all the same,
  // and dropped: what is left in a connection would be taken for its next request.
  httplib::Server::HandlerWithContentReader guarded(size_t max_bytes, BodyHandler handler) const;
  // The principal of a request that may be answered.
  absl::StatusOr<Principal> authenticate(const httplib::Request& request) const;
  void log_in(const httplib::Request& request, const std::string& body, httplib::Response& response) const;
  void call(const std::shared_ptr<grpc::Channel>& channel, const std::string& peer,
            const Principal& principal, const httplib::Request& request, const std::string& body,
            httplib::Response& response) const;
  void send_matte(const Principal& principal, const httplib::Request& request,
                  httplib::Response& response) const;
  void send_frame(const Principal& principal, const httplib::Request& request, httplib::Response& response);
  void send_samples(const Principal& principal, const httplib::Request& request, httplib::Response& response);
  void store_image(const Principal& principal, const std::string& png, httplib::Response& response) const;
  // NOT_FOUND: no node of the rig has this name.
  absl::StatusOr<std::shared_ptr<grpc::Channel>> channel_to(const std::string& node);
  // To HOST:PORT, kept for the next time.
  std::shared_ptr<grpc::Channel> channel_at(const std::string& address);
  absl::StatusOr<CapturedFrames> frames_of(const std::string& session);

  const ConsoleKey& key_;
  const std::shared_ptr<grpc::Channel> server_;
  std::unique_ptr<HttpHost> host_;
  std::string url_;
  std::atomic<bool> stopping_ = false;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<grpc::Channel>> channels_;  // to nodes, by address
};

// Where the page is beside this program: installed, or in a build's directory.
std::filesystem::path default_console_files();

// How a request is refused.
void refuse(httplib::Response& response, const absl::Status& status);

}  // namespace glasswing
