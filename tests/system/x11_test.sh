#!/bin/bash
# A session whose pictures a real X server shows, seen by the simulated camera: every step proved at its rate, and solved.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
bin=${GLASSWING_BIN:-$root/build/release/bin}
command -v Xvfb >/dev/null || { echo "skipped: no Xvfb here"; exit 77; }
work=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true; wait; rm -rf "$work"' EXIT

fail() {
  echo "FAILED: $*" >&2
  tail -n 30 "$work"/*.log >&2 || true
  exit 1
}
until_true() { # SECONDS COMMAND...: asks again until it holds
  local deadline=$((SECONDS + $1))
  until "${@:2}" 2>/dev/null; do
    ((SECONDS < deadline)) || return 1
    sleep 0.05
  done
}
port=$((20000 + RANDOM % 20000)) screen=$((40000 + RANDOM % 20000))
server=127.0.0.1:$port
export GLASSWING_SERVER=$server

Xvfb ":$screen" -screen 0 128x96x24 -nolisten tcp -noreset >"$work/x.log" 2>&1 &
until_true 10 test -S "/tmp/.X11-unix/X$screen" || fail "Xvfb did not start"
"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
"$bin/glasswing-display" --listen "127.0.0.1:$((port + 1))" --server "$server" --backend x11 --x11-server ":$screen" \
  --monitor back=screen >"$work/display.log" 2>&1 &
"$bin/glasswing-camera" --listen "127.0.0.1:$((port + 2))" --server "$server" --name camera-1 --data "$work/camera" \
  --size 96x72 --scene crystal --tap "127.0.0.1:$((port + 1))" >"$work/camera.log" 2>&1 &
"$bin/glasswing-solver" --server "$server" >"$work/solver.log" 2>&1 &
three_up() { (($("$bin/glasswing" nodes --json | grep -c '"up": true') == 3)); }
until_true 20 three_up || fail "not all nodes came up"
until_true 20 grep -q "light from" "$work/camera.log" || fail "the camera sees no light"

"$bin/glasswing" capture "$root/deploy/plans/quick.txtpb" --session x --watch || fail "not captured"
"$bin/glasswing" solve x --watch || fail "not solved"
"$bin/glasswing" show x
"$bin/glasswing" show x --json >"$work/show.json"
grep -q '"proven_count": 205' "$work/show.json" || fail "not every step was proved"
grep -Eq '"object_pixel_count": "?[1-9][0-9]{2,}' "$work/show.json" || fail "the solved matte has no object"
