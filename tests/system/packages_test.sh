#!/bin/bash
# The Debian packages on a fresh Debian 12, made by debootstrap and booted by systemd-nspawn: they install,
# their daemons capture and solve in their sandboxes, and after removal and purge only captured data is left.
# Needs root, a mirror of Debian, and a machine on which systemd-nspawn can run; takes five minutes.
source "$(dirname "$0")/rig.sh"
build=$(cd "$bin/.." && pwd)
fresh=$work/fresh
skip() { echo "skipped: $*"; exit 77; }
cleanup() {
  if [[ -n ${container-} ]]; then kill -KILL "$container" 2>/dev/null || true; fi
  kill $(jobs -p) 2>/dev/null || true
  wait
  if grep -q " $work/" /proc/mounts; then echo "something is still mounted below $work; it is left there" >&2; else rm -rf --one-file-system "$work"; fi
}
trap cleanup EXIT

((EUID == 0)) || skip "it must be run as root"
mirror=$(apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
  awk '$2 == "bookworm" && $3 == "main" { print $1; exit }')
[[ -n $mirror ]] || skip "apt's sources name no mirror of bookworm main"
timeout 60 /usr/lib/apt/apt-helper download-file "${mirror%/}/dists/bookworm/InRelease" "$work/InRelease" >/dev/null 2>&1 || skip "$mirror does not answer"

echo "== the packages"
cpack --config "$build/CPackConfig.cmake" -B "$work/packages" >"$work/cpack.log" 2>&1 || fail "cpack"
packages=("$work"/packages/*.deb)
((${#packages[@]} == 12)) || fail "${packages[*]} are not twelve packages"
names=() depends=()
for package in "${packages[@]}"; do
  names+=("$(dpkg-deb -f "$package" Package)")
  needs=$(dpkg-deb -f "$package" Depends | sed -E 's/glasswing-[a-z]+ \([^)]*\)(, )?//g')
  [[ -z $needs ]] || depends+=("$needs")
done

echo "== their bill of materials and checksums"
"$root/deploy/sbom" "$work/packages"
(cd "$work/packages" && sha256sum --quiet -c SHA256SUMS) || fail "checksums"
python3 - "$work/packages/glasswing.cdx.json" "${names[@]}" <<'PYTHON' || fail "the bill of materials"
import json, sys
components = {part["name"]: part for part in json.load(open(sys.argv[1]))["components"]}
missing = {*sys.argv[2:], "libgrpc++1.51", "libopenexr-3-1-30", "preact"} - components.keys()
sys.exit(f"{missing} are missing" if missing else 0)
PYTHON

echo "== a fresh Debian with their dependencies"
eval "$(apt-config shell http_proxy Acquire::http::Proxy https_proxy Acquire::https::Proxy)"
export http_proxy=${http_proxy-} https_proxy=${https_proxy-}
debootstrap --variant=minbase --include=systemd-sysv,ca-certificates bookworm "$fresh" "$mirror" >"$work/debootstrap.log" 2>&1 || fail "debootstrap"
echo force-unsafe-io >"$fresh/etc/dpkg/dpkg.cfg.d/unsafe-io"  # Durability is not needed.
cp -L --remove-destination /etc/resolv.conf "$fresh/etc/resolv.conf"
cp -L --remove-destination /etc/ssl/certs/ca-certificates.crt "$fresh/etc/ssl/certs/ca-certificates.crt"
apt-config dump | grep -E '^Acquire::(https?::|Check-Valid-Until|Retries)' >"$fresh/etc/apt/apt.conf.d/90mirror" || true
echo "deb $mirror bookworm main" >"$fresh/etc/apt/sources.list"
chroot "$fresh" sh -c 'apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get satisfy -y -qq --no-install-recommends "$0"' \
  "$(IFS=,; echo "${depends[*]}")" >"$work/apt.log" 2>&1 || fail "their dependencies cannot be installed"
mkdir "$fresh/packages"
cp "${packages[@]}" "$fresh/packages"

echo "== systemd boots it"
systemd-nspawn --quiet --register=no --keep-unit --private-network -D "$fresh" --machine="glasswing-$$" --boot </dev/null >"$work/boot.log" 2>&1 &
nspawn=$!
booted() {
  kill -0 "$nspawn" 2>/dev/null || skip "systemd-nspawn cannot run here: $(tail -n 1 "$work/boot.log")"
  container=$(cat "/proc/$nspawn/task/$nspawn/children")
  container=${container%% *}
  [[ $(inside systemctl is-system-running) =~ ^(running|degraded)$ ]]
}
inside() { nsenter --target "$container" --all --root --wd /usr/bin/env --chdir=/ -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 "$@"; }
until_true 60 booted || fail "it does not boot"
# Lists all files except logs, caches and those that change by themselves.
tree() {
  inside find / -xdev \( -path /packages -o -path /tmp -o -path /var/tmp -o -path /var/log -o -path /var/cache -o -path /var/lib/systemd -o -path /var/lib/dpkg \) -prune -o -print |
    grep -v '/__pycache__' | sort
}

tree >"$work/before"

echo "== after installation: enabled, not started"
inside sh -c 'dpkg -i /packages/*.deb' >"$work/install.log" 2>&1 || fail "dpkg -i"
inside dpkg --verify "${names[@]}"
units=(glasswing-server glasswing-console glasswing-display glasswing-camera glasswing-solver)
[[ $(inside systemctl is-enabled "${units[@]}" | sort -u) == enabled ]] || fail "a unit is not enabled"
[[ $(inside systemctl is-active "${units[@]}" | sort -u) == inactive ]] || fail "a unit was started"
inside sh -c 'systemd-analyze verify --man=no /usr/lib/systemd/system/glasswing-*.service' 2>"$work/complaints" || fail "$(cat "$work/complaints")"
! grep glasswing "$work/complaints" || fail "systemd reports a problem"
version=$("$bin/glasswing" --version)
for program in glasswing glasswing-compositing "${units[@]}"; do
  [[ $(inside "$program" --version) == "$version" ]] || fail "$program is not $version"
  inside "$program" --help >"$work/help" || fail "$program --help"
  section=8
  [[ ! $program =~ ^glasswing(-compositing)?$ ]] || section=1
  inside zgrep -q '^\.TH' "/usr/share/man/man$section/$program.$section.gz" || fail "$program has no manual page"
done
for page in "$build/man/glasswing"/glasswing-*.1 glasswing-demo.1 glasswing-local-rig.1; do
  inside test -s "/usr/share/man/man1/${page##*/}.gz" || fail "there is no manual page ${page##*/}"
done
[[ $(inside python3 -c 'import glasswing; print(glasswing.Matte.__name__)') == Matte ]] || fail "the Python package"

echo "== the demonstration"
begin=$SECONDS
inside env HOME=/root glasswing-demo --output /tmp/demo --stop >"$work/demo.log" 2>&1 || { tail -n 30 "$work/demo.log"; fail "glasswing-demo"; }
echo "glasswing-demo took $((SECONDS - begin)) s"
for file in sheet.png lake.png pebbles_photographed.png crystal.mp4 crystal.webp crystal.exr; do
  inside test -s "/tmp/demo/$file" || fail "the demonstration made no $file"
done
grep -q '^steps retaken  *0$' "$work/demo.log" || fail "$(grep retaken "$work/demo.log")"

echo "== the daemons capture and solve"
cat >"$fresh/etc/glasswing/glasswing.conf" <<'END'
GLASSWING_SERVER=127.0.0.1:7440
GLASSWING_SERVER_OPTIONS="--listen 127.0.0.1:7440"
GLASSWING_DISPLAY_OPTIONS="--listen 127.0.0.1:7441 --name desk --monitor back=128x104@60 --patch-rows 8"
GLASSWING_CAMERA_OPTIONS="--listen 127.0.0.1:7442 --name eye --fps 200 --size 128x104 --scene crystal --tap 127.0.0.1:7441"
GLASSWING_SOLVER_OPTIONS="--threads 2 --metrics 127.0.0.1:7443"
END
journal() { inside journalctl --no-pager -q -u 'glasswing-*' >"$work/journal.log" 2>&1; }
active() { [[ $(inside systemctl is-active "${units[@]}" | sort -u) == active ]]; }
property() { inside systemctl show --value -p "$2" "$1"; } # UNIT NAME
three_up() { (($(inside glasswing nodes --json | grep -c '"up": true') == 3)); }
inside systemctl start "${units[@]}" || { journal; fail "they do not start"; }
until_true 30 active || { journal; fail "they are not active"; }
until_true 30 three_up || { journal; fail "they do not find each other"; }
captured() { # SESSION
  inside glasswing capture /usr/share/glasswing/plans/quick.txtpb --session "$1" --watch && inside glasswing solve "$1" --watch &&
    inside glasswing fetch "$1" -o "/tmp/$1.exr"
}
captured s || { journal; fail "no matte"; }
from_file() { inside bash -c 'exec 3<>/dev/tcp/127.0.0.1/7443; printf "GET /metrics HTTP/1.0\r\n\r\n" >&3; cat <&3' | sed -n 's/^glasswing_archive_bytes_read_total{from="file"} //p'; }
[[ $(from_file) =~ ^[1-9] ]] || fail "the solver does not map the camera's frames: $(from_file)"

echo "== the sandbox holds"
for unit in "${units[@]}"; do
  pid=$(property "$unit" MainPID)
  status=$(inside cat "/proc/$pid/status")
  for line in 'NoNewPrivs:	1' 'Seccomp:	2' 'CapEff:	0000000000000000' 'CapBnd:	0000000000000000'; do grep -qF "$line" <<<"$status" || fail "$unit lacks $line"; done
  sees() { inside nsenter --target "$pid" --mount test "$@"; }
  sees -r /etc/glasswing/glasswing.conf && sees ! -w /etc/glasswing/glasswing.conf && sees ! -w /usr || fail "$unit can write to /etc or /usr"
  inside test -e /root/.profile && sees ! -e /root/.profile || fail "$unit sees /root"
done

echo "== an upgrade restarts the daemons and keeps the configuration"
before=$(property glasswing-server MainPID)
inside sh -c 'dpkg -i /packages/*.deb' >"$work/upgrade.log" 2>&1 || fail "dpkg -i again"
[[ $(property glasswing-server MainPID) != "$before" ]] || fail "the server was not restarted"
grep -q 'listen 127.0.0.1:7440' "$fresh/etc/glasswing/glasswing.conf" || fail "the configuration was replaced"
until_true 30 three_up || { journal; fail "they do not find each other after the upgrade"; }
inside glasswing show s >/dev/null || fail "the session is lost"

echo "== systemd restarts a daemon that hangs"
for unit in "${units[@]}"; do
  inside mkdir -p "/run/systemd/system/$unit.service.d"
  printf '[Service]\nWatchdogSec=3\n' >"$work/watchdog.conf"
  inside sh -c "cat >/run/systemd/system/$unit.service.d/watchdog.conf" <"$work/watchdog.conf"
done
inside systemctl daemon-reload
inside systemctl restart "${units[@]}"
for unit in "${units[@]}"; do
  pid=$(property "$unit" MainPID)
  inside sh -c "kill -STOP $pid"
  restarted() { [[ $(property "$unit" MainPID) != "$pid" && $(property "$unit" ActiveState) == active ]]; }
  until_true 60 restarted || { journal; fail "$unit hangs"; }
done
until_true 30 three_up || { journal; fail "they do not find each other after that"; }
captured t || { journal; fail "no matte after that"; }

echo "== systemctl stop ends them successfully"
inside systemctl stop "${units[@]}"
for unit in "${units[@]}"; do [[ $(property "$unit" Result) == success ]] || { journal; fail "$unit: $(property "$unit" Result)"; }; done

echo "== removed and purged"
inside dpkg --remove "${names[@]}" >"$work/remove.log" 2>&1 || fail "dpkg --remove"
[[ -e $fresh/etc/glasswing/glasswing.conf && -d $fresh/var/lib/glasswing/server ]] || fail "removal deleted the configuration or captured data"
inside dpkg --purge "${names[@]}" >"$work/purge.log" 2>&1 || fail "dpkg --purge"
for state in server camera; do
  grep -q "/var/lib/glasswing/$state is left, as it holds data" "$work/purge.log" || fail "purge does not say that $state is left"
  [[ -n $(ls "$fresh/var/lib/glasswing/$state") ]] || fail "purge deleted captured data: $state"
done
rm -rf "$fresh/var/lib/glasswing"
tree >"$work/after"
diff "$work/before" "$work/after" || fail "these files are left over or missing"
! inside dpkg -l 'glasswing*' python3-glasswing 2>/dev/null | grep -E '^[a-z]i|^rc' || fail "dpkg still lists them"
inside systemctl poweroff
wait "$nspawn" || true
echo "all checks passed"
