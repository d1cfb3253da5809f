#!/bin/bash
# A rig and two solvers on separate hosts: network namespaces on one bridge, which do not see each other's
# files, with mutual TLS. Whichever host is cut off during a solve, for longer than a lease, the session ends
# with the same matte, and the host continues when it is back.
[[ $(id -u) == 0 ]] || { echo "skipped: only root makes network namespaces"; exit 77; }
source "$(dirname "$0")/rig.sh"
lab=gw$$
space() { echo "$lab-$1"; } # HOST: its network namespace
stop_all() {
  local space
  exec 2>/dev/null
  for space in $(ip netns list | grep -o "^$lab-[a-z0-9]*"); do
    kill -KILL $(ip netns pids "$space") 2>/dev/null || true
    ip netns del "$space"
  done
  wait
  rm -rf "$work"
}
trap stop_all EXIT
{ ip netns add "$(space switch)" && ip -n "$(space switch)" link add lab type bridge; } 2>"$work/refusal" ||
  { echo "skipped: $(cat "$work/refusal")"; exit 77; }
ip -n "$(space switch)" link set lab up

declare -A address=([rig]=10.77.0.1 [lab2]=10.77.0.2 [lab3]=10.77.0.3 [desk]=10.77.0.4)
for host in "${!address[@]}"; do
  ip netns add "$(space "$host")"
  ip link add "$host" netns "$(space switch)" type veth peer name eth0 netns "$(space "$host")"
  ip -n "$(space switch)" link set "$host" master lab up
  ip -n "$(space "$host")" address add "${address[$host]}/24" dev eth0
  ip -n "$(space "$host")" link set eth0 up
  ip -n "$(space "$host")" link set lo up
done
cut_off() { ip -n "$(space switch)" link set "$1" down; }
plug_in() { ip -n "$(space switch)" link set "$1" up; }
on() { # HOST COMMAND...: replaces this process by COMMAND on HOST, in its directory, with the other hosts' directories hidden
  local host=$1
  shift
  exec ip netns exec "$(space "$host")" unshare --mount --uts bash -c '
    hostname "$1"
    cd "$2/$1"
    for other in rig lab2 lab3 desk; do [[ $other == "$1" ]] || mount -t tmpfs none "$2/$other"; done
    shift 2
    exec "$@"' on "$host" "$work" "$@"
}

declare -A roles=([rig]=server+display+camera [lab2]=solver [lab3]=solver [desk]=operator)
issued() { "$bin/glasswing" pki init "$1" >/dev/null && "$bin/glasswing" pki issue "$@" >/dev/null; } # DIR REQUEST...
issued "$work/lab" $(for host in "${!address[@]}"; do echo "${roles[$host]}:$host=${address[$host]}"; done)
issued "$work/foreign" operator:desk
for host in "${!address[@]}"; do
  mkdir "$work/$host"
  cp "$work/lab/ca.pem" "$work/$host/"
  cp "$work/lab/$host.pem" "$work/$host/own.pem"
  cp "$work/lab/$host.key" "$work/$host/own.key"
done
cp "$work/foreign/desk.pem" "$work/desk/foreign.pem"
cp "$work/foreign/desk.key" "$work/desk/foreign.key"
cp "$root/deploy/plans/quick.txtpb" "$work/desk/"

export GLASSWING_SERVER=${address[rig]}:7440 GLASSWING_CA=ca.pem GLASSWING_CERTIFICATE=own.pem GLASSWING_KEY=own.key
glasswing() { (on desk "$bin/glasswing" "$@"); }
start() { # HOST PROGRAM OPTIONS...
  on "$1" "$bin/$2" "${@:3}" </dev/null >>"$work/$1-$2.log" 2>&1 &
}
start rig glasswing-server --listen 0.0.0.0:7440 --advertise "$GLASSWING_SERVER" --data server --lease 3
start rig glasswing-display --listen "${address[rig]}:7441" --server "$GLASSWING_SERVER" --monitor back=128x104@60 --patch-rows 8
start rig glasswing-camera --listen "${address[rig]}:7442" --server "$GLASSWING_SERVER" --tap "${address[rig]}:7441" \
  --data camera --scene crystal --size 512x416 --fps 200
for host in lab2 lab3; do start "$host" glasswing-solver --server "$GLASSWING_SERVER" --threads 1; done
until_true 20 up 4 || fail "the rig did not come up"
glasswing nodes

echo "== callers without a certificate of the lab are rejected"
GLASSWING_CERTIFICATE='' GLASSWING_KEY='' refused "wants to know who calls; set --certificate and --key" glasswing nodes
GLASSWING_CERTIFICATE=foreign.pem GLASSWING_KEY=foreign.key refused "refuses the certificate foreign.pem" glasswing nodes
GLASSWING_CA='' GLASSWING_CERTIFICATE='' GLASSWING_KEY='' refused "calls need TLS; set --ca" glasswing nodes
GLASSWING_CA=foreign.pem refused "the CA foreign.pem did not sign" glasswing nodes

is_done() { [[ $(shown s state) == SESSION_STATE_DONE ]]; }
done_by() { tail -n "+$2" "$work/rig-glasswing-server.log" | grep -c "tile done .*solver=$1-"; } # HOST LINE: tiles done by HOST since that line of the log
both_work() { (($(glasswing nodes --tsv | grep -c "^solver.*solving s tile") == 2)); } # both solvers were given a tile
begin() {
  from=$(($(wc -l <"$work/rig-glasswing-server.log") + 1)) SECONDS=0
  glasswing solve s >/dev/null
}
same_matte() { # WHEN
  glasswing fetch s -o again.exr
  cmp "$work/desk/first.exr" "$work/desk/again.exr" || fail "the matte differs $1"
  echo "$SECONDS s; lab2 solved $(done_by lab2 "$from") tiles, lab3 $(done_by lab3 "$from")"
}

echo "== an undisturbed solve"
glasswing capture quick.txtpb --session s --watch
glasswing solve s --watch
glasswing fetch s -o first.exr

echo "== a solver's host is cut off until its tile was solved elsewhere"
begin
until_true 30 both_work || fail "not both solvers work"
cut_off lab2
until_true 120 is_done || fail "its tile was not solved elsewhere"
same_matte "with lab2 cut off"
plug_in lab2

echo "== the server's host is cut off from all others"
begin
until_true 30 both_work || fail "not both solvers work"
cut_off rig
sleep 4  # longer than a lease
plug_in rig
until_true 120 is_done || fail "the solvers did not continue"
same_matte "after the server's return"
(($(done_by lab2 "$from") > 0)) || fail "lab2 is back, but does not solve"
echo "all checks passed"
