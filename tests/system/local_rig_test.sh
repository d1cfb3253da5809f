#!/bin/bash
# deploy/local-rig waits for the camera's first frame, and says how far the camera is; so does everything else
# meanwhile. With other options than those of a running rig it fails.
source "$(dirname "$0")/rig.sh"
rig=("$root/deploy/local-rig")
trap 'kill $(jobs -p) 2>/dev/null || true; "${rig[@]}" down --data "$work/rig" >/dev/null; rm -rf "$work"' EXIT
says() { grep -Eq -- "$1" "$2"; } # PATTERN FILE
waiting_for() { glasswing show "$1" | matches -E "^waiting +$2"; } # SESSION PATTERN
is_free() { ! glasswing nodes --json | matches '"holder"'; }
up() { "${rig[@]}" up --data "$work/rig" "$@" >"$work/up.out" 2>"$work/up.err"; } # OPTIONS...
differs() { # WORDS OPTIONS...: up refuses these options
  local words=$1
  shift
  up "$@" && fail "accepted: $*"
  grep -qF -- "was started with $words; stop it first" "$work/up.err" || fail "\"$(cat "$work/up.err")\" does not say \"$words\""
}

echo "== a scene that takes minutes"
up --port "$port" --solvers 0 --scene wobble --size 2400x1800 &
coming=$!
scene='simulating the scene[:,] +[0-9]+ %'
until_true 60 says "^$scene" "$work/up.err" || fail "up says nothing: $(cat "$work/up.err")"
glasswing nodes >"$work/nodes"
says "camera-1 +preparing .*$scene; sim 2400x1800" "$work/nodes" || fail "nodes: $(cat "$work/nodes")"
"$bin/glasswing" doctor >"$work/doctor" 2>&1 &
until_true 20 says "warning +camera +camera-1 is not ready: $scene" "$work/doctor" || fail "the doctor: $(cat "$work/doctor")"
kill -TERM $!
wait $! && fail "a doctor that was ended succeeds"
until_true 10 is_free || fail "a doctor that was ended still holds the rig"
echo 'method: "gaussian" monitors { name: "back" } solids { colour: [1, 1, 1] } exposure_ms: 4' >"$work/plan.txtpb"
glasswing capture "$work/plan.txtpb" --session s >/dev/null
until_true 20 waiting_for s "camera node \"camera-1\" is not ready: $scene" || fail "the session: $(glasswing show s)"
glasswing cancel s >/dev/null
[[ $(shown s state) == SESSION_STATE_CANCELLED ]] || fail "s is $(shown s state)"
camera=$(cat "$work/rig/run/camera-1.pid")
kill -TERM "$camera"
is_gone() { [[ ! -d /proc/$camera ]]; }
until_true 10 is_gone || fail "the camera simulates on after SIGTERM"
wait "$coming" && fail "up succeeds without a camera"
"${rig[@]}" down --data "$work/rig" >/dev/null

echo "== up waits for the first frame"
up --port "$port" --solvers 1 --scene wobble --size 192x152 || fail "$(cat "$work/up.err")"
glasswing nodes --json >"$work/nodes"
says '"preparation"' "$work/nodes" && fail "it is up, and not ready: $(cat "$work/nodes")"

echo "== other options are refused"
up --scene wobble --size 192x152 || fail "the same options: $(cat "$work/up.err")"
up || fail "no options: $(cat "$work/up.err")"
differs '--scene wobble, not crystal' --scene crystal --size 192x152
differs '--scene wobble, not none and --solvers 1, not 2' --scene none --solvers 2
differs '--mosaic none, not RGGB' --mosaic RGGB
kill -KILL "$(cat "$work/rig/run/solver-1.pid")"
differs '--size 192x152, not 128x104' --size 128x104
[[ $("${rig[@]}" status --data "$work/rig" 2>/dev/null | grep -c 'is down') == 1 ]] || fail "a refused up starts daemons"
up --scene wobble || fail "what is missing is not started: $(cat "$work/up.err")"
"${rig[@]}" status --data "$work/rig" >/dev/null
"${rig[@]}" down --data "$work/rig" >/dev/null
up --port "$port" --solvers 1 --scene none --size 64x56 || fail "after down: $(cat "$work/up.err")"
echo "all checks passed"
