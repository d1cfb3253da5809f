#include "camera-node/camera_daemon.h"
#include "camera-node/camera_options.h"
#include "core/archive/fsck_command.h"
#include "core/daemon/daemon.h"
#include "core/process/freed_memory.h"
#include "core/service/build_id.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  keep_freed_memory(LargeBlocks::kPictures);
  CameraOptions camera;
  return run_daemon(
      argc, argv,
      {.name = "glasswing-camera",
       .description =
           "Glasswing's camera node: exposures, when each really happened, and the frames themselves.",
       .footer = "Example:\n  glasswing-camera --server 127.0.0.1:7440 --data /var/lib/glasswing-camera \\\n"
                 "                   --backend sim --scene crystal --tap 127.0.0.1:7441\n"
                 "  glasswing-camera --data DIR --backend libcamera --format YUYV --size 640x480\n"
                 "  glasswing-camera --data DIR --backend aravis --device 21234567 --trigger software\n"
                 "  glasswing-camera --data DIR --backend replay --archive archives/vase",
       .build = build_id(),
       .add_options =
           [&](CLI::App& app, DaemonOptions& daemon) {
             add_camera_options(app, daemon, camera);
             add_fsck_command(app, daemon, "/var/lib/glasswing-camera --repair");
           },
       .run = [&](const CLI::App& app,
                  const DaemonOptions& daemon) { return run_camera(app, daemon, camera); }});
}
