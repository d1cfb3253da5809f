// A session's frames, fetched from a node that holds them, for display.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <functional>
#include <memory>
#include <string>

#include "console/routes/archive_tar.h"
#include "console/routes/server_link.h"
#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

class CapturedFrames {
 public:
  using ChannelTo = std::function<std::shared_ptr<grpc::Channel>(const std::string& address)>;
  // Asks `server` for the node that holds the frames, for the person with this login. UNAVAILABLE: it cannot
  // be reached; NOT_FOUND: no such session, or no frames yet.
  static absl::StatusOr<CapturedFrames> of(const std::string& session, const ServerLink& server,
                                           const Login& login, const ChannelTo& channel_to);

  // A frame's file as captured. `file` is the path in the manifest, "frames/000017.tif".
  absl::StatusOr<std::string> file(const std::string& file) const;
  // A frame as an sRGB JPEG of at most `width_px`, its light times 2^stops. Uncalibrated: codes are taken as
  // light.
  absl::StatusOr<std::string> jpeg(const std::string& file, int width_px, double stops) const;
  // All frames and the manifest. FAILED_PRECONDITION: the session is being captured.
  absl::StatusOr<std::unique_ptr<ArchiveTar>> tar() const;
  // One camera pixel in every frame: {"samples": [{"file": …, "radiance": [r, g, b], "saturated": true}]};
  // null is what the photosite of a mosaic did not measure. Calibrated light, as solvers use it, but without
  // correction of brightness drift, which needs whole frames. OUT_OF_RANGE: no such pixel.
  absl::StatusOr<std::string> samples_json(int x, int y) const;

 private:
  CapturedFrames(const v1::Session& session, std::shared_ptr<grpc::Channel> node);
  absl::StatusOr<v1::CaptureManifest> manifest() const;

  std::string session_, peer_;
  bool capturing_;
  std::shared_ptr<grpc::Channel> node_;
};

}  // namespace glasswing
