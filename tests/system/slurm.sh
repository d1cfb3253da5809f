# Sourced by the tests that need a cluster, after rig.sh: a real Slurm with three nodes, lab1 to lab3, all on this
# machine. The test's cluster ends with it.
[[ $(id -u) == 0 ]] || { echo "skipped: only root can run Slurm here"; exit 77; }
export PATH=$PATH:/usr/sbin GLASSWING_BIN=$bin SLURM_CONF=$work/slurm.conf
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

declare -A slurmd
start_slurmd() { # MACHINE
  slurmd -D -N "$1" >"$work/slurmd-$1.out" 2>&1 &
  slurmd[$1]=$!
}
machines() { [[ $(sinfo --noheader --states=idle --format=%D) == 3 ]]; }
start_cluster() {
  mkdir "$work"/{munge,state,logs}
  chmod 755 "$work" "$work/munge"
  head -c 1024 /dev/urandom >"$work/munge/key"
  chmod 400 "$work/munge/key"
  local host machine first=$((port + 10))
  host=$(hostname -s)
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
  for machine in lab1 lab2 lab3; do start_slurmd "$machine"; done
  until_true 20 machines || fail "$(sinfo 2>&1)"
  sinfo
}
kill_machine() { # MACHINE: dies with all that runs on it, and Slurm learns of it
  local pid
  local doomed=("${slurmd[$1]}")
  for pid in $(of_test "SLURMD_NODENAME=$1"); do doomed+=("$pid" "$(ps -o ppid= -p "$pid")"); done # its slurmstepd
  kill -KILL "${doomed[@]}" || true
  scontrol update nodename="$1" state=down reason=died
}
