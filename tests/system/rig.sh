# Sourced by the tests that run a rig of separate processes. Sets `root`, `bin`, `work` (a temporary
# directory), `port` and `server`. Removes the directory and ends all background jobs when the test ends.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
bin=${GLASSWING_BIN:-$root/build/release/bin}
work=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true; wait; rm -rf "$work"' EXIT
source "$root/tests/processes/ports.sh"
port=$(free_port 20)
server=127.0.0.1:$port
export GLASSWING_SERVER=$server GLASSWING_CONFIG=/dev/null

fail() {
  echo "FAILED: $*" >&2
  tail -n 30 "$work"/*.log "$work"/rig/logs/*.log >&2 2>/dev/null || true
  exit 1
}
glasswing() { "$bin/glasswing" "$@"; }
matches() { [[ -n $(grep "$@") ]]; } # grep -q would end before its input does, which pipefail takes for a failure
until_true() { # SECONDS COMMAND...: repeats the command until it succeeds; fails after SECONDS
  local deadline=$((SECONDS + $1 * ${GLASSWING_TEST_PATIENCE:-1}))
  until "${@:2}" 2>/dev/null; do
    ((SECONDS < deadline)) || return 1
    sleep 0.05
  done
}
up() { (($(glasswing nodes --json | grep -c '"up": true') == $1)); } # COUNT: that many nodes are up
prepared() { ! glasswing nodes --json | matches '"preparation"'; } # every camera has told the server that it is ready
field() { # NAME [FILE]: its first value in JSON
  sed -n "s/.*\"$1\": \"\{0,1\}\([^\",]*\)\"\{0,1\},\{0,1\}\$/\1/p" "${@:2}" | head -n 1
}
shown() { glasswing show "$1" --json | field "$2"; } # SESSION NAME
refused() { # WORDS COMMAND...: the command fails, and its one line on standard error besides progress contains WORDS
  local words=$1
  shift
  if "$@" >/dev/null 2>"$work/stderr"; then fail "accepted: $*"; fi
  [[ $(grep -vc '^[a-z]*ing: ' "$work/stderr") == 0 && $(grep -c '^glasswing: ' "$work/stderr") == 1 ]] || fail "not exactly one line: $(cat "$work/stderr")"
  grep -qF -- "$words" "$work/stderr" || fail "\"$(cat "$work/stderr")\" does not say \"$words\""
}
