// The console's routes that carry data: mattes, STMaps, frames, archives, samples, photos.
#pragma once

#include <absl/status/statusor.h>
#include <httplib.h>

#include <mutex>
#include <string>

#include "console/routes/captured_frames.h"
#include "console/routes/node_channels.h"
#include "console/routes/server_link.h"

namespace glasswing {

// Answers errors by refuse(). The server checks each person's role: it hands out mattes, takes photos, and
// says which node has the frames.
class SessionRoutes {
 public:
  SessionRoutes(const ServerLink& server, NodeChannels& nodes) : server_(server), nodes_(nodes) {}

  void send_matte(const Login& login, const httplib::Request& request, httplib::Response& response) const;
  void send_stmap(const Login& login, const httplib::Request& request, httplib::Response& response) const;
  void send_archive(const Login& login, const httplib::Request& request, httplib::Response& response) const;
  void send_frame(const Login& login, const httplib::Request& request, httplib::Response& response) const;
  void send_samples(const Login& login, const httplib::Request& request, httplib::Response& response) const;
  void store_image(const Login& login, const std::string& png, httplib::Response& response) const;

 private:
  absl::StatusOr<CapturedFrames> frames_of(const std::string& session, const Login& login) const;

  const ServerLink& server_;
  NodeChannels& nodes_;
  mutable std::mutex decoding_;  // held while a matte is decoded, which takes memory: one at a time
};

}  // namespace glasswing
