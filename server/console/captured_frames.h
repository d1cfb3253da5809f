// A session's frames, fetched from a node that holds them, for people's eyes.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <functional>
#include <memory>
#include <string>

namespace glasswing {

class CapturedFrames {
 public:
  using ChannelTo = std::function<std::shared_ptr<grpc::Channel>(const std::string& address)>;
  // `server`: who knows where the frames are. UNAVAILABLE, NOT_FOUND: it does not.
  static absl::StatusOr<CapturedFrames> of(const std::string& session,
                                           const std::shared_ptr<grpc::Channel>& server,
                                           const ChannelTo& channel_to);

  // The frame's file as it was captured. `file`: as in the manifest, "frames/000017.tif".
  absl::StatusOr<std::string> file(const std::string& file) const;
  // The frame as an sRGB JPEG of at most `width_px`, its light times 2^stops. Codes of the camera are taken
  // for light: it is to be looked at.
  absl::StatusOr<std::string> jpeg(const std::string& file, int width_px, double stops) const;
  // Of one camera pixel in every frame: {"samples": [{"file": …, "radiance": [r, g, b], "saturated": true}]}.
  // Light as a solve has it, but for drifts of the monitors' light, which need whole frames. OUT_OF_RANGE:
  // there is no such pixel.
  absl::StatusOr<std::string> samples_json(int x, int y) const;

 private:
  CapturedFrames(std::string session, const std::string& address, std::shared_ptr<grpc::Channel> node);

  std::string session_, peer_;
  std::shared_ptr<grpc::Channel> node_;
};

}  // namespace glasswing
