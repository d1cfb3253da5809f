#!/bin/bash
# The life of sessions beyond capture and solve, with separate processes: dry runs, holds of the rig, notes
# and tags, solves that are paused, cancelled and repeated, and deletion.
source "$(dirname "$0")/rig.sh"
rig=("$root/deploy/local-rig")
trap 'kill -CONT $(jobs -p) 2>/dev/null || true; kill $(jobs -p) 2>/dev/null || true; "${rig[@]}" down --data "$work/rig" >/dev/null; rm -rf "$work"' EXIT

is() { [[ $(shown "$1" state) == SESSION_STATE_$2 ]]; } # SESSION STATE
held() { glasswing nodes --json | matches "\"what\": \"$1\""; } # REASON
is_free() { ! glasswing nodes --json | matches '"holder"'; }
listed() { glasswing sessions "$@" --tsv | tail -n +2 | cut -f 1 | sort | tr '\n' ' '; } # CONDITIONS...

"${rig[@]}" up --data "$work/rig" --port "$port" --solvers 1
plan=$root/deploy/plans/quick.txtpb

echo "== a dry run predicts the real one"
glasswing capture "$plan" --session s --dry-run | tee "$work/dry"
grep -q '^rig  *free' "$work/dry" || fail "the rig is not free"
[[ -z $(listed) ]] || fail "a dry run created a session"
glasswing capture "$plan" --dry-run --json >"$work/dry.json"
glasswing capture "$plan" --session s --watch --note "handle to the left" --tag lab3 --tag vases
[[ $(shown s step_count) == $(field step_count "$work/dry.json") ]] || fail "it has $(shown s step_count) steps"
(( $(shown s archive_bytes) <= $(field bytes "$work/dry.json") )) || fail "it has $(shown s archive_bytes) bytes"
refused 'already' glasswing capture "$plan" --session s --dry-run

echo "== notes and tags survive the server"
kill -KILL "$(cat "$work/rig/run/server.pid")"
"${rig[@]}" up --data "$work/rig" >/dev/null
[[ $(glasswing note s) == "handle to the left" ]] || fail "the note is $(glasswing note s)"
[[ $(glasswing tag s glass --remove vases) == "glass lab3" ]] || fail "the tags are $(glasswing tag s)"
[[ $(listed --tag glass --since 1h) == "s " && -z $(listed --tag vases) && $(listed HANDLE --state captured) == "s " ]] || fail "s is not found"

echo "== the rig has one holder"
"$bin/glasswing" hold --reason "a series" >"$work/hold" 2>/dev/null &
holder=$!
until_true 10 held "a series" || fail "the rig is not held"
refused 'the rig is held for "a series", taken by ' glasswing capture "$plan" --session no
refused 'the rig is held for "a series", taken by ' glasswing doctor
refused 'the rig is held for "a series", taken by ' glasswing hold --reason another
env "$(cat "$work/hold")" "$bin/glasswing" capture "$plan" --session member --watch || fail "the hold refuses its own holder"
kill -KILL "$holder"
wait "$holder" 2>/dev/null || true
until_true 5 is_free || fail "a dead client still holds the rig"
status=0
glasswing hold --reason "another series" -- bash -c "'$bin/glasswing' capture '$plan' --session inner --watch && exit 7" || status=$?
[[ $status == 7 ]] || fail "the command's exit status is $status"
is inner CAPTURED || fail "inner is $(shown inner state)"
# A stopped process behaves like one whose machine vanished: it is silent, and its connection stays open.
"$bin/glasswing" hold --reason "vanished" >/dev/null 2>&1 &
holder=$!
until_true 10 held "vanished" || fail "the rig is not held"
kill -STOP "$holder"
until_true 30 is_free || fail "a vanished client still holds the rig"
kill -KILL "$holder"
wait "$holder" 2>/dev/null || true
glasswing capture "$plan" --session first >/dev/null
refused "the rig is held by session first, started by $(id -un)@$(uname -n)" glasswing capture "$plan" --session second
glasswing cancel first >/dev/null
glasswing capture "$plan" --session second --watch

echo "== a paused solve survives the server, and continues"
glasswing solve s >/dev/null
glasswing pause s
is s PAUSED || fail "s is $(shown s state)"
kill -KILL "$(cat "$work/rig/run/server.pid")"
"${rig[@]}" up --data "$work/rig" >/dev/null
is s PAUSED || fail "s is $(shown s state) after the server was killed"
glasswing resume s >/dev/null
glasswing watch s
glasswing fetch s -o "$work/first.exr"

echo "== the matte stays until another solve is done"
refused 'option "nonsense" is not known to gaussian; it has: modes, ' glasswing solve s --set nonsense=1
is s DONE || fail "s is $(shown s state)"
glasswing solve s --set images=100 >/dev/null
glasswing pause s >/dev/null
glasswing fetch s -o "$work/meanwhile.exr"
cmp "$work/first.exr" "$work/meanwhile.exr" || fail "the matte changed before the solve was done"
glasswing cancel s
is s DONE || fail "s is $(shown s state)"
glasswing fetch s -o "$work/back.exr"
cmp "$work/first.exr" "$work/back.exr" || fail "the cancelled solve changed the matte"
refused 'images is "1"; it must be' glasswing solve s --set images=1 --watch
is s DONE || fail "s is $(shown s state)"
glasswing fetch s -o "$work/kept.exr"
cmp "$work/first.exr" "$work/kept.exr" || fail "the refused solve changed the matte"
glasswing solve s --set modes=1 --watch
glasswing fetch s -o "$work/second.exr"
cmp -s "$work/first.exr" "$work/second.exr" && fail "the second matte equals the first"

echo "== deletion"
refused '--yes' glasswing delete s
kill -KILL "$(cat "$work/rig/run/camera-1.pid")"
refused 'does not answer' glasswing delete s --yes --now
is s DONE || fail "s is $(shown s state)"
"${rig[@]}" up --data "$work/rig" >/dev/null
glasswing capture "$plan" --session busy >/dev/null
refused 'nothing was deleted' glasswing delete s busy --yes
glasswing cancel busy >/dev/null
glasswing delete s member inner first second busy --yes --now
[[ -z $(listed) ]] || fail "left: $(listed)"
left=$(find "$work/rig/camera/archives" "$work/rig/server/mattes" "$work/rig/server/tiles" -mindepth 1 ! -name .writable ! -name .lock)  # these belong to the node
[[ -z $left ]] || fail "left: $left"
echo "all checks passed"
