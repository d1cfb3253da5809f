#!/bin/bash
# Two display nodes with different refresh rates: their steps are synchronised by time.
source "$(dirname "$0")/rig.sh"

"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
display() { # NAME PORT MONITOR
  "$bin/glasswing-display" --listen "127.0.0.1:$2" --server "$server" --name "$1" --patch-rows 8 --monitor "$3" \
    >"$work/$1.log" 2>&1 &
}
# During the 21 s of this session the phase between their refreshes wraps around six times.
display one $((port + 1)) back=96x80@60
display two $((port + 3)) left=72x80@59.7
"$bin/glasswing-camera" --listen "127.0.0.1:$((port + 2))" --server "$server" --name camera-1 --data "$work/camera" \
  --size 72x60 --scene crystal --tap "127.0.0.1:$((port + 1))" --tap "127.0.0.1:$((port + 3))" >"$work/camera.log" 2>&1 &
until_true 20 up 3 || fail "not all nodes came up"
sees_both() { (($(grep -c "light from" "$work/camera.log") == 2)); }
until_true 20 sees_both || fail "the camera does not see both monitors"

sed 's/^monitors .*/monitors { name: "back" } monitors { name: "left" }/; s/^hold_refreshes.*/hold_refreshes: 3/' \
  "$root/deploy/plans/quick.txtpb" >"$work/plan.txtpb"
glasswing capture "$work/plan.txtpb" --session s --watch || fail "not captured"
glasswing show s
glasswing show s --json >"$work/show.json"
in_show() { field "$1" "$work/show.json"; }
(($(in_show proven_count) == $(in_show step_count))) || fail "not every step was proven"
# Three refreshes minus the worst phase leave more than one, in which a camera at 200 frames a second fits an
# exposure.
(($(in_show retaken_count) * 10 <= $(in_show step_count))) || fail "$(in_show retaken_count) steps were shown again"
