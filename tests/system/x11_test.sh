#!/bin/bash
# A session shown by a real X server and seen by the simulated camera: every step is proven, and the session
# is solved.
source "$(dirname "$0")/rig.sh"
screen=$((40000 + RANDOM % 20000))

Xvfb ":$screen" -screen 0 128x96x24 -nolisten tcp -noreset >"$work/x.log" 2>&1 &
until_true 10 test -S "/tmp/.X11-unix/X$screen" || fail "Xvfb did not start"
"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
"$bin/glasswing-display" --listen "127.0.0.1:$((port + 1))" --server "$server" --backend x11 --x11-server ":$screen" \
  --monitor back=screen >"$work/display.log" 2>&1 &
"$bin/glasswing-camera" --listen "127.0.0.1:$((port + 2))" --server "$server" --name camera-1 --data "$work/camera" \
  --size 96x72 --scene crystal --tap "127.0.0.1:$((port + 1))" >"$work/camera.log" 2>&1 &
"$bin/glasswing-solver" --server "$server" >"$work/solver.log" 2>&1 &
until_true 20 up 3 || fail "not all nodes came up"
until_true 20 prepared || fail "the camera is not ready: $(glasswing nodes)"

glasswing capture "$root/deploy/plans/quick.txtpb" --session x --watch || fail "not captured"
glasswing solve x --watch || fail "not solved"
glasswing show x
glasswing show x --json >"$work/show.json"
grep -q '"proven_count": 205' "$work/show.json" || fail "not every step was proven"
grep -Eq '"object_pixel_count": "?[1-9][0-9]{2,}' "$work/show.json" || fail "the solved matte has no object"
