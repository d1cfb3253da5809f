// The verbs of the certificate authority.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_pki_commands(CLI::App& app, Client& client);  // init, issue, renew, list

}  // namespace glasswing
