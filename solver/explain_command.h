// `glasswing-solver explain`: one pixel of an archive, from its samples to its modes.
#pragma once

#include "core/daemon/daemon.h"

namespace glasswing {

void add_explain_command(CLI::App& app, DaemonOptions& daemon);

}  // namespace glasswing
