#!/bin/bash
# A whole session with separate processes, as a user would run it: plan, capture, solve, fetch, composite,
# export, import; then with each daemon killed in the middle; then with wrong input.
source "$(dirname "$0")/rig.sh"
rig=("$root/deploy/local-rig")
trap '"${rig[@]}" down --data "$work/rig" >/dev/null; rm -rf "$work"' EXIT

proven_at_least() { (($(shown "$1" proven_count) >= $2)); }

"${rig[@]}" up --data "$work/rig" --port "$port" --solvers 2
plan=$root/deploy/plans/quick.txtpb

echo "== a session from plan to composite"
glasswing capture "$plan" --session s --watch
[[ $(shown s state) == SESSION_STATE_CAPTURED ]] || fail "s is $(shown s state)"
steps=$(shown s step_count)
awk -v s="$(shown s capture_seconds)" -v n="$steps" 'BEGIN { printf "%d steps in %.2f s: %.2f of the limit\n", n, s, s * 30 / n }'
outcomes() { glasswing steps "$1" | awk -v what="$2" 'index($0, what)' | wc -l; } # SESSION WHAT
[[ $(outcomes s ": frames/") == "$steps" ]] || fail "steps lists $(outcomes s ": frames/") proofs"
[[ $(outcomes s " shown") == $((steps + $(shown s retaken_count))) ]] || fail "steps lists $(outcomes s " shown") presentations"
glasswing solve s --watch
glasswing fetch s -o "$work/s.exr"
glasswing composite "$work/s.exr" --background "$root/deploy/pictures/quilt.png" -o "$work/s.png"
(($(shown s object_pixel_count) > 1000)) || fail "the crystal covers $(shown s object_pixel_count) pixels"

echo "== export, import, and the same matte again"
glasswing export s "$work/s"
[[ $(find "$work/s/frames" -type f | wc -l) == "$steps" ]] || fail "not every step was exported"
glasswing import "$work/s" --session t
glasswing solve t --watch
glasswing fetch t -o "$work/t.exr"
for m in s t; do glasswing composite "$work/$m.exr" --background "$root/deploy/pictures/quilt.png" -o "$work/$m.exr.out.exr"; done
cmp "$work/s.exr.out.exr" "$work/t.exr.out.exr" || fail "the matte of the imported frames differs"

echo "== every daemon is killed during a capture, and restarted"
for daemon in camera-1 display-1 server; do
  s=killed-$daemon
  glasswing capture "$plan" --session "$s" >/dev/null
  until_true 30 proven_at_least "$s" 20 || fail "no step of $s was proven"
  glasswing pause "$s" >/dev/null
  frames=$work/rig/camera/archives/$s/frames
  (cd "$frames" && sha256sum ./*.tif) >"$work/proven"
  glasswing resume "$s" >/dev/null
  until_true 30 proven_at_least "$s" $(($(wc -l <"$work/proven") + 10)) || fail "$s did not continue"
  kill -KILL "$(cat "$work/rig/run/$daemon.pid")"
  "${rig[@]}" up --data "$work/rig" >/dev/null
  glasswing resume "$s" >/dev/null || [[ $(shown "$s" state) == SESSION_STATE_CAPTURED ]] || fail "$s is $(shown "$s" state)"
  glasswing watch "$s" || fail "$s did not finish after its $daemon was killed"
  [[ $(shown "$s" proven_count) == "$steps" ]] || fail "$s has $(shown "$s" proven_count) of $steps steps"
  (cd "$frames" && sha256sum --quiet -c "$work/proven") || fail "$s captured proven steps again"
done

echo "== wrong input is refused in one line, and does no harm"
refused 'there is no session "nobody"' glasswing show nobody
refused 'does not answer' glasswing sessions --server 127.0.0.1:1
refused 'session "s" already' glasswing capture "$plan" --session s
printf 'method: "gaussian"\nsweeps { sigma_px: -1 }\n' >"$work/bad.txtpb"
refused "$work/bad.txtpb:2: sigma_px is -1; it must be in (0, 200]" glasswing plan check "$work/bad.txtpb"
frame=$(find "$work/s/frames" -type f | sort | sed -n 5p)
cp "$frame" "$work/good"
printf 'x' | dd of="$frame" bs=1 seek=1000 conv=notrunc status=none
refused "$(basename "$frame")" glasswing import "$work/s" --session flipped
truncate -s 500 "$frame"
refused "$(basename "$frame")" glasswing import "$work/s" --session short
rm "$frame"
refused "$(basename "$frame")" glasswing import "$work/s" --session missing
cp "$work/good" "$frame"
glasswing import "$work/s" --session flipped
spooled=$(find "$work/rig/camera/archives/killed-server/frames" -type f | sort | tail -n 1)
cp "$spooled" "$work/whole"
printf 'x' | dd of="$spooled" bs=1 seek=1000 conv=notrunc status=none
"${rig[@]}" down --data "$work/rig" >/dev/null
"${rig[@]}" up --data "$work/rig" --port "$port" --solvers 2 >/dev/null
refused "$(basename "$spooled")" glasswing solve killed-server --watch
[[ $(shown killed-server state) == SESSION_STATE_FAILED ]] || fail "it is $(shown killed-server state)"
cp "$work/whole" "$spooled"
glasswing retry killed-server --watch || fail "the solve was not retried"
[[ $(shown killed-server state) == SESSION_STATE_DONE ]] || fail "it is $(shown killed-server state)"
glasswing fetch s -o "$work/again.exr"
cmp "$work/s.exr" "$work/again.exr" || fail "the matte changed"
echo "all checks passed"
