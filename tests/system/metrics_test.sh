#!/bin/bash
# Metrics and logs of a rig of separate processes: after a capture and a solve every daemon's /metrics is
# valid for Prometheus, counts what happened, and has every name that the dashboard and the alerts use; logs
# can be JSON.
source "$(dirname "$0")/rig.sh"

metrics=$((port + 10))
local_rig() { "$root/deploy/local-rig" "$@" --data "$work/rig" >>"$work/local-rig.log" 2>&1; }
trap 'local_rig down; kill $(jobs -p) 2>/dev/null || true; wait; rm -rf "$work"' EXIT
scrape() { # N
  exec 9<>"/dev/tcp/127.0.0.1/$((metrics + $1))" && printf 'GET /metrics HTTP/1.0\r\n\r\n' >&9 && sed '1,/^\r$/d' <&9
  exec 9>&-
}
value() { # N NAME: the sum of all samples that begin with this name and labels
  scrape "$1" | awk -v name="$2" 'index($0, name) == 1 { sum += $NF; there = 1 } END { if (!there) exit 1; print sum }'
}
is() { [[ $(value "$2" "$3") == "$1" ]]; } # VALUE N NAME

local_rig up --port "$port" --solvers 2 --metrics "$metrics" || fail "the rig did not come up"

echo "== at first the fleet is up and idle"
until_true 10 is 2 0 'glasswing_solvers{state="up"}' || fail "no solvers: $(scrape 0 | grep glasswing_solvers)"
is 2 0 glasswing_node_up || fail "the display and the camera are not both up"
is 0 0 glasswing_tiles_done_total || fail "tiles are done"
is 1 0 glasswing_job_store_up || fail "no job store"
glasswing fleet | tee "$work/fleet.txt"
grep -q "2 of 2 solvers up" "$work/fleet.txt" || fail "the fleet does not list the solvers"
grep -q "no work" "$work/fleet.txt" || fail "the fleet is not idle"

echo "== a capture and a solve are counted"
glasswing capture "$root/deploy/plans/quick.txtpb" --session vase --watch 2>/dev/null || fail "not captured"
glasswing solve vase --watch 2>/dev/null || fail "not solved"
tiles=$(shown vase tile_count) steps=$(shown vase proven_count)
until_true 10 is "$tiles" 0 glasswing_tiles_done_total || fail "$(value 0 glasswing_tiles_done_total) tiles are done, not $tiles"
is "$tiles" 0 glasswing_tile_seconds_count || fail "not every tile was timed"
is "$steps" 0 glasswing_steps_proven_total || fail "$(value 0 glasswing_steps_proven_total) steps are proven, not $steps"
is "$steps" 2 glasswing_frames_kept_total || fail "$(value 2 glasswing_frames_kept_total) frames were kept, not $steps"
is 1 0 'glasswing_sessions{state="done"}' || fail "no session is done"
is 0 0 'glasswing_tiles{state="leased"}' || fail "tiles are leased"
(($(value 1 glasswing_steps_shown_total) >= steps)) || fail "fewer steps were shown than proven"
solved=$(($(value 3 'glasswing_solver_tiles_total{outcome="solved"}') + $(value 4 'glasswing_solver_tiles_total{outcome="solved"}')))
((solved >= tiles)) || fail "the solvers solved $solved of $tiles tiles"
(($(value 0 'glasswing_rpcs_total{code="OK",method="WorkService/CompleteTile"}') >= tiles)) || fail "calls were not counted"
done_by=$(glasswing fleet --json | awk -F '"' '/"tiles_done": "/ { sum += $4 } END { print sum + 0 }')
[[ $done_by == "$tiles" ]] || fail "glasswing fleet reports $done_by tiles, not $tiles"

echo "== Prometheus accepts all metrics"
for n in 0 1 2 3 4; do scrape "$n" >"$work/metrics.$n" || fail "daemon $n does not answer"; done
cat "$work"/metrics.* >"$work/exposed"
for n in 0 1 2 3 4; do
  # Ignore the names that the library itself adds.
  promtool check metrics <"$work/metrics.$n" 2>&1 | grep -v '^exposer_' >"$work/lint" || true
  [[ ! -s $work/lint ]] || fail "daemon $n: $(cat "$work/lint")"
done
promtool check config "$root/deploy/prometheus/prometheus.yml" >"$work/promtool.log" 2>&1 || fail "$(cat "$work/promtool.log")"
promtool check rules "$root/deploy/prometheus/alerts.yml" >"$work/promtool.log" 2>&1 || fail "$(cat "$work/promtool.log")"

echo "== every name that the dashboard and the alerts use exists"
python3 - "$work/exposed" "$root" <<'PYTHON' || fail "a name is missing"
import json, pathlib, re, sys

exposed = set(re.findall(r"^(\w+)(?:\{| )", pathlib.Path(sys.argv[1]).read_text(), re.MULTILINE))
root = pathlib.Path(sys.argv[2])
dashboard = json.loads((root / "deploy/grafana/glasswing.json").read_text())
panels = [panel for panel in dashboard["panels"] if panel["type"] != "row"]
asked = [target["expr"] for panel in panels for target in panel["targets"]]
asked += [variable["definition"] for variable in dashboard["templating"]["list"] if "definition" in variable]
asked += re.findall(r"expr: (.*)", (root / "deploy/prometheus/alerts.yml").read_text())
documented = (root / "docs/monitoring.md").read_text()
names = {name for text in asked for name in re.findall(r"\b(?:glasswing|process)_\w+", text)}
families = {re.sub("_(bucket|sum|count)$", "", name) for name in exposed if name.startswith(("glasswing_", "process_"))}
unknown, undocumented = names - exposed, families - set(re.findall(r"\w+", documented))
print(f"{len(names)} names in {len(asked)} queries; missing: {unknown or 'none'}")
print(f"{len(families)} families; not in docs/monitoring.md: {undocumented or 'none'}")
sys.exit(0 if len(names) > 20 and not unknown and not undocumented else 1)
PYTHON

echo "== wrong options of metrics and logs are refused by name"
for wrong in "--metrics 0.0.0.0:0" "--metrics 127.0.0.1:$metrics" "--log-level loud" "--log-format xml"; do
  # shellcheck disable=SC2086
  if "$bin/glasswing-server" --listen 127.0.0.1:0 --data "$work/other" $wrong >"$work/wrong.log" 2>&1; then fail "accepted: $wrong"; fi
  grep -qF -- "${wrong%% *}" "$work/wrong.log" || fail "$wrong: $(cat "$work/wrong.log")"
done

echo "== logs in JSON"
"$bin/glasswing-server" --listen 127.0.0.1:0 --data "$work/other" --log-format json 2>"$work/json.log" &
until_true 10 grep -q listening "$work/json.log" || fail "the server did not start"
python3 -c '
import json, sys
lines = [json.loads(line) for line in open(sys.argv[1])]
assert lines and all(line["program"] == "glasswing-server" for line in lines)
assert lines[-1]["address"].startswith("127.0.0.1:"), lines[-1]
' "$work/json.log" || fail "$(cat "$work/json.log")"
