// A session's archive as a tar file, unpacked as `glasswing export` writes it: SESSION/frames/..., and then
// SESSION/manifest.json, so that a file that is cut short unpacks to no archive. POSIX ustar, with paths of
// more than 100 bytes in pax headers.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "core/base/checksum.h"
#include "glasswing/v1/archive_service.grpc.pb.h"

namespace glasswing {

class ArchiveTar {
 public:
  // `peer` names the node, for messages. DATA_LOSS: the manifest is invalid.
  static absl::StatusOr<std::unique_ptr<ArchiveTar>> open(std::shared_ptr<grpc::Channel> node,
                                                          const std::string& peer,
                                                          v1::CaptureManifest manifest);
  ~ArchiveTar();

  // The next bytes, at most some MB; empty: the file is complete. DATA_LOSS: a frame came damaged.
  absl::StatusOr<std::string> next();

 private:
  ArchiveTar(std::shared_ptr<grpc::Channel> node, std::string peer, v1::CaptureManifest manifest);
  absl::StatusOr<std::string> begin_frame();
  absl::StatusOr<std::string> end_frame();

  const std::shared_ptr<grpc::Channel> node_;
  const std::string peer_;
  const v1::CaptureManifest manifest_;
  struct Reading;
  std::unique_ptr<Reading> reading_;  // of manifest_.frames(frame_)
  int frame_ = 0;
  bool ended_ = false;
};

}  // namespace glasswing
