// The console's routes that carry data: mattes, frames, samples, photos.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>
#include <httplib.h>

#include <memory>
#include <string>

#include "server/console/access_tokens.h"
#include "server/console/captured_frames.h"
#include "server/console/node_channels.h"

namespace glasswing {

// Each checks the principal's roles, and answers errors by refuse().
class SessionRoutes {
 public:
  SessionRoutes(std::shared_ptr<grpc::Channel> server, NodeChannels& nodes)
      : server_(std::move(server)), nodes_(nodes) {}

  void send_matte(const Principal& principal, const httplib::Request& request,
                  httplib::Response& response) const;
  void send_frame(const Principal& principal, const httplib::Request& request,
                  httplib::Response& response) const;
  void send_samples(const Principal& principal, const httplib::Request& request,
                    httplib::Response& response) const;
  void store_image(const Principal& principal, const std::string& png, httplib::Response& response) const;

 private:
  absl::StatusOr<CapturedFrames> frames_of(const std::string& session) const;

  const std::shared_ptr<grpc::Channel> server_;
  NodeChannels& nodes_;
};

}  // namespace glasswing
