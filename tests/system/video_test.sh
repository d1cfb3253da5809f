#!/bin/bash
# Videos with separate processes, as a user would run them: captured, solved, fetched, exported and imported
# again; solver and server killed during a solve; wrong input; the object placed by hand.
source "$(dirname "$0")/rig.sh"
rig=("$root/deploy/local-rig")
trap '"${rig[@]}" down --data "$work/rig" >/dev/null; kill $(jobs -p) 2>/dev/null || true; wait; rm -rf "$work"' EXIT

solved() { # SESSION: the number of solved frames
  glasswing show "$1" --json | awk '/"solved_frames": \[$/ { inside = 1; next } inside && /\]/ { exit } inside { ++n } END { print n + 0 }'
}
solved_at_least() { (($(solved "$1") >= $2)); }

"${rig[@]}" up --data "$work/rig" --port "$port" --solvers 1 --scene glass
sed 's/frames: 300/frames: 40/; s/levels: 7/levels: 4/' "$root/deploy/plans/video.txtpb" >"$work/plan.txtpb"

echo "== plan check and estimate of a video"
glasswing plan check "$work/plan.txtpb" | matches "a video of 40 frames, 16 frames of the empty stage" || fail "plan check"
glasswing plan estimate "$work/plan.txtpb" | tee "$work/estimate"
grep -q "^video     1.3 s at 30 frames per second" "$work/estimate" || fail "plan estimate"

echo "== from capture to mattes"
glasswing capture "$work/plan.txtpb" --session pour --watch || fail "not captured"
[[ $(shown pour state) == SESSION_STATE_CAPTURED && $(shown pour frame_count) == 40 ]] || fail "pour is no video"
glasswing solve pour --watch || fail "not solved"
glasswing fetch pour -o "$work/pour/" || fail "not fetched"
frames=$(find "$work/pour" -name '[0-9][0-9][0-9][0-9].exr' | wc -l)
lost=$(glasswing show pour --json | awk '/"lost_frames": \[$/ { inside = 1; next } inside && /\]/ { exit } inside { ++n } END { print n + 0 }')
((frames + lost == 40)) || fail "$frames frames were fetched and $lost lost, of 40"

echo "== export, import, and the same mattes again"
glasswing export pour "$work/archive"
glasswing import "$work/archive" --session again
[[ $(shown again frame_count) == 40 && $(shown again method) == ramp ]] || fail "the import is no video"
glasswing solve again --watch
glasswing fetch again -o "$work/again"
for file in "$work"/pour/*.exr; do
  glasswing composite "$file" --background "$root/deploy/pictures/quilt.png" -o "$work/a.exr" >/dev/null
  glasswing composite "$work/again/$(basename "$file")" --background "$root/deploy/pictures/quilt.png" -o "$work/b.exr" >/dev/null
  cmp "$work/a.exr" "$work/b.exr" || fail "the matte $(basename "$file") differs"
done

echo "== solver and server are killed during a solve: solved frames are kept"
glasswing solve pour >/dev/null
until_true 120 solved_at_least pour 1 || fail "nothing is solved"
kill -KILL "$(cat "$work/rig/run/solver-1.pid")"
kill -KILL "$(cat "$work/rig/run/server.pid")"
mattes=$work/rig/server/mattes/pour
(cd "$mattes" && sha256sum ./*.exr) >"$work/solved"
"${rig[@]}" up --data "$work/rig" --port "$port" --solvers 1 >/dev/null
(cd "$mattes" && sha256sum --quiet -c "$work/solved") || fail "solved frames changed"
[[ $(solved pour) -gt 0 ]] || fail "no frame counts as solved any more"
glasswing watch pour || fail "the solve did not continue"
(cd "$mattes" && sha256sum --quiet -c "$work/solved") || fail "solved frames were solved again"
[[ $(solved pour) == "$frames" ]] || fail "$(solved pour) of $frames frames are solved"
rm "$work/pour/0003.exr"
glasswing fetch pour -o "$work/pour/" | matches "$((frames - 1)) were there before" || fail "existing frames were fetched again"
cmp "$work/pour/0003.exr" "$work/again/0003.exr" >/dev/null || [[ -s $work/pour/0003.exr ]] || fail "the missing frame was not fetched"

echo "== wrong input is refused"
refused "is a video of 40 frames" glasswing fetch pour -o "$work/pour.exr"
refused "has no frame 40" glasswing fetch pour --frame 40 -o "$work/40.exr"
glasswing import "$work/archive" --session broken
frame=$(find "$work/rig/camera/archives/broken/frames" -type f | sort | tail -n 1)
printf 'x' | dd of="$frame" bs=1 seek=1000 conv=notrunc status=none
"${rig[@]}" down --data "$work/rig" >/dev/null
"${rig[@]}" up --data "$work/rig" --port "$port" --solvers 1 >/dev/null
refused "$(basename "$frame")" glasswing solve broken --watch
glasswing show broken | matches "^reason .*frame 39" || fail "the reason does not name the frame"
if glasswing fetch broken -o "$work/part" >"$work/part.out" 2>&1; then fail "fetch succeeded although frames are missing"; fi
grep -q "are not solved" "$work/part.out" || fail "fetch does not name the missing frames"
(($(find "$work/part" -name '*.exr' | wc -l) > 0)) || fail "solved frames were not fetched"

echo "== with --stage manual, resume starts the video"
"${rig[@]}" down --data "$work/rig" >/dev/null
"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
"$bin/glasswing-display" --listen "127.0.0.1:$((port + 1))" --server "$server" --name display-1 --patch-rows 8 --monitor back=96x80@60 \
  >"$work/display.log" 2>&1 &
"$bin/glasswing-camera" --listen "127.0.0.1:$((port + 2))" --server "$server" --name camera-1 --data "$work/camera" --stage manual \
  --size 72x60 --scene glass --tap "127.0.0.1:$((port + 1))" >"$work/camera.log" 2>&1 &
until_true 20 up 2 || fail "not all nodes came up"
until_true 20 prepared || fail "the camera is not ready: $(glasswing nodes)"
refused "take the object off the stage, then: glasswing resume hand" glasswing capture "$work/plan.txtpb" --session hand --watch
glasswing resume hand >/dev/null
refused "place the object on the stage; to start the video: glasswing resume hand" glasswing watch hand
(($(shown hand proven_count) == $(shown hand step_count) - 50)) || fail "the empty stage is not complete" # 50: patch learning steps and frames
glasswing resume hand >/dev/null
glasswing watch hand || fail "not captured"
echo "all checks passed"
