#!/bin/bash
# Sessions through a GigE Vision camera that speaks the protocol on this machine and sees what the monitors
# show: free-running and triggered, with packets lost, and unplugged in the middle. The pixels of every proven
# frame, which time alone proves here, must be those of its step.
source "$(dirname "$0")/rig.sh"
tests=$(cd "$bin/../tests" && pwd)
display=$((port + 1)) camera=$((port + 2)) serial=G$$
camera_pid= gige_pid=
gige() { # OPTIONS...: plugs the camera in
  "$tests/gige_camera" --tap "127.0.0.1:$display" --object "$work/object" --serial "$serial" "$@" >>"$work/gige.log" 2>&1 &
  gige_pid=$!
  until_true 10 grep -q ":0F74 " /proc/net/udp || fail "no camera listens at port 3956"
}
listening() { grep -c "listening on" "$work/camera.log"; }
camera() { # OPTIONS...: starts the camera node
  touch "$work/camera.log"
  local before
  before=$(listening) || true
  "$bin/glasswing-camera" --server "$server" --listen "127.0.0.1:$camera" --metrics "127.0.0.1:$((port + 3))" --data "$work/camera" \
    --backend aravis --device "$serial" --size 96x72 --format Mono8 "$@" >>"$work/camera.log" 2>&1 &
  camera_pid=$!
  # The server may still count the one before as up.
  until_true 40 eval '(($(listening) > before))' && until_true 40 up 2 || fail "no camera"
}
ended() { # PID...
  kill "$@" 2>/dev/null || true
  wait "$@" 2>/dev/null || true
}
metric() { # NAME: its value at the camera node
  exec 9<>"/dev/tcp/127.0.0.1/$((port + 3))" && printf 'GET /metrics HTTP/1.0\r\n\r\n' >&9 && awk -v name="$1" '$1 == name { print $2 + 0 }' <&9
}
asks() { glasswing show "$1" | grep "reason .*$2" >/dev/null; }
session() { # NAME PLAN
  rm -f "$work/object"
  glasswing capture "$2" --session "$1" >/dev/null
  until_true 120 asks "$1" "take the object off" || fail "$1: $(glasswing show "$1")"
  glasswing resume "$1" >/dev/null
  timeout 100 "$bin/glasswing" watch "$1" >/dev/null 2>&1 || true
  asks "$1" "place the object" || fail "$1: $(glasswing show "$1")"
  touch "$work/object"
  glasswing resume "$1" >/dev/null
}
proven() { # NAME
  timeout 100 "$bin/glasswing" watch "$1" >/dev/null 2>&1 || fail "$1: $(glasswing show "$1")"
  [[ $(shown "$1" proven_count) == "$(shown "$1" step_count)" ]] || fail "$1: not every step is proven"
  "$tests/vm.archive_labels" --mono "$work/camera/archives/$1" || fail "$1: a frame is mislabelled"
  awk -v n="$(shown "$1" step_count)" -v s="$(shown "$1" capture_seconds)" -v r="$(shown "$1" retaken_count)" -v what="$1" \
    'BEGIN { printf "%s: %d steps in %.1f s, %.2f steps/s, %d shown again\n", what, n, s, n / s, r }'
}

"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
"$bin/glasswing-display" --server "$server" --listen "127.0.0.1:$display" --monitor back=96x72@60 >"$work/display.log" 2>&1 &
gige
until_true 20 up 1 || fail "no display"

echo "== what is not there is named, with what is"
"$bin/glasswing-camera" --listen "127.0.0.1:$camera" --data "$work/none" --backend aravis --device nothing 2>"$work/stderr" && fail "accepted"
grep -q "\"nothing\", which fits 0 cameras; Aravis sees .*$serial" "$work/stderr" || fail "$(cat "$work/stderr")"
"$bin/glasswing-camera" --listen "127.0.0.1:$camera" --data "$work/none" --backend sim --device "$serial" 2>"$work/stderr" && fail "accepted"
grep -q -- "--device is given with --backend sim; omit it, or use it with --backend aravis" "$work/stderr" || fail "$(cat "$work/stderr")"

echo "== free-running"
camera --fps 25
glasswing plan make --for-rig --quality draft -o "$work/triggered.txtpb" 2>/dev/null
# One scan-out, and one frame and one exposure of whatever phase: 16.7 + 40 + 4 ms, and the bounds of times.
sed 's/^hold_refreshes: .*/hold_refreshes: 5/' "$work/triggered.txtpb" >"$work/free.txtpb"
session free "$work/free.txtpb"
proven free

echo "== triggered: the same steps sooner"
ended "$camera_pid"
camera --fps 25 --trigger software
until_true 20 eval 'glasswing nodes --json | grep "trigger software" >/dev/null' || fail "$(glasswing nodes)"
glasswing plan make --for-rig --quality draft -o "$work/triggered.txtpb" 2>/dev/null
session triggered "$work/triggered.txtpb"
proven triggered
faster() { awk -v f="$(shown free capture_seconds)" -v t="$(shown triggered capture_seconds)" 'BEGIN { printf "%.2f times as fast\n", f / t; exit f / t < 1 }'; }
faster || fail "a trigger makes it no faster"
glasswing doctor >"$work/doctor" || fail "the doctor finds problems: $(cat "$work/doctor")"

echo "== 1 % of the packets lost, and the camera unplugged for a while"
ended "$camera_pid" "$gige_pid"
gige --lost 1
camera --fps 25 --trigger software
session lossy "$work/triggered.txtpb"
some_proven() { (($(shown lossy proven_count) > 10)); }
until_true 60 some_proven || fail "$(glasswing show lossy)"
ended "$gige_pid"
sleep_steps=$(shown lossy proven_count)
until_true 60 eval 'glasswing show lossy | grep "^waiting" >/dev/null' || fail "nothing says that the camera is away: $(glasswing show lossy)"
gige --lost 1
proven lossy
(($(metric glasswing_camera_incomplete_frames_total) > 0)) || fail "no incomplete frame was counted"
echo "incomplete frames $(metric glasswing_camera_incomplete_frames_total), missing packets $(metric glasswing_camera_missing_packets_total); $sleep_steps steps before it was unplugged"
