#!/bin/bash
# A session that is solved while it is captured: drafts can be fetched before the last image, refine, survive
# the death of server, solver and camera node, and change no bit of the finished matte.
source "$(dirname "$0")/rig.sh"
rig=("$root/deploy/local-rig")
trap '"${rig[@]}" down --data "$work/rig" >/dev/null; rm -rf "$work"' EXIT
"${rig[@]}" up --data "$work/rig" --port "$port" --solvers 1
plan=$work/slow.txtpb
sed 's/^hold_refreshes:.*/hold_refreshes: 6/' "$root/deploy/plans/crystal.txtpb" >"$plan"

is() { [[ $(shown "$1" state) == SESSION_STATE_$2 ]]; } # SESSION STATE
images() { shown s image_count; } # of the newest draft
proven() { shown s proven_count; }
proven_at_least() { (($(proven) >= $1)); } # STEPS
no_work() { [[ -n $(glasswing nodes --json | grep '"detail": *"waiting for work"') ]]; }
drafted() { [[ -n $(images) ]]; }
swept() { glasswing show s | matches "^draft .* $1 of 4 sweeps"; } # SWEEPS
# The capture is held back: it takes some more images when the solver has nothing to do, until the command succeeds.
hold_back() { # COMMAND...
  local before
  until "$@"; do
    is s CAPTURING || glasswing resume s >/dev/null
    before=$(proven)
    until_true 60 proven_at_least $((before + 20)) || fail "s is $(shown s state): $(shown s reason)"
    glasswing pause s >/dev/null
    until_true 120 no_work || fail "the solver still works on $(glasswing nodes)"
  done
}

echo "== a draft comes while the session is captured"
glasswing capture "$plan" --session s --solve >/dev/null
refused 'is capturing' glasswing fetch s -o "$work/none.exr"
hold_back drafted
first=$(images)
planned=$(shown s planned_image_count)
echo "the first draft is of $first of $planned images, with $(proven) proven"
((first < planned / 2)) || fail "it is of $first of $planned images"
glasswing resume s >/dev/null
glasswing fetch s -o "$work/draft.exr" --partial | tee "$work/fetched"
grep -q "a draft of [0-9]* of $planned images, 3 of 4 sweeps" "$work/fetched" || fail "it does not say what it is made of"
glasswing show s | matches '^draft  *a draft of' || fail "show does not tell the draft"
refused 'is capturing' glasswing fetch s -o "$work/none.exr" # it is never the finished matte

echo "== server, solver and camera node are killed; the draft stays, and the capture goes on"
for daemon in server solver-1 camera-1; do kill -KILL "$(cat "$work/rig/run/$daemon.pid")"; done
"${rig[@]}" up --data "$work/rig" >/dev/null
(($(images) >= first)) || fail "the draft is gone"
glasswing fetch s -o "$work/again.exr" --partial
hold_back swept 4
glasswing resume s >/dev/null
glasswing watch s 2>"$work/watch" || fail "s is $(shown s state)"
is s DONE || fail "s is $(shown s state)"
grep -q 'a draft of .* images, 4 of 4 sweeps: glasswing fetch s' "$work/watch" || fail "watch told of no draft: $(cat "$work/watch")"
! drafted || fail "a session that is done has a draft"
[[ ! -e $work/rig/server/mattes/s+draft.exr ]] || fail "the draft's file was left"

echo "== the finished matte has the bits of a solve afterwards"
glasswing fetch s -o "$work/finished.exr"
glasswing solve s --watch
glasswing fetch s -o "$work/afterwards.exr"
cmp "$work/finished.exr" "$work/afterwards.exr" || fail "drafts changed the matte"
for picture in draft finished; do
  glasswing composite "$work/$picture.exr" --background "$root/deploy/pictures/quilt.png" -o "$work/$picture.png"
done
glasswing compare "$work/draft.png" "$work/finished.png"
db=$(glasswing compare "$work/draft.png" "$work/finished.png" --json | field psnr_db)
(($(printf '%.0f' "$db") >= 20)) || fail "the draft is $db dB from the finished matte"
