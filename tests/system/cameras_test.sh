#!/bin/bash
# Two camera nodes in one session with separate processes: captured together, with every daemon killed, solved side by
# side, fetched, exported, replicated and deleted.
source "$(dirname "$0")/rig.sh"

server_up() {
  "$bin/glasswing-server" --listen "$server" --data "$work/server" >>"$work/server.log" 2>&1 &
  server_pid=$!
}
display_up() {
  "$bin/glasswing-display" --listen "127.0.0.1:$((port + 1))" --server "$server" --name display-1 --patch-rows 8 \
    --monitor back=96x80@60 >>"$work/display.log" 2>&1 &
  display_pid=$!
}
camera_up() { # NAME PORT OPTION...: sets pid_NAME
  "$bin/glasswing-camera" --listen "127.0.0.1:$2" --server "$server" --name "$1" --data "$work/$1" --size 72x60 \
    --scene crystal --tap "127.0.0.1:$((port + 1))" "${@:3}" >>"$work/$1.log" 2>&1 &
  printf -v "pid_$1" %s $!
}
left_up() { camera_up left $((port + 2)) --axis lift=0:20mm --axis-command 'true {position}'; }
right_up() { camera_up right $((port + 3)) --seed 2 --blur 0.5 --fault-drop 0.1; }
server_up
display_up
left_up
right_up
"$bin/glasswing-solver" --server "$server" --name solver-1 >"$work/solver.log" 2>&1 &
until_true 30 up 4 || fail "not all nodes came up"
until_true 60 prepared || fail "a camera is not ready"
plan=$root/deploy/plans/quick.txtpb
(grep -v '^camera' "$plan"; printf 'cameras: "left"\ncameras: "right"\n') >"$work/plan.txtpb"

echo "== every daemon is killed during one capture, and restarted"
kept() { (cd "$1" && { cat frames.jsonl manifest.json 2>/dev/null || true; } | grep -o 'frames/[0-9]*\.tif' | xargs sha256sum); } # ARCHIVE: sums of frames that it lists
proven() { glasswing show "$1" --json | field proven_count; }
glasswing capture "$work/plan.txtpb" --session vase >/dev/null
proven_at_least() { (($(proven vase) >= $1)); }
wanted=10
for daemon in left right display server; do
  until_true 60 proven_at_least $wanted || fail "no step was proven before $daemon was killed"
  glasswing pause vase >/dev/null
  for camera in left right; do kept "$work/$camera/archives/vase.$camera" >"$work/$camera.sums"; done
  glasswing resume vase >/dev/null
  wanted=$(($(proven vase) + 5))
  until_true 60 proven_at_least $wanted || fail "it did not continue"
  pid=pid_$daemon
  [[ $daemon == display ]] && pid=display_pid
  [[ $daemon == server ]] && pid=server_pid
  kill -KILL "${!pid}"
  wait "${!pid}" 2>/dev/null || true
  "${daemon}_up"
  until_true 30 up 4 || fail "$daemon did not come back"
  glasswing resume vase >/dev/null 2>&1 || [[ $(shown vase state) == SESSION_STATE_CAPTURED ]] || fail "vase is $(shown vase state)"
  for camera in left right; do
    (cd "$work/$camera/archives/vase.$camera" && sha256sum --quiet -c "$work/$camera.sums") || fail "$camera took frames twice"
  done
  wanted=$(($(proven vase) + 5))
done
glasswing watch vase || fail "vase was not captured"
for session in vase vase.left vase.right; do
  [[ $(shown $session state) == SESSION_STATE_CAPTURED ]] || fail "$session is $(shown $session state)"
  [[ $(proven $session) == $(shown $session step_count) ]] || fail "$session has $(proven $session) steps"
done
[[ $(glasswing sessions --json | grep -c '"name": "vase"') == 1 ]] || fail "the session is not listed once"

echo "== a solve and a matte each, equal to those of an archive alone"
glasswing solve vase --watch
glasswing fetch vase -o "$work/vase.exr"
[[ -s $work/vase.left.exr && -s $work/vase.right.exr ]] || fail "not one matte for each camera"
cmp -s "$work/vase.left.exr" "$work/vase.right.exr" && fail "both cameras have the same matte"
glasswing fetch vase --camera right -o "$work/right.exr"
cmp "$work/right.exr" "$work/vase.right.exr" || fail "--camera chose another"
glasswing export vase "$work/exported"
composited() { glasswing composite "$1" --background "$root/deploy/pictures/quilt.png" -o "$1.out.exr" >/dev/null; }
for camera in left right; do
  glasswing import "$work/exported/$camera" --camera "$camera" --session "alone-$camera"
  glasswing solve "alone-$camera" --watch
  glasswing fetch "alone-$camera" -o "$work/alone-$camera.exr"
  composited "$work/alone-$camera.exr"
  composited "$work/vase.$camera.exr"
  cmp "$work/alone-$camera.exr.out.exr" "$work/vase.$camera.exr.out.exr" || fail "the matte of $camera differs alone"
done

echo "== an adaptive capture shows every camera the same rounds, after a draft of each; the server is killed meanwhile"
glasswing capture "$root/deploy/plans/design-30.txtpb" --adapt --target-error 70dB --at-most 42 --camera left --camera right \
  --session deep >/dev/null
judged() { glasswing show deep --json | matches '"image_count"'; }
until_true 60 judged || fail "no draft of deep was judged"
kill -KILL "$server_pid"
wait "$server_pid" 2>/dev/null || true
server_up
until_true 30 up 4 || fail "the server did not come back"
glasswing resume deep >/dev/null
glasswing watch deep 2>"$work/watch" || fail "deep is $(shown deep state): $(shown deep reason)"
[[ $(shown deep state) == SESSION_STATE_DONE ]] || fail "deep is $(shown deep state): $(shown deep reason)"
for session in deep deep.left deep.right; do
  images=$(glasswing show $session --json | sed -n 's/.*"image_count": \([0-9]*\).*/\1/p' | head -n 2 | tr '\n' ' ')
  [[ $images == "30 42 " ]] || fail "$session was judged after $images images"
done
grep -q 'after 42 images [0-9]* % of the pixels' "$work/watch" || fail "watch does not tell the rounds: $(cat "$work/watch")"
glasswing export deep "$work/deep" >/dev/null
for camera in left right; do
  python3 - "$work/deep/$camera/manifest.json" >"$work/$camera.rounds" <<'E'
import json, sys
manifest = json.load(open(sys.argv[1]))
print(json.dumps(manifest["plan"]["rounds"], sort_keys=True))
print(sorted(frame.get("step", 0) for frame in manifest["frames"]))
E
done
cmp "$work/left.rounds" "$work/right.rounds" || fail "the cameras were shown different rounds"

echo "== a lift's poses are captured; an axis that does not turn is not calibrated as if it did"
glasswing capture "$plan" --turn lift=0,10 --camera left --session lift 2>/dev/null || fail "the lift's series was not captured"
echo 'camera { width_px: 72 height_px: 60 fx_px: 90 fy_px: 90 cx_px: 36 cy_px: 30 }
monitors { name: "back" width_px: 96 height_px: 72 pitch_mm: 1 rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] translation_mm: [-48, -40, 120] }' >"$work/rig.txtpb"
refused 'axis "lift" moves along a line, in mm' \
  glasswing calibrate axis --series lift --board 7x5:8:6 --geometry "$work/rig.txtpb" -o "$work/axis.txtpb"

echo "== doctor checks each camera's geometry in its own view"
glasswing doctor --camera left --camera right --geometry "left=$work/rig.txtpb" --geometry "right=$work/rig.txtpb" --session vase >"$work/doctor" 2>&1 || true
for camera in left right; do
  grep -q "session vase.$camera sees its points" "$work/doctor" || fail "doctor did not check camera $camera: $(cat "$work/doctor")"
done
# The newest session of each, whose waves leave no known places beside the crystal.
refused 'in session "deep.right"' glasswing doctor --geometry "right=$work/rig.txtpb" --geometry "left=$work/rig.txtpb"
refused 'where it is repeated it must be CAMERA=FILE' glasswing doctor --geometry "$work/rig.txtpb" --geometry "right=$work/rig.txtpb"

echo "== the other verbs know the cameras"
glasswing show vase | matches '^cameras .*left: ' || fail "show does not list the cameras"
glasswing steps vase --camera right | matches 'proven' || fail "no steps of camera right"
refused 'vase.left, vase.right' glasswing steps vase
refused 'has these: left, right' glasswing fetch vase --camera top -o "$work/top.exr"
refused 'name a camera: --camera left' glasswing fetch vase -o -
refused '"vase" already exists' glasswing capture "$work/plan.txtpb" --session vase
refused 'the rig has 2 cameras' glasswing capture "$plan" --session other
glasswing replicate vase left
[[ -d $work/left/archives/vase.right ]] || fail "camera right's frames were not copied to the node of left"
glasswing delete vase --camera right --yes --now
[[ ! -e $work/right/archives/vase.right && ! -e $work/left/archives/vase.right ]] || fail "frames of vase.right are left"
[[ $(shown vase state) == SESSION_STATE_DONE ]] || fail "vase is $(shown vase state) without camera right"
glasswing delete vase --yes
refused 'is in the trash' glasswing show vase
glasswing undelete vase
[[ $(shown vase state) == SESSION_STATE_DONE ]] || fail "vase is $(shown vase state) after undelete"
glasswing delete vase --yes --now
refused 'there is no session "vase"' glasswing show vase
echo "all checks passed"
