#!/bin/bash
# The queue of captures, with separate processes: eight items, one of them impossible, no client, and a server that is killed
# twice. Seven sessions are captured and solved, one item is named, nothing is captured twice.
source "$(dirname "$0")/rig.sh"

start_server() {
  "$bin/glasswing-server" --listen "$server" --data "$work/server" >>"$work/server.log" 2>&1 &
  server_pid=$!
}
kill_server() {
  kill -KILL "$server_pid"
  wait "$server_pid" 2>/dev/null || true
  start_server
}
start_server
"$bin/glasswing-display" --listen "127.0.0.1:$((port + 1))" --server "$server" --name display-1 --backend sim --monitor back=128x104@60 --patch-rows 8 >"$work/display.log" 2>&1 &
"$bin/glasswing-camera" --listen "127.0.0.1:$((port + 2))" --server "$server" --name camera-1 --data "$work/camera" --size 128x104 --tap "127.0.0.1:$((port + 1))" >"$work/camera.log" 2>&1 &
"$bin/glasswing-solver" --server "$server" --name solver-1 --threads 1 >"$work/solver.log" 2>&1 &
until_true 20 up 3 || fail "not all nodes are up: $(glasswing nodes)"
until_true 60 prepared || fail "the camera is not ready"

plan=$root/deploy/plans/quick.txtpb
sed 's/"back"/"nowhere"/' "$plan" >"$work/nowhere.txtpb"
states() { glasswing queue list --all --tsv | awk -F'\t' 'NR > 1 { print $2 }' | sort | uniq -c | xargs; }
item() { glasswing queue show "$1" --json | field "$2"; } # NUMBER NAME

echo "== who may be asked for what"
refused "--session must tell them apart" glasswing queue add "$plan" --session vase --times 2
refused "braces" glasswing queue add "$plan" --session 'vase-{pose}'
refused "--before ITEM, or --last" glasswing queue move 1
refused "ask for the solve too" glasswing queue add "$plan" --background "$root/deploy/pictures/quilt.png"

echo "== eight items, of which one cannot run"
glasswing queue add "$plan" --session 'vase-{item}' --solve --times 3 >"$work/added"
grep -q "the queue is paused" "$work/added" || fail "it does not say that nothing runs: $(cat "$work/added")"
glasswing queue add "$work/nowhere.txtpb" --session impossible --retries 5 >/dev/null
# The queue keeps the pictures, not their paths.
cp "$root/deploy/pictures/quilt.png" "$work/picture.png"
{ cat "$plan" && echo 'photos { file: "picture.png" }'; } >"$work/photo.txtpb"
glasswing queue add "$work/photo.txtpb" --session 'vase-{item}' --solve --times 3 --tag night >/dev/null
glasswing queue duplicate 1 >/dev/null
glasswing queue edit 8 --background "back=$work/picture.png" >/dev/null
rm "$work/picture.png"
glasswing queue move 7 --before 2 >/dev/null
[[ $(glasswing queue list --tsv | awk -F'\t' 'NR > 1 { printf "%s ", $1 }') == "1 7 2 3 4 5 6 8 " ]] || fail "$(glasswing queue list)"
glasswing queue start >/dev/null
began=$SECONDS
for number in 1 2; do
  capturing() { [[ $(item $number state) == QUEUE_ITEM_STATE_RUNNING && $(shown vase-$number proven_count) -ge 5 ]]; }
  until_true 120 capturing || fail "item $number is not captured: $(glasswing queue list --all)"
  kill_server
  until_true 20 glasswing queue list >/dev/null || fail "the server does not answer"
done
ended() { [[ $(states) == "7 done 1 failed" ]]; }
until_true 300 ended || fail "after $((SECONDS - began)) s: $(glasswing queue list --all) $(glasswing queue history)"

echo "== nothing is lost, nothing twice"
[[ $(glasswing queue show 4) == *"(impossible) is failed"*nowhere* ]] || fail "$(glasswing queue show 4)"
[[ $(glasswing sessions --tsv | awk -F'\t' 'NR > 1' | wc -l) == 7 ]] || fail "$(glasswing sessions)"
for number in 1 2 3 5 6 7 8; do
  session=vase-$number
  [[ $(shown "$session" state) == SESSION_STATE_DONE && $(shown "$session" proven_count) == "$(shown "$session" step_count)" ]] || fail "$(glasswing show "$session")"
  (($(glasswing queue history --item $number --tsv | grep -c "captured as session $session") == 1)) || fail "$(glasswing queue history --item $number)"
done
glasswing sessions --tag night --tsv | matches vase-7 || fail "no tags: $(glasswing sessions)"
glasswing queue history --tsv | matches "the queue.*failed: .*nowhere" || fail "$(glasswing queue history)"
[[ $(glasswing show vase-7 --json | grep -c '"file": "xxh3') == 1 ]] || fail "no photo: $(glasswing show vase-7 --json)"

echo "== the composite is the one that composite makes of the fetched matte"
glasswing queue history --item 8 --tsv | matches "composited" || fail "$(glasswing queue history --item 8)"
glasswing fetch vase-8 -o "$work/vase.exr"
glasswing fetch vase-8 --composite -o "$work/composite.exr"
glasswing composite "$work/vase.exr" --background "$root/deploy/pictures/quilt.png" -o "$work/expected.exr"
# The server keeps 16 bits: a sample is off by at most 1/131070, and a pixel sees at most all of its light.
rms=$(glasswing compare "$work/composite.exr" "$work/expected.exr" --json | field rms)
awk -v rms="$rms" 'BEGIN { exit !(rms <= 1 / 131070) }' || fail "the composite differs by $rms"
refused "has no composite" glasswing fetch vase-1 --composite -o "$work/none.exr"

echo "== whose tiles go first"
refused "only one that is being solved has a priority" glasswing priority vase-8 batch
refused "must be a time in the future" glasswing solve vase-8 --deadline 2020-01-01T00:00:00Z
glasswing solve vase-8 --priority interactive --deadline "$(date -d '1 hour' +%FT%T%:z)" >/dev/null
first_solve() { glasswing fleet --tsv | awk -F'\t' '$1 == "vase-8" { print $4 }'; }
[[ $(first_solve) == interactive || $(shown vase-8 state) == SESSION_STATE_DONE ]] || fail "$(glasswing fleet)"
glasswing wait vase-8
echo "all checks passed"
