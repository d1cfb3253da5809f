// `glasswing calibrate geometry`: a camera's lens and the poses of monitors, for `glasswing rays`.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

void add_geometry_command(CLI::App& calibrate, Client& client);

}  // namespace glasswing
