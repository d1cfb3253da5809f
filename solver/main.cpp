#include "core/archive/fsck_command.h"
#include "core/daemon/daemon.h"
#include "core/process/freed_memory.h"
#include "core/service/build_id.h"
#include "solver/explain_command.h"
#include "solver/frames_command.h"
#include "solver/mask_command.h"
#include "solver/solve_command.h"
#include "solver/solver_daemon.h"
#include "solver/solver_options.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  keep_freed_memory();
  SolverOptions solver;
  return run_daemon(
      argc, argv,
      {.name = "glasswing-solver",
       .description =
           "Glasswing's solver: turns frames into tiles of a matte, as long as the server has any.",
       .footer = "Examples:\n  glasswing-solver --server 127.0.0.1:7440\n"
                 "  glasswing-solver --name live-1 --listen 127.0.0.1:0\n"
                 "  glasswing-solver --name solver-2 --listen 127.0.0.1:0 --archives /srv/glasswing\n"
                 "  glasswing-solver solve out/archives/crystal crystal.exr --set modes=2\n"
                 "  glasswing-solver frames out/archives/crystal\n"
                 "  glasswing-solver mask vase.jpg empty.jpg mask.png",
       .build = build_id(),
       .add_options =
           [&](CLI::App& app, DaemonOptions& daemon) {
             add_solver_options(app, daemon, solver);
             add_solve_command(app, daemon);
             add_frames_command(app, daemon);
             add_explain_command(app, daemon);
             add_mask_command(app, daemon);
             add_fsck_command(app, daemon, "/srv/glasswing --repair");
           },
       .run = [&](const CLI::App&, const DaemonOptions& daemon) { return run_solver(daemon, solver); }});
}
