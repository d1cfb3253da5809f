#!/bin/bash
# Parts of rows as an array of a real Slurm with three nodes: the recipe of docs/clusters.md as it stands there, and
# `glasswing solve --on slurm`. A node dies, a part fails, the command is broken off: the matte is the file of one process.
source "$(dirname "$0")/rig.sh"
source "$(dirname "$0")/slurm.sh"
source "$(dirname "$0")/recipes.sh"

echo "== a cluster of three nodes, an archive, and its matte by one process"
start_cluster
"$rig" up --data "$work/rig" --port "$port" --solvers 0 --size 96x72 >/dev/null
glasswing capture "$root/deploy/plans/quick.txtpb" --session s --watch
glasswing export s "$work/archive" >/dev/null
"$bin/glasswing-solver" solve "$work/archive" "$work/here.exr"

echo "== the recipe"
mkdir "$work/hand"
recipe part.sbatch >"$work/hand/part.sbatch"
(cd "$work/hand" && sbatch --wait --array=1-6 part.sbatch 6 "$work/archive" --method gaussian) || fail "$(cat "$work"/hand/*.log)"
glasswing matte join "$work"/hand/part-*.exr -o "$work/hand/matte.exr"
cmp "$work/hand/matte.exr" "$work/here.exr" || fail "the matte of the recipe differs"

# A solver that fails at part 3, then stops at part 2, each once.
mkdir "$work/bin"
cat >"$work/bin/glasswing-solver" <<SOLVER
#!/bin/bash
if [[ \$SLURM_ARRAY_TASK_ID == 3 && ! -e $work/failed ]]; then touch $work/failed; echo "part 3 fails once" >&2; exit 1; fi
if [[ \$SLURM_ARRAY_TASK_ID == 2 && -e $work/hang && ! -e $work/hung ]]; then touch $work/hung; kill -STOP \$\$; fi
exec $bin/glasswing-solver "\$@"
SOLVER
chmod +x "$work/bin/glasswing-solver"
on_slurm() { GLASSWING_BIN=$work/bin glasswing solve s --on slurm --parts 6 --directory "$work/desk" "$@"; }
check_matte() { # of the session
  [[ $(shown s state) == SESSION_STATE_DONE && ! -e $work/desk ]] || fail "the session is $(shown s state): $(ls "$work/desk")"
  glasswing fetch s -o "$work/fetched.exr" >/dev/null
  cmp "$work/fetched.exr" "$work/here.exr" || fail "the session's matte differs"
}

echo "== a part that fails is named, and the same command solves it alone"
refused "parts 3 of job" on_slurm
[[ $(shown s state) == SESSION_STATE_CAPTURED ]] || fail "the session is $(shown s state)"
grep -q "part 3 fails once" "$work/desk/part-3.log" || fail "its log does not say why"
refused "contains parts of another solve" on_slurm --set modes=1
on_slurm 2>&1 | tee "$work/said"
grep -q "submitted 1 of 6 parts" "$work/said" || fail "not just the failed part was submitted"
check_matte

echo "== a node dies during the solve"
touch "$work/hang"
on_slurm >"$work/on.log" 2>&1 &
command=$!
until_true 60 test -e "$work/hung" || fail "part 2 did not start: $(squeue) $(cat "$work/on.log")"
stopped() { machine=$(squeue --me --array --noheader --states=running --format='%i %N' | sed -n 's/^[0-9]*_2 //p'); [[ -n $machine ]]; }
until_true 30 stopped || fail "part 2 does not run: $(squeue)"
echo "part 2 runs on $machine, which now dies"
kill_machine "$machine"
wait "$command" || fail "$(cat "$work/on.log")"
check_matte

echo "== broken off, and taken up"
rm "$work/hung"
timeout --foreground --signal=INT 8 "$bin/glasswing" solve s --on slurm --parts 6 --directory "$work/desk" --sbatch=--hold 2>"$work/on.log" &&
  fail "it ended without its parts"
grep -q "the same command fetches its result" "$work/on.log" || fail "$(cat "$work/on.log")"
scontrol release "$(cat "$work/desk/job")"
glasswing solve s --on slurm --parts 6 --directory "$work/desk" --sbatch=--hold 2>&1 | tee "$work/said"
! grep -q submitted "$work/said" || fail "the array was submitted once more"
check_matte

echo "== an archive that is not the session's"
glasswing import "$work/archive" --session t >/dev/null
refused "is not the current archive of session t" glasswing solve t --on slurm --archive "$work/archive" --directory "$work/desk"
echo "all checks passed"
