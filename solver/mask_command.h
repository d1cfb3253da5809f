// `glasswing-solver mask`: finds the object in a photograph, using one without it.
#pragma once

#include "core/daemon/daemon.h"

namespace glasswing {

void add_mask_command(CLI::App& app, DaemonOptions& daemon);

}  // namespace glasswing
