#!/bin/bash
# The console as a process of its own: killed during a capture it harms nothing, and logins survive its restart and
# the server's; while the server is away it says so.
source "$(dirname "$0")/rig.sh"
console=$((port + 3))
rig=("$root/deploy/local-rig")
trap '"${rig[@]}" down --data "$work/rig" >/dev/null; rm -rf "$work"' EXIT
up=("${rig[@]}" up --data "$work/rig" --port "$port" --solvers 1 --console "$console")

cookie=none
request() { # METHOD PATH [BODY]: the answer with its head
  exec 8<>"/dev/tcp/127.0.0.1/$console" || return
  printf '%s %s HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nX-Glasswing: console\r\nCookie: %s\r\nContent-Length: %d\r\n\r\n%s' \
    "$1" "$2" "$cookie" "${#3}" "${3-}" >&8
  cat <&8
  exec 8>&-
}
answers() { request GET /me "" | matches "^HTTP/1.1 $1 "; } # STATUS
proven_at_least() { (($(shown "$1" proven_count) >= $2)); }
captured() { [[ $(shown s state) == SESSION_STATE_CAPTURED ]]; }

"${up[@]}"
link=$(glasswing console token)
[[ $link == "http://127.0.0.1:$console/#token="* ]] || fail "the link is $link"
cookie=$(request POST /login "{\"token\": \"${link#*token=}\"}" | sed -n 's/^Set-Cookie: \([^;]*\);.*/\1/p')
answers 200 || fail "the link does not log in"
grep -q 'audit console login caller="[^"]*" from=127.0.0.1' "$work/rig/logs/server.log" || fail "the login is not in the server's log"

echo "== killed during a capture"
request POST /api/SessionService/PauseSession '{"name": "nothing"}' | matches "^HTTP/1.1 404 " || fail "the page's calls do not reach the server"
grep -q 'audit rpc=SessionService/PauseSession caller="[^"]* (token [0-9a-f]*)" roles=operator' "$work/rig/logs/server.log" || fail "the server does not log who calls"
glasswing capture "$root/deploy/plans/quick.txtpb" --session s >/dev/null
until_true 30 proven_at_least s 20 || fail "no step was proven"
kill -KILL "$(cat "$work/rig/run/console.pid")"
until_true 60 captured || fail "the capture is $(shown s state)"
! answers 200 || fail "the console was not killed"
[[ $("${rig[@]}" status --data "$work/rig" 2>&1 || true) == *"console is down"* ]] || fail "its end is not noticed"
"${up[@]}"
answers 200 || fail "the login is lost"

echo "== without the server"
kill -KILL "$(cat "$work/rig/run/server.pid")"
until_true 10 answers 503 || fail "the console says nothing"
request GET /me "" | matches "the server at $server does not answer" || fail "it does not say which server"
request GET /me "" | matches "^Retry-After: 1" || fail "it does not say that it passes"
"${up[@]}"
until_true 10 answers 200 || fail "the console does not find the server again"
echo "all checks passed"
