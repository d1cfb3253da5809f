#!/bin/bash
# Two display nodes whose refreshes do not keep together: their steps do, by time.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
bin=${GLASSWING_BIN:-$root/build/release/bin}
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
port=$((20000 + RANDOM % 20000))
server=127.0.0.1:$port
export GLASSWING_SERVER=$server

"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
display() { # NAME PORT MONITOR
  "$bin/glasswing-display" --listen "127.0.0.1:$2" --server "$server" --name "$1" --patch-rows 8 --monitor "$3" \
    >"$work/$1.log" 2>&1 &
}
# Over the 21 s of this session their refreshes slide past each other six times.
display one $((port + 1)) back=96x80@60
display two $((port + 3)) left=72x80@59.7
"$bin/glasswing-camera" --listen "127.0.0.1:$((port + 2))" --server "$server" --name camera-1 --data "$work/camera" \
  --size 72x60 --scene crystal --tap "127.0.0.1:$((port + 1))" --tap "127.0.0.1:$((port + 3))" >"$work/camera.log" 2>&1 &
three_up() { (($("$bin/glasswing" nodes --json | grep -c '"up": true') == 3)); }
until_true 20 three_up || fail "not all nodes came up"
sees_both() { (($(grep -c "light from" "$work/camera.log") == 2)); }
until_true 20 sees_both || fail "the camera does not see both monitors"

sed 's/^monitors .*/monitors { name: "back" } monitors { name: "left" }/; s/^hold_refreshes.*/hold_refreshes: 3/' \
  "$root/deploy/plans/quick.txtpb" >"$work/plan.txtpb"
"$bin/glasswing" capture "$work/plan.txtpb" --session s --watch || fail "not captured"
"$bin/glasswing" show s
"$bin/glasswing" show s --json >"$work/show.json"
field() { sed -n "s/.*\"$1\": \"\{0,1\}\([^\",]*\)\"\{0,1\},\{0,1\}\$/\1/p" "$work/show.json" | head -n 1; }
(($(field proven_count) == $(field step_count))) || fail "not every step was proved"
# Three refreshes less the worst phase leave more than one: a camera of 200 frames a second finds it.
(($(field retaken_count) * 10 <= $(field step_count))) || fail "$(field retaken_count) steps were shown again"
