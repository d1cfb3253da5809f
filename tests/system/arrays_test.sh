#!/bin/bash
# The recipes of docs/clusters.md for GNU parallel and Snakemake, as they stand there: the joined matte is the file of
# one process, also after a part was lost.
source "$(dirname "$0")/rig.sh"
source "$(dirname "$0")/recipes.sh"
export GLASSWING_BIN=$bin
rig=$root/deploy/local-rig
trap '"$rig" down --data "$work/rig" >/dev/null || true; rm -rf "$work"' EXIT

echo "== an archive, and its matte by one process"
"$rig" up --data "$work/rig" --port "$port" --solvers 1 --size 96x72 >/dev/null
glasswing capture "$root/deploy/plans/quick.txtpb" --session s --watch
glasswing export s "$work/archive" >/dev/null
"$bin/glasswing-solver" solve "$work/archive" "$work/here.exr"

echo "== GNU parallel"
mkdir "$work/parallel"
(cd "$work/parallel" && ARCHIVE=$work/archive bash -euo pipefail -c "$(recipe parts.sh)")
cmp "$work/parallel/matte.exr" "$work/here.exr" || fail "the matte of GNU parallel differs"

echo "== Snakemake"
mkdir "$work/snakemake"
recipe Snakefile >"$work/snakemake/Snakefile"
make_matte() { (cd "$work/snakemake" && HOME=$work snakemake --cores 2 --config archive="$work/archive" -- matte) >"$work/snakemake.log" 2>&1; }
make_matte || fail "snakemake failed: $(cat "$work/snakemake.log")"
cmp "$work/snakemake/matte.exr" "$work/here.exr" || fail "the matte of Snakemake differs"
rm "$work/snakemake/part-3.exr" "$work/snakemake/matte.exr"
make_matte || fail "snakemake failed: $(cat "$work/snakemake.log")"
cmp "$work/snakemake/matte.exr" "$work/here.exr" || fail "the matte of Snakemake differs after a part was lost"
[[ $(grep -c '^rule part:' "$work/snakemake.log") == 1 ]] || fail "not just the lost part was made: $(cat "$work/snakemake.log")"

echo "== the parts become the session's matte"
glasswing solve s --from "$work"/parallel/part-*.exr >/dev/null
[[ $(shown s state) == SESSION_STATE_DONE ]] || fail "the session is $(shown s state)"
glasswing fetch s -o "$work/fetched.exr" >/dev/null
cmp "$work/fetched.exr" "$work/here.exr" || fail "the session's matte differs"

echo "== parts of another archive, and some of the parts, do not"
glasswing import "$work/archive" --session t >/dev/null
refused "solved from the archive" glasswing solve t --from "$work"/parallel/part-*.exr
refused "are in no file" glasswing solve s --from "$work"/parallel/part-[1-7].exr
glasswing fetch s -o "$work/still.exr" >/dev/null
cmp "$work/still.exr" "$work/here.exr" || fail "a refused matte replaced the session's"
echo "all checks passed"
