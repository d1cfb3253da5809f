// `glasswing-solver frames`: what a solver finds wrong with an archive's frames.
#pragma once

#include "core/daemon/daemon.h"

namespace glasswing {

void add_frames_command(CLI::App& app, DaemonOptions& daemon);

}  // namespace glasswing
