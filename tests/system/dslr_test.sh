#!/bin/bash
# The commands of docs/dslr.md, on a stand-in for the tethered camera: PROGRAM is what takes its pictures.
source "$(dirname "$0")/rig.sh"
program=$1
mkdir -p "$work/shots" "$work/data"

echo "== nodes"
"$bin/glasswing-server" --data "$work/data/server" --listen "$server" >"$work/server.log" 2>&1 &
"$bin/glasswing-display" --server "$server" --listen 127.0.0.1:$((port + 1)) --monitor back=96x72@60 --patch-rows 12 --backend sim \
  >"$work/display.log" 2>&1 &
until_true 20 up 1 || fail "no display"
shoot="$program --tap 127.0.0.1:$((port + 1)) --folder {dir} --state $work/state --width 96 --height 72 --exposure-ms 20 --mosaic RGGB"
camera=("$bin/glasswing-camera" --server "$server" --listen 127.0.0.1:$((port + 2)) --data "$work/data/camera" --backend folder
  --folder "$work/shots")
says() { # WORDS COMMAND...: the command fails, and says so
  if "${@:2}" >"$work/said" 2>&1; then fail "accepted: ${*:2}"; fi
  grep -qF -- "$1" "$work/said" || fail "\"$(cat "$work/said")\" does not say \"$1\""
}
says "--backend folder needs --folder" "$bin/glasswing-camera" --server "$server" --data "$work/data/none" --backend folder
says "take one with the settings" "${camera[@]}"
"${camera[@]}" --shoot "$shoot" >"$work/camera.log" 2>&1 &
until_true 30 up 2 || fail "no camera"
glasswing nodes | matches "folder 96x72" || fail "the list of nodes does not say what the camera is"

echo "== doctor, plan, check"
glasswing doctor >"$work/doctor" || true
grep -q "takes a picture when a capture requests one" "$work/doctor" || fail "doctor: $(cat "$work/doctor")"
if grep -q "calibrate sync" "$work/doctor"; then fail "the doctor advises what this camera cannot do: $(cat "$work/doctor")"; fi
glasswing plan make --for-rig --quality draft --images 26 -o "$work/plan.txtpb"
glasswing capture "$work/plan.txtpb" --dry-run >"$work/dry" || fail "the plan does not fit"
grep -q "takes its pictures on demand: each step is held until its picture has arrived" "$work/dry" || fail "dry run: $(cat "$work/dry")"
if grep -q "calibrate sync" "$work/dry"; then fail "the dry run advises what this camera cannot do: $(cat "$work/dry")"; fi
refused "footprints of any shape need all colours of each pixel" glasswing capture "$work/plan.txtpb" --adapt --footprints any --dry-run
refused "raw files are linear, so that mattes need no calibration of the camera" glasswing calibrate camera

echo "== capture"
# A person takes the object off the stage, and places it.
refused "take the object off the stage" glasswing capture "$work/plan.txtpb" --session vase --watch
glasswing resume vase
refused "place the object on the stage" glasswing watch vase
glasswing resume vase
glasswing watch vase || fail "not captured"
[[ $(shown vase state) == SESSION_STATE_CAPTURED ]] || fail "vase is $(shown vase state): $(shown vase reason)"
[[ $(shown vase patch_proven_count) == $(shown vase step_count) ]] || fail "not all steps are proven by pixels"
glasswing export vase "$work/vase"
grep -q '"mosaic": *"RGGB"' "$work/vase/manifest.json" || fail "the archive lacks the mosaic"

echo "== preview"
glasswing preview -o "$work/live.jpg" --count 1 >"$work/preview" &
preview=$!
until_true 20 eval '$program --tap 127.0.0.1:$((port + 1)) --folder "$work/shots" --state "$work/state" --width 96 --height 72 --exposure-ms 20 --mosaic RGGB; ! kill -0 $preview' ||
  fail "no preview"
[[ -s $work/live.jpg ]] || fail "the preview is empty"

echo "== raw files, imported"
mkdir "$work/raw"
files=("$work"/shots/*.dng)
cp "${files[0]}" "$work/raw/a.dng"
cp "${files[1]}" "$work/raw/b.dng"
printf '#monitor back:96x72\nfile\tobject\tkind\tcolour\na.dng\tfalse\tsolid\t0,0,0\nb.dng\ttrue\tsolid\t1,1,1\n' >"$work/raw/list.tsv"
glasswing import "$work/raw" --list "$work/raw/list.tsv" --archive "$work/imported"
grep -q '"exposure_ms": *20' "$work/imported/manifest.json" || fail "the exposure is not imported"
