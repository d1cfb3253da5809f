// Mattes from the server, for people.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "console/routes/server_link.h"
#include "core/file/mapped_file.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {

struct FetchedMatte {
  std::shared_ptr<const MappedFile> file;
  std::string checksum;
};
// The matte's file, which is never whole in memory, and leaves no file. Errors are those of
// SessionService.FetchMatte, and the file system's.
absl::StatusOr<FetchedMatte> fetch_matte(const ServerLink& server, const Login& login,
                                         const v1::FetchMatteRequest& request);

}  // namespace glasswing
