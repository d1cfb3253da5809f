#!/bin/bash
# Two GigE Vision cameras, each on a network of its own with a real interface (network namespaces), and two camera
# nodes on the host between them: each node finds its camera among both, and one session captures with both. The
# pixels of every proven frame must be those of its step.
[[ $(id -u) == 0 ]] || { echo "skipped: only root makes network namespaces"; exit 77; }
if [[ ${1:-} != inside ]]; then
  unshare --net true || { echo "skipped: network namespaces cannot be made"; exit 77; }
  exec unshare --net "$0" inside
fi
source "$(dirname "$0")/rig.sh"
tests=$(cd "$bin/../tests" && pwd)
display=$((port + 1))
ip link set lo up
declare -A network=([left]=10.77.1 [right]=10.77.2) lost=([left]=0 [right]=0.5)

for name in left right; do
  unshare --net sleep 300 &
  host=$!
  until_true 5 eval '[[ $(readlink /proc/$host/ns/net) != $(readlink /proc/$$/ns/net) ]]' || fail "no namespace"
  ip link add "$name" type veth peer name eth0 netns "$host"
  ip address add "${network[$name]}.1/24" broadcast + dev "$name"
  ip link set "$name" up
  nsenter --target "$host" --net ip address add "${network[$name]}.2/24" broadcast + dev eth0
  nsenter --target "$host" --net ip link set eth0 up
  "$tests/wire_camera" --tap "127.0.0.1:$display" --network "/proc/$host/ns/net" --address "${network[$name]}.2" --serial "$name" \
    --object "$work/object" --lost "${lost[$name]}" --line-port "$work/$name.port" >>"$work/$name.log" 2>&1 &
  until_true 10 test -s "$work/$name.port" || fail "no camera"
done

echo "== discovery lists both, with their addresses"
"$bin/glasswing-camera" --server "$server" --data "$work/none" --backend aravis 2>"$work/stderr" && fail "accepted"
for name in left right; do
  grep -qF "$name\" (" "$work/stderr" && grep -qF "${network[$name]}.2)" "$work/stderr" || fail "$name is not listed: $(cat "$work/stderr")"
done

echo "== one session with both"
"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
"$bin/glasswing-display" --server "$server" --listen "127.0.0.1:$display" --monitor back=96x72@60 >"$work/display.log" 2>&1 &
listen=$display
for name in left right; do
  ((++listen))
  "$bin/glasswing-camera" --server "$server" --name "$name" --listen "127.0.0.1:$listen" --data "$work/node-$name" \
    --backend aravis --device "${network[$name]}.2" --size 96x72 --format Mono12p --fps 25 >"$work/camera-$name.log" 2>&1 &
done
until_true 40 up 3 || fail "not all nodes came up"
cat >"$work/plan.txtpb" <<'TEXT'
method: "gaussian"
sweeps { sigma_px: 4 step_px: 4 }
solids { colour: [0, 0, 0] } solids { colour: [1, 1, 1] }
skip_empty_stage: true exposure_ms: 4 hold_refreshes: 5
TEXT
touch "$work/object"
glasswing capture "$work/plan.txtpb" --session vase --camera left --camera right >/dev/null
until_true 30 eval 'glasswing show vase | grep "place the object" >/dev/null' || fail "$(glasswing show vase)"
glasswing resume vase >/dev/null
timeout 60 "$bin/glasswing" watch vase >/dev/null 2>&1 || fail "$(glasswing show vase)"
for name in left right; do
  [[ $(shown "vase.$name" proven_count) == "$(shown "vase.$name" step_count)" ]] || fail "$name: not every step is proven: $(glasswing show "vase.$name")"
  "$tests/vm.archive_labels" --mono --bits 12 "$work/node-$name/archives/vase.$name" || fail "$name: a frame is mislabelled"
done
