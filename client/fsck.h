// Declares `glasswing fsck`.
#pragma once

#include <CLI/CLI.hpp>

#include "client/client.h"

namespace glasswing {

void add_fsck_command(CLI::App& app, Client& client);

}  // namespace glasswing
