// A session's frames on the node that holds them.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "glasswing/v1/archive_service.grpc.pb.h"

namespace glasswing {

// Thread-safe. UNAVAILABLE: the node is away; DATA_LOSS names a frame that cannot be read. Once `stop` was
// asked for, what waits for the node fails.
class RemoteArchive {
 public:
  RemoteArchive(const std::string& address, std::string session, std::stop_token stop);

  absl::StatusOr<v1::CaptureManifest> manifest() const;
  // Samples of rows of each of these frames, places in manifest.frames, one after another.
  absl::StatusOr<std::vector<std::uint16_t>> rows(const v1::CaptureManifest& manifest,
                                                  const std::vector<int>& frames, int first_row,
                                                  int row_count) const;

 private:
  std::string peer_, session_;
  std::unique_ptr<v1::ArchiveService::Stub> stub_;
  std::stop_token stop_;
};

}  // namespace glasswing
