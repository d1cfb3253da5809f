// A client of the node with a session's archive: the camera node that captured it, or a node with a replica.
// Errors are those of archive_service.proto, and name the node.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

class SessionArchive {
 public:
  explicit SessionArchive(const v1::Session& session);
  // A replica.
  SessionArchive(std::string session, const std::string& node, const std::string& address);

  absl::Status check_answers();
  absl::Status seal();
  absl::StatusOr<v1::CaptureManifest> manifest();
  // Deletes the archive; returns how many bytes that freed.
  absl::StatusOr<std::int64_t> remove();

 private:
  const std::string session_, peer_;
  const std::unique_ptr<v1::ArchiveService::Stub> stub_;
};

}  // namespace glasswing
