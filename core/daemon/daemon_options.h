// Options that several daemons have.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <string>

#include "core/security/tls.h"
#include "core/service/service.h"

namespace glasswing {

// --ca, --certificate and --key, or the environment variables that the client reads too: for use_tls().
void add_tls_options(CLI::App& app, TlsFiles& files);

// --listen, --advertise and --reflection. `listens` completes "host:port ".
void add_listen_options(CLI::App& app, ListenOptions& listen, const std::string& listens = "to listen on");

// INVALID_ARGUMENT: an option that only simulated devices have (--fault-*, --true-*, --clock-*) was given,
// and `backend` is not "sim".
absl::Status check_simulated_options(const CLI::App& app, const std::string& backend);

}  // namespace glasswing
