// Archives that browsers send: how they become sessions.
#pragma once

#include <httplib.h>

#include <string>

#include "console/routes/node_channels.h"
#include "console/routes/server_link.h"

namespace glasswing {

// Answers errors by refuse(). An import is SessionService's: begun here with the archive's manifest, filled
// with frames, and finished by a call of FinishImport. Frames pass through to the node that takes them; no
// whole frame is held.
class ImportRoutes {
 public:
  static constexpr size_t kMaxManifest = size_t{32} << 20;  // bytes
  static constexpr size_t kMaxFrames = size_t{1} << 30;     // bytes of one request
  static constexpr const char* kTokenHeader = "X-Glasswing-Import";

  ImportRoutes(const ServerLink& server, NodeChannels& nodes) : server_(server), nodes_(nodes) {}

  // `manifest` is manifest.json as Glasswing writes it. Answers a BeginImportResponse.
  void begin(const Login& login, const httplib::Request& request, const std::string& manifest,
             httplib::Response& response) const;
  // The body has, for each frame, its record of the manifest as one line of JSON, and then its file, of the
  // record's size. All frames of a request are durable once it is answered; after an error they can be sent
  // again.
  void put_frames(const Login& login, const httplib::Request& request, const httplib::ContentReader& content,
                  httplib::Response& response) const;

 private:
  const ServerLink& server_;
  NodeChannels& nodes_;
};

}  // namespace glasswing
