#!/bin/bash
# Solvers as jobs of a real Slurm with three nodes, all on this machine: jobs start when there is work; when a
# node dies during a solve, its job is requeued; the matte equals that of a local solve; and all jobs end when
# no work is left.
source "$(dirname "$0")/rig.sh"
source "$(dirname "$0")/slurm.sh"
export GLASSWING_UNTIL_IDLE=4

echo "== a cluster of three nodes"
start_cluster

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
kill_machine "$machine"
! are_done || fail "the solves ended before the node died"
said ", 2 solvers in the queue, at most 2" scale --most 2
elsewhere() { solvers running | grep "^$job " | matches -vw "$machine"; }
until_true 30 elsewhere || fail "job $job was not requeued: $(squeue)"
solvers running
# Again and again, and after the solve: a solver may stop at a tile that another attempt has done.
go_on() { kill -CONT $(of_test GLASSWING_UNTIL_IDLE=4) || true; }
go_on_until_done() { go_on; are_done; }
until_true 60 go_on_until_done || fail "the sessions are $(shown s state) and $(shown t state)"

echo "== the matte equals that of a local solve"
glasswing export t "$work/archive-of-t" >/dev/null
"$bin/glasswing-solver" solve "$work/archive" "$work/here-s.exr"
"$bin/glasswing-solver" solve "$work/archive-of-t" "$work/here-t.exr"
for session in s t; do
  glasswing fetch "$session" -o "$work/$session.exr"
  cmp "$work/$session.exr" "$work/here-$session.exr" || fail "the matte of $session differs"
done

echo "== solvers end when no work is left"
gone() { go_on; [[ -z $(solvers) ]]; }
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
