#!/bin/bash
# The server's hook and `glasswing wait`, with separate processes: a capture is knocked, paused, finished and solved, the
# server is killed and started again, and people are told of each just once.
source "$(dirname "$0")/rig.sh"
trap 'kill $(jobs -p) 2>/dev/null || true; wait; rm -rf "$work"' EXIT

cat >"$work/hook" <<'HOOK'
#!/bin/sh
cat >>"$1"
HOOK
chmod +x "$work/hook"
start_server() {
  "$bin/glasswing-server" --listen "$server" --data "$work/server" --metrics "127.0.0.1:$((port + 3))" \
    --hook "$work/hook $work/told" >>"$work/server.log" 2>&1 &
  server_pid=$!
}
told() { grep -c "\"event\":\"$1\".*\"session\":\"$2\"" "$work/told"; } # EVENT SESSION: how often
was_told() { (($(told "$1" "$2") == 1)); }
touch "$work/told"
refused_start() { { "$bin/glasswing-server" --data "$work/none" --listen "127.0.0.1:$((port + 4))" --hook-events tea 2>&1 || true; } | matches '"tea"; the events are session-done'; }
refused_start || fail "an event that there is not is accepted"
start_server
"$bin/glasswing-display" --listen "127.0.0.1:$((port + 1))" --server "$server" --name display-1 --backend sim --monitor back=128x104@60 --patch-rows 8 >"$work/display.log" 2>&1 &
"$bin/glasswing-camera" --listen "127.0.0.1:$((port + 2))" --server "$server" --name camera-1 --data "$work/camera" --size 128x104 --tap "127.0.0.1:$((port + 1))" \
  --true-knock 0.6 --true-knock-at 9 >"$work/camera.log" 2>&1 &
"$bin/glasswing-solver" --server "$server" --name solver-1 --threads 1 >"$work/solver.log" 2>&1 &
until_true 20 up 3 || fail "not all nodes are up: $(glasswing nodes)"

echo "== paused, and knocked"
glasswing capture "$root/deploy/plans/crystal.txtpb" --session vase >/dev/null
proven() { (($(shown vase proven_count) >= 20)); }
until_true 30 proven || fail "nothing is proven"
status=0
glasswing wait vase --timeout 0.2 2>"$work/stderr" || status=$?
[[ $status == 124 && $(cat "$work/stderr") == *"not at rest: vase" ]] || fail "wait ended with $status: $(cat "$work/stderr")"
glasswing pause vase >/dev/null
until_true 20 was_told paused vase || fail "not told of the pause: $(cat "$work/told")"
refused "is paused" glasswing wait vase
glasswing resume vase >/dev/null
glasswing wait vase || fail "it is not captured"
until_true 20 was_told knocked vase || fail "not told of the knock: $(cat "$work/told") $(glasswing show vase)"

echo "== done, while the server is killed and started again"
glasswing capture "$root/deploy/plans/quick.txtpb" --session glass --watch
"$bin/glasswing" wait vase glass >"$work/waited" 2>&1
"$bin/glasswing-solver" --version >/dev/null
glasswing solve vase >/dev/null
glasswing solve glass >/dev/null
"$bin/glasswing" wait vase glass --json >"$work/waited.json" 2>"$work/wait.log" &
waiting=$!
kill -KILL "$server_pid"
wait "$server_pid" 2>/dev/null || true
start_server
wait "$waiting" || fail "wait failed: $(cat "$work/wait.log")"
[[ $(grep -c done "$work/waited.json") == 2 ]] || fail "$(cat "$work/waited.json")"
for session in vase glass; do
  until_true 20 was_told session-done "$session" || fail "not told that $session is done: $(cat "$work/told")"
done
refused "there is no session" glasswing wait vase nobody

echo "== what monitoring sees"
metric() { curl --silent "http://127.0.0.1:$((port + 3))/metrics" | grep -F "$1" | awk '{ print $2 }'; } # NAME
[[ $(metric 'glasswing_events_total{event="session-done"}') == 2 && $(metric 'glasswing_events_total{event="drift"}') == 0 ]] ||
  fail "$(metric glasswing_events_total)"
until_true 20 [ "$(metric 'glasswing_hooks_total{outcome="done"}')" -ge 2 ] || fail "$(metric glasswing_hooks_total)"
echo "all checks passed"
