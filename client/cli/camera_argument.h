// The option --camera of verbs for a session: which of its cameras they concern; and cameras of plans.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/plan.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

void add_view_option(CLI::App& command, std::string& camera);

// --camera of verbs with a plan, once or several times; use_cameras() puts them in the plan, in place of its
// own.
void add_cameras_option(CLI::App& command, std::vector<std::string>& cameras);
void use_cameras(const std::vector<std::string>& cameras, v1::Plan& plan);

// The camera of a plan, or the first of several.
const std::string& first_camera(const v1::Plan& plan);

// The session as the server knows it, or with a camera its view. INVALID_ARGUMENT: it has no such camera; the
// message names those that it has.
absl::StatusOr<v1::Session> session_of(const Client& client, const std::string& session,
                                       const std::string& camera = "");

// The name alone, without a call where no camera is given.
absl::StatusOr<std::string> session_name_of(const Client& client, const std::string& session,
                                            const std::string& camera);

}  // namespace glasswing
