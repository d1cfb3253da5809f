#include "core/daemon/daemon.h"
#include "core/process/freed_memory.h"
#include "core/service/build_id.h"
#include "display-node/display_daemon.h"
#include "display-node/display_options.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  keep_freed_memory(LargeBlocks::kPictures);
  DisplayOptions display;
  return run_daemon(
      argc, argv,
      {.name = "glasswing-display",
       .description =
           "Glasswing's display node: pixels on screens, and when each picture was really visible.",
       .footer = "Example:\n  glasswing-display --listen 127.0.0.1:7441 --server 127.0.0.1:7440 --monitor "
                 "back=128x96@60\n"
                 "  glasswing-display --backend x11 --monitor back=HDMI-1 --monitor left=DP-2\n"
                 "  glasswing-display --backend kms --monitor back=card0:HDMI-A-1@1920x1080@60",
       .build = build_id(),
       .add_options = [&](CLI::App& app,
                          DaemonOptions& daemon) { add_display_options(app, daemon, display); },
       .run = [&](const CLI::App& app,
                  const DaemonOptions& daemon) { return run_display(app, daemon, display); }});
}
