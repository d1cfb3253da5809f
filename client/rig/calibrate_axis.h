// `glasswing calibrate axis`: the axis of a turning stage in the rig's geometry.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

void add_axis_command(CLI::App& calibrate, Client& client);

}  // namespace glasswing
