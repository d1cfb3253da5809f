#!/bin/bash
# A rig and two solvers on hosts of their own: network namespaces with addresses on one bridge, which see none of each other's
# files, and mutual TLS between all. Whichever host is cut off in the middle of a solve, for longer than a lease lasts, the
# session ends with the same matte, and the host goes on when it is back.
[[ $(id -u) == 0 ]] || { echo "skipped: only root makes network namespaces"; exit 77; }
command -v ip >/dev/null && command -v openssl >/dev/null || { echo "skipped: there is no ip or no openssl"; exit 77; }
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
on() { # HOST COMMAND...: there, in its own directory, with those of the others out of sight; in place of this process
  local host=$1
  shift
  exec ip netns exec "$(space "$host")" unshare --mount --uts bash -c '
    hostname "$1"
    cd "$2/$1"
    for other in rig lab2 lab3 desk; do [[ $other == "$1" ]] || mount -t tmpfs none "$2/$other"; done
    shift 2
    exec "$@"' on "$host" "$work" "$@"
}

"$root/deploy/make-certificates" "$work/lab" $(for host in "${!address[@]}"; do echo "$host=${address[$host]}"; done) >/dev/null
"$root/deploy/make-certificates" "$work/foreign" desk >/dev/null
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
start_solver() { start "$1" glasswing-solver --server "$GLASSWING_SERVER" --threads 1; } # HOST

start rig glasswing-server --listen 0.0.0.0:7440 --advertise "$GLASSWING_SERVER" --data server
start rig glasswing-display --listen "${address[rig]}:7441" --server "$GLASSWING_SERVER" --monitor back=128x104@60 --patch-rows 8
start rig glasswing-camera --listen "${address[rig]}:7442" --server "$GLASSWING_SERVER" --tap "${address[rig]}:7441" \
  --data camera --scene crystal --size 192x156 --fps 200
start_solver lab2
start_solver lab3
lab3=$!
until_true 20 up 4 || fail "the rig did not come up"
glasswing nodes

echo "== who shows no certificate of the lab is not let in"
GLASSWING_CERTIFICATE='' GLASSWING_KEY='' refused "wants to know who calls; set --certificate and --key" glasswing nodes
GLASSWING_CERTIFICATE=foreign.pem GLASSWING_KEY=foreign.key refused "refuses the certificate foreign.pem" glasswing nodes
GLASSWING_CA='' GLASSWING_CERTIFICATE='' GLASSWING_KEY='' refused "calls need TLS; set --ca" glasswing nodes
GLASSWING_CA=foreign.pem refused "the CA foreign.pem did not sign" glasswing nodes

echo "== an undisturbed solve"
is_done() { [[ $(shown s state) == SESSION_STATE_DONE ]]; }
tiles_done() { (($(shown s tiles_done) >= $1)); } # COUNT: so many at least
begin() { # a solve of which some tiles are done, and some are being solved
  glasswing solve s >/dev/null
  until_true 30 tiles_done 3 || fail "no tile was solved"
  [[ $(shown s state) == SESSION_STATE_SOLVING ]] || fail "it was over too soon"
}
same_matte() { # AFTER WHAT
  glasswing fetch s -o again.exr
  cmp "$work/desk/first.exr" "$work/desk/again.exr" || fail "the matte is another one $1"
}
glasswing capture quick.txtpb --session s --watch
SECONDS=0
glasswing solve s --watch
echo "$SECONDS s"
glasswing fetch s -o first.exr

echo "== a solver's host is cut off"
SECONDS=0
begin
cut_off lab2
until_true 40 is_done || fail "its tile was not solved elsewhere"
same_matte "with lab2 cut off"
echo "$SECONDS s"
plug_in lab2

echo "== it is back, and solves alone"
kill "$lab3"
wait "$lab3" || true
SECONDS=0
glasswing solve s --watch
same_matte "after lab2's return"
echo "$SECONDS s"

echo "== the server's host is cut off from all"
start_solver lab3
until_true 20 up 4 || fail "the solver did not come"
SECONDS=0
begin
cut_off rig
sleep 12
plug_in rig
until_true 40 is_done || fail "the solvers did not go on"
same_matte "after the server's return"
echo "$SECONDS s"
echo "all of it held"
