// Hands a matte that was not solved in tiles to the server, as its session's.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/matte_service.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// Hands over the matte in that file, which the header describes; its checksum is entered.
absl::StatusOr<v1::Session> put_matte(const Client& client, v1::PutMatteRequest header,
                                      const std::filesystem::path& matte);

// Joins the parts in the file `matte`, which is kept. `seconds`: the time that solving took. Errors are those
// of join_parts() and MatteService.PutMatte.
absl::StatusOr<v1::Session> put_parts(const Client& client, const std::string& session,
                                      const std::vector<std::filesystem::path>& parts,
                                      const std::filesystem::path& matte, double seconds);

}  // namespace glasswing
