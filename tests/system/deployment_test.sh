#!/bin/bash
# Installs the units of deploy/systemd: systemd accepts them, and they start a rig over TLS that captures and
# solves, with the configuration and certificates of docs/deployment.md, except for ports, directories and
# simulated devices.
source "$(dirname "$0")/rig.sh"
build=$(cd "$bin/.." && pwd)
for component in common server console display camera solver; do cmake --install "$build" --prefix "$work/installed" --component "$component" >/dev/null; done
units=$work/installed/lib/systemd/system

echo "== systemd verifies the units"
systemd-analyze verify --man=no "$units"/*.service 2>"$work/complaints" || fail "$(cat "$work/complaints")"
! grep -F "$units" "$work/complaints" || fail "systemd reports a problem"

conf=$work/installed/share/glasswing/glasswing.conf
echo "== the configuration lists every option of every daemon"
python3 "$root/tests/system/options_in_conf.py" "$conf" "$bin" || fail "it does not"

echo "== the units start a rig"
issued() { glasswing pki init "$1" >/dev/null && glasswing pki issue "$@" >/dev/null; } # DIR REQUEST...
issued "$work/certificates" server+display+camera+solver:machine=localhost console:console=localhost operator:me viewer:guest
sed -e "s#rig\.lab#localhost#g; s#/etc/glasswing/#$work/certificates/#g; s#127.0.0.1:7480#localhost:$((port + 3))#" -e "s#:7440#:$port#g; s#:7441#:$((port + 1))#g; s#:7442#:$((port + 2))#g" \
  -e "s#--backend kms --monitor back=HDMI-A-1 --patch-rows 48#--monitor back=128x104@60 --patch-rows 8#" \
  -e "s#--backend libcamera#--fps 200 --size 128x104 --scene crystal --tap localhost:$((port + 1)) --log-format json#" \
  -e "$(for n in 0 1 2 3 4 5; do echo "s#127.0.0.1:944$n#127.0.0.1:$((port + 10 + n))#;"; done)" "$conf" >"$work/glasswing.conf"
start() { # UNIT: runs its command as systemd would
  local unit=$units/glasswing-$1.service
  (
    set -a
    source "$work/glasswing.conf"
    directory=$(sed -n 's/^StateDirectory=//p' "$unit")
    if [[ -n $directory ]]; then mkdir -p "$work/state/$directory"; fi
    eval "exec $(sed -n "s#^ExecStart=##p" "$unit" | sed "s#%S#$work/state#")"
  ) >"$work/$1.log" 2>&1 &
}
for unit in server console display camera solver; do start "$unit"; done
until_true 20 grep -q "listening on" "$work/server.log" || fail "the server does not start"
export GLASSWING_SERVER=localhost:$port GLASSWING_CA=$work/certificates/ca.pem
refused "wants to know who calls; set --certificate and --key" glasswing nodes
export GLASSWING_CERTIFICATE=$work/certificates/me.pem GLASSWING_KEY=$work/certificates/me.key
until_true 20 up 3 || fail "the rig did not come up"
glasswing nodes
(GLASSWING_CA='' GLASSWING_CERTIFICATE='' GLASSWING_KEY='' refused "does not answer in the clear; if it speaks TLS, set --ca" glasswing nodes)
GLASSWING_SERVER=127.0.0.1:$port refused "shows a certificate of another host; call it by a name that its certificate has" glasswing nodes
issued "$work/foreign" solver:stranger
"$bin/glasswing-solver" --server "$GLASSWING_SERVER" --certificate "$work/foreign/stranger.pem" --key "$work/foreign/stranger.key" 2>"$work/stranger.log" &
until_true 20 grep -q "does not take this node yet, .* refuses the certificate $work/foreign/stranger.pem" "$work/stranger.log" || fail "the log does not say so"
kill $!
up 3 || fail "the foreign solver was accepted"

echo "== every daemon serves the metrics that the alerts are made of"
metrics() { exec 9<>"/dev/tcp/127.0.0.1/$((port + 10 + $1))" && printf 'GET /metrics HTTP/1.0\r\n\r\n' >&9 && cat <&9; }
served=0
for unit in server display camera solver : console; do
  [[ $unit == : ]] || metrics "$served" | matches "^glasswing_build_info{.*program=\"glasswing-$unit\"" || fail "$unit serves no metrics"
  served=$((served + 1))
done

echo "== a log of JSON stays JSON where gRPC says something: who speaks no TLS"
exec 9<>"/dev/tcp/127.0.0.1/$((port + 2))" && printf 'GET / HTTP/1.0\r\n\r\n' >&9
until_true 20 grep -q '"message":"gRPC: ' "$work/camera.log" || fail "gRPC says nothing"
python3 -c 'import json, sys
for line in sys.stdin: assert json.loads(line)["program"] == "glasswing-camera", line' <"$work/camera.log" || fail "a line is no JSON"

link=$(glasswing console token --name me)
[[ $link == "https://localhost:$((port + 3))/#token="* ]] || fail "the link is $link"
python3 - "$link" "$GLASSWING_CA" <<'END' || fail "the link does not log in"
import http.client, json, ssl, sys, urllib.parse
address, token = sys.argv[1].split("/#token=")
browser = http.client.HTTPSConnection(urllib.parse.urlsplit(address).netloc, context=ssl.create_default_context(cafile=sys.argv[2]))
browser.request("POST", "/login", json.dumps({"token": token}), {"X-Glasswing": "console"})
assert json.load(browser.getresponse())["role"] == "operator"
END

echo "== certificates are renewed while the rig runs"
glasswing pki renew "$work/certificates" machine console me
for unit in server console display camera solver; do
  until_true 20 grep -q "certificates taken up" "$work/$unit.log" || fail "$unit does not load the new certificate"
done
glasswing capture "$root/deploy/plans/quick.txtpb" --session s --watch
glasswing solve s --watch
glasswing fetch s -o "$work/s.exr"
glasswing export s "$work/s"
(
  export GLASSWING_CERTIFICATE=$work/certificates/guest.pem GLASSWING_KEY=$work/certificates/guest.key
  glasswing show s >/dev/null || fail "a viewer cannot see the session"
  refused 'DeleteSession is for the roles operator, deleter; "guest" has viewer' glasswing delete s --yes
)
grep -q 'audit refused rpc=SessionService/DeleteSession caller="guest" roles=viewer' "$work/server.log" || fail "the refusal is not in the log"
grep -q 'audit rpc=SessionService/SolveSession caller="me" roles=operator' "$work/server.log" || fail "the caller of the solve is not in the log"
glasswing composite "$work/s.exr" --background "$root/deploy/pictures/quilt.png" -o "$work/s.png"

echo "== a solver with --until-idle ends when there is no work"
timeout 30 "$bin/glasswing-solver" --server "$GLASSWING_SERVER" --until-idle 1 --certificate "$work/certificates/machine.pem" --key "$work/certificates/machine.key" 2>"$work/idle.log" || fail "it did not end"

echo "== a daemon that other machines reach names the options that it lacks"
says() { # WORDS PROGRAM OPTIONS...
  if env -u GLASSWING_CA -u GLASSWING_CERTIFICATE -u GLASSWING_KEY timeout 20 "$bin/$2" "${@:3}" 2>"$work/stderr"; then fail "accepted: ${*:2}"; fi
  grep -qF -- "$1" "$work/stderr" || fail "\"$(cat "$work/stderr")\" does not say \"$1\""
}
needs_tls="--listen is 0.0.0.0:0, which other machines reach: they need TLS; set --ca, --certificate and --key"
says "$needs_tls" glasswing-server --listen 0.0.0.0:0 --data "$work/none"
says "$needs_tls" glasswing-display --listen 0.0.0.0:0
says "$needs_tls" glasswing-camera --listen 0.0.0.0:0 --data "$work/none"
says "$needs_tls" glasswing-solver --listen 0.0.0.0:0
says "set --advertise HOST:PORT" glasswing-console --listen 0.0.0.0:0
says "--listen is 0.0.0.0:0, which other machines reach: it needs TLS; set --ca, --certificate and --key" \
  glasswing-console --listen 0.0.0.0:0 --advertise rig.lab:7480
says "set --advertise HOST:PORT" glasswing-server --listen 0.0.0.0:0 --data "$work/none" \
  --ca "$GLASSWING_CA" --certificate "$GLASSWING_CERTIFICATE" --key "$GLASSWING_KEY"
says "the certificate cannot be read: cannot open $work/none.pem" glasswing-server --data "$work/none" \
  --ca "$GLASSWING_CA" --certificate "$work/none.pem" --key "$GLASSWING_KEY"
echo "all checks passed"
