// Options that daemons share.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "core/security/tls.h"
#include "core/service/service.h"

namespace glasswing {

// --ca, --certificate and --key, else the client's variables: for use_tls().
void add_tls_options(CLI::App& app, TlsFiles& files);

// --listen, --advertise and --reflection. `listens` completes "host:port ".
void add_listen_options(CLI::App& app, ListenOptions& listen, const std::string& listens = "to listen on");

}  // namespace glasswing
