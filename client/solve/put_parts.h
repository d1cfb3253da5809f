// Hands a matte of separately solved parts to the server, as its session's.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// Joins the parts in the file `matte`, which is kept. `seconds`: the time that solving took. Errors are those
// of join_parts() and MatteService.PutMatte.
absl::StatusOr<v1::Session> put_parts(const Client& client, const std::string& session,
                                      const std::vector<std::filesystem::path>& parts,
                                      const std::filesystem::path& matte, double seconds);

}  // namespace glasswing
