#!/bin/bash
# Solvers as jobs of a real Slurm with three nodes, all on this machine: jobs start when there is work; when a
# node dies during a solve, its job is requeued; the matte equals that of a local solve; and all jobs end when
# no work is left.
[[ $(id -u) == 0 ]] || { echo "skipped: only root can run Slurm here"; exit 77; }
source "$(dirname "$0")/rig.sh"
export PATH=$PATH:/usr/sbin GLASSWING_BIN=$bin SLURM_CONF=$work/slurm.conf GLASSWING_UNTIL_IDLE=4
rig=$root/deploy/local-rig
of_test() { # VARIABLE=VALUE: the processes of this test's cluster that have this in their environment
  local pid environment
  for pid in $(pgrep -x 'slurm.*|glasswing-solve'); do
    environment=$({ tr '\0' '\n' <"/proc/$pid/environ"; } 2>/dev/null) || continue
    grep -qxF "SLURM_CONF=$SLURM_CONF" <<<"$environment" && grep -qxF "$1" <<<"$environment" && echo "$pid"
  done
  return 0
}
stop_all() {
  "$rig" down --data "$work/rig" >/dev/null || true
  scancel --me 2>/dev/null || true
  exec 2>/dev/null
  # A slurmstepd survives its slurmd, and a solver survives both.
  kill -KILL $(of_test "SLURM_CONF=$SLURM_CONF") $(jobs -p) || true
  wait
  rm -rf "$work"
}
trap stop_all EXIT

echo "== a cluster of three nodes"
mkdir "$work"/{munge,state,logs}
chmod 755 "$work" "$work/munge"
head -c 1024 /dev/urandom >"$work/munge/key"
chmod 400 "$work/munge/key"
host=$(hostname -s) first=$((port + 10))
cat >"$SLURM_CONF" <<CONF
ClusterName=glasswing
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$first
SlurmUser=root
AuthType=auth/munge
CredType=cred/munge
# A requeued job waits until its old credential expires: two minutes by default.
AuthInfo=socket=$work/munge/socket,cred_expire=5
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool-%n
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd-%n.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,bf_interval=1,batch_sched_delay=1
ReturnToService=2
SlurmdParameters=config_overrides
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
JobAcctGatherType=jobacct_gather/none
NodeName=lab[1-3] NodeAddr=127.0.0.1 NodeHostname=$host Port=[$((first + 1))-$((first + 3))] CPUs=1 RealMemory=500 State=UNKNOWN
PartitionName=lab Nodes=lab[1-3] Default=YES MaxTime=INFINITE State=UP
CONF
munged --foreground --force --key-file="$work/munge/key" --socket="$work/munge/socket" --pid-file="$work/munge/pid" \
  --log-file="$work/munge/log" --seed-file="$work/munge/seed" >"$work/munged.log" 2>&1 &
until_true 10 test -S "$work/munge/socket" || fail "munged did not start"
slurmctld -D -i >"$work/slurmctld.out" 2>&1 &
declare -A slurmd
for machine in lab1 lab2 lab3; do
  slurmd -D -N "$machine" >"$work/slurmd-$machine.out" 2>&1 &
  slurmd[$machine]=$!
done
machines() { [[ $(sinfo --noheader --states=idle --format=%D) == 3 ]]; }
until_true 20 machines || fail "$(sinfo 2>&1)"
sinfo

echo "== a rig without solvers or work: nothing is submitted"
"$rig" up --data "$work/rig" --port "$port" --solvers 0 --size 192x152
scale() { (cd "$work" && "$root/deploy/slurm/scale" --tiles 1 "$@"); }
said() { # WORDS COMMAND...: the output of the command contains WORDS
  "${@:2}" | tee "$work/said"
  grep -qF -- "$1" "$work/said" || fail "the output lacks \"$1\""
}
said "nothing to submit: 0 tiles left, 0 solvers in the queue" scale
glasswing capture "$root/deploy/plans/quick.txtpb" --session s --watch
glasswing export s "$work/archive" >/dev/null
glasswing import "$work/archive" --session t >/dev/null

echo "== solvers start when there is work"
solvers() { squeue --me --array --noheader --states="${1:-pending,configuring,running,completing}" --format='%i %N'; } # [STATE]: their jobs and nodes
running() { (($(solvers running | wc -l) >= $1)); } # COUNT
tiles_done() { (($(shown s tiles_done) >= $1)); } # COUNT
are_done() { [[ $(shown s state) == SESSION_STATE_DONE && $(shown t state) == SESSION_STATE_DONE ]]; }
# The number of tiles of a solve is unknown until it is surveyed: each such solve counts for one solver.
for session in s t; do glasswing solve "$session" >/dev/null; done
# The fault makes each solver stop at its second tile, however fast it is.
GLASSWING_FAULT="tile solved=stop@2" said "submitted 2 as job " scale --most 2
until_true 20 running 2 || fail "the solvers do not run: $(squeue)"
until_true 30 tiles_done 1 || fail "no tile was solved"

echo "== a node dies during the solve"
read -r job machine < <(solvers running | tail -n 1)
echo "job $job runs on $machine, which now dies"
doomed=("${slurmd[$machine]}")
for pid in $(of_test "SLURMD_NODENAME=$machine"); do doomed+=("$pid" "$(ps -o ppid= -p "$pid")"); done  # its slurmstepd
kill -KILL "${doomed[@]}"
! are_done || fail "the solves ended before the node died"
scontrol update nodename="$machine" state=down reason=died
said ", 2 solvers in the queue, at most 2" scale --most 2
elsewhere() { solvers running | grep "^$job " | grep -qvw "$machine"; }
until_true 30 elsewhere || fail "job $job was not requeued: $(squeue)"
solvers running
goes_on() { kill -CONT $(of_test GLASSWING_UNTIL_IDLE=4) || true; are_done; }
until_true 60 goes_on || fail "the sessions are $(shown s state) and $(shown t state)"

echo "== the matte equals that of a local solve"
glasswing export t "$work/archive-of-t" >/dev/null
"$bin/glasswing-solver" solve "$work/archive" "$work/here-s.exr"
"$bin/glasswing-solver" solve "$work/archive-of-t" "$work/here-t.exr"
for session in s t; do
  glasswing fetch "$session" -o "$work/$session.exr"
  cmp "$work/$session.exr" "$work/here-$session.exr" || fail "the matte of $session differs"
done

echo "== solvers end when no work is left"
gone() { [[ -z $(solvers) ]]; }
until_true 30 gone || fail "still running: $(squeue)"
said "nothing to submit: 0 tiles left, 0 solvers in the queue" scale

echo "== a solver that is cancelled hands its tile back"
glasswing solve s >/dev/null
said "submitted 1 as job " scale --most 1
until_true 30 tiles_done 1 || fail "no tile was solved"
read -r job machine < <(solvers running)
scancel "$job"
handed_back() { grep -q "tile handed back" "$work/glasswing-solver-$job.log"; }
until_true 20 handed_back || fail "it did not hand it back: $(cat "$work/glasswing-solver-$job.log")"
until_true 20 gone || fail "it did not end: $(squeue)"
cat "$work"/glasswing-solver-*.log
echo "all checks passed"
