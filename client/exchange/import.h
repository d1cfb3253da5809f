// Makes sessions of frames that exist.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <string>

#include "client/cli/client.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// A session of that name with the frames of an archive of ours, unchanged. `camera`: the node that stores
// them; empty: the only one. Errors as SessionService.BeginImport's; DATA_LOSS names a damaged file.
absl::StatusOr<v1::Session> import_archive(const Client& client, const std::filesystem::path& directory,
                                           const std::string& session, const std::string& camera);

}  // namespace glasswing
