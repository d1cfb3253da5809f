#!/bin/bash
# A display node raises the line of a GigE Vision camera of our own (tests/camera-node/backends/aravis), which sees
# what the monitors show: the same steps as free-running and by software triggers, in less time, with 12-bit
# packed pixels, chunks, and packets lost and sent again. The pixels of every proven frame must be those of its
# step.
source "$(dirname "$0")/rig.sh"
tests=$(cd "$bin/../tests" && pwd)
display=$((port + 1)) camera=$((port + 2)) serial=W$$
camera_pid= wire_pid= display_pid=
wire() { # OPTIONS...: plugs the camera in
  "$tests/wire_camera" --tap "127.0.0.1:$display" --object "$work/object" --serial "$serial" --line-port "$work/port" --period-ms 40 "$@" >>"$work/wire.log" 2>&1 &
  wire_pid=$!
  until_true 10 test -s "$work/port" || fail "no camera"
}
camera() { # OPTIONS...: starts the camera node
  "$bin/glasswing-camera" --server "$server" --listen "127.0.0.1:$camera" --data "$work/camera" \
    --backend aravis --device "$serial" --size 96x72 --format Mono12p --fps 25 "$@" >>"$work/camera.log" 2>&1 &
  camera_pid=$!
  until_true 40 up 2 || fail "no camera"
}
display() { # OPTIONS...
  "$bin/glasswing-display" --server "$server" --listen "127.0.0.1:$display" --monitor back=96x72@60 "$@" >>"$work/display.log" 2>&1 &
  display_pid=$!
  until_true 20 up 1 || fail "no display"
}
ended() { # PID...
  kill "$@" 2>/dev/null || true
  wait "$@" 2>/dev/null || true
}
asks() { glasswing show "$1" | grep "reason .*$2" >/dev/null; }
session() { # NAME PLAN: all its steps are proven, with the right pixels
  rm -f "$work/object"
  glasswing capture "$2" --session "$1" >/dev/null
  until_true 120 asks "$1" "take the object off" || fail "$1: $(glasswing show "$1")"
  glasswing resume "$1" >/dev/null
  timeout 100 "$bin/glasswing" watch "$1" >/dev/null 2>&1 || true
  asks "$1" "place the object" || fail "$1: $(glasswing show "$1")"
  touch "$work/object"
  glasswing resume "$1" >/dev/null
  timeout 200 "$bin/glasswing" watch "$1" >/dev/null 2>&1 || fail "$1: $(glasswing show "$1")"
  [[ $(shown "$1" proven_count) == "$(shown "$1" step_count)" ]] || fail "$1: not every step is proven"
  "$tests/vm.archive_labels" --mono --bits 12 "$work/camera/archives/$1" || fail "$1: a frame is mislabelled"
  awk -v n="$(shown "$1" step_count)" -v s="$(shown "$1" capture_seconds)" -v r="$(shown "$1" retaken_count)" -v what="$1" \
    'BEGIN { printf "%s: %d steps in %.1f s, %.2f steps/s, %d shown again\n", what, n, s, n / s, r }'
}
times_as_fast() { awk -v f="$(shown "$1" capture_seconds)" -v t="$(shown "$2" capture_seconds)" 'BEGIN { printf "%.2f\n", f / t }'; } # SESSION SESSION

# The program that --line runs: each line of text raises the camera's input.
cat >"$work/raise" <<'END'
#!/bin/bash
exec 3>"/dev/udp/127.0.0.1/$(cat "$1")"
while read -r _; do printf x >&3; done
END
chmod +x "$work/raise"

"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
display
wire --lost 0.1

echo "== free-running"
camera
glasswing plan make --for-rig --quality draft -o "$work/free.txtpb" 2>/dev/null
# One scan-out, and one frame and one exposure of whatever phase: 16.7 + 40 + 4 ms, and the bounds of times.
sed -i 's/^hold_refreshes: .*/hold_refreshes: 5/' "$work/free.txtpb"
session free "$work/free.txtpb"

echo "== software triggers"
ended "$camera_pid"
camera --trigger software
until_true 20 eval 'glasswing nodes --json | grep "trigger software" >/dev/null' || fail "$(glasswing nodes)"
glasswing plan make --for-rig --quality draft -o "$work/triggered.txtpb" 2>/dev/null
session software "$work/triggered.txtpb"
echo "$(times_as_fast free software) times as fast"

echo "== the display raises the line"
ended "$camera_pid" "$display_pid"
display --line "command:$work/raise $work/port"
camera --trigger Line1 --line-delay-ms 2
until_true 20 eval 'glasswing nodes --json | grep "trigger Line1 after 2 ms, 41.5 C" >/dev/null' || fail "$(glasswing nodes)"
session line "$work/triggered.txtpb"
echo "$(times_as_fast free line) times as fast"
awk -v ratio="$(times_as_fast free line)" 'BEGIN { exit ratio < 1 }' || fail "a line makes it no faster"
glasswing doctor >"$work/doctor" || fail "the doctor finds problems: $(cat "$work/doctor")"
grep "triggered by Line1 after 2 ms, which display-1 raises by command:" "$work/doctor" >/dev/null || fail "the doctor does not tell the trigger: $(cat "$work/doctor")"

echo "== a delay that does not fit is refused, with numbers"
ended "$camera_pid"
camera --trigger Line1 --line-delay-ms 70
until_true 20 eval 'glasswing nodes --json | grep "trigger Line1 after 70 ms" >/dev/null' || fail "$(glasswing nodes)"
refused "begins 70 ms after its line rises (--line-delay-ms)" glasswing capture "$work/triggered.txtpb" --dry-run

ended "$wire_pid"
grep "^exposed" "$work/wire.log"
