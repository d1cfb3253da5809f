#!/bin/bash
# The rig's own measurements, with separate processes: the measured lag, doctor's verdicts on good and bad
# rigs, and a preview that does not disturb a capture.
source "$(dirname "$0")/rig.sh"

"$bin/glasswing-server" --listen "$server" --data "$work/server" >"$work/server.log" 2>&1 &
display() { # OPTIONS...
  "$bin/glasswing-display" --listen "127.0.0.1:$((port + 1))" --server "$server" "$@" >"$work/display.log" 2>&1 &
  display=$!
}
camera() { # OPTIONS...
  "$bin/glasswing-camera" --listen "127.0.0.1:$((port + 2))" --server "$server" --name camera-1 --data "$work/camera" \
    --size 48x48 --scene crystal --tap "127.0.0.1:$((port + 1))" "$@" >"$work/camera.log" 2>&1 &
  camera=$!
}
stop() { kill "$1" && wait "$1" || true; }
ready() { until_true 20 up 2 && until_true 20 prepared || fail "the rig did not come up"; }

lag=7.3 settle=4  # ms; the display declares less
truth=(--lag-ms 3 --settle-ms 1 --true-lag-ms "$lag" --true-settle-ms "$settle" --patch-rows 8)

echo "== lag and settling are measured, independent of what the display declares"
display --monitor back=96x96@60 "${truth[@]}"
camera
ready
glasswing calibrate sync --json >"$work/sync.out" || fail "not calibrated"
cat "$work/sync.out"
within() { # FIELD TRUTH_MS TOLERANCE_MS
  awk -v found="$(field "$1" "$work/sync.out")" -v truth="$2" -v most="$3" \
    'BEGIN { off = found / 1e6 - truth; exit !(off < most && off > -most) }' ||
    fail "$1 is $(field "$1" "$work/sync.out"); the truth is $2 ms"
}
within lag_ns "$lag" 0.3
within settle_ns "$settle" 0.6  # a difference of two times, each as accurate as the lag
[[ -s $work/server/calibration/sync.json ]] || fail "it was not stored"

echo "== a preview does not disturb a capture"
# An exposure that fits at any phase of the camera: a picture is steady for 33.3 ms minus scan-out, settling
# and uncertainty, 11.6 ms; exposure, readout and uncertainty take 6 ms, and a frame begins every 5 ms.
sed 's/^exposure_ms.*/exposure_ms: 3/' "$root/deploy/plans/quick.txtpb" >"$work/quick.txtpb"
glasswing capture "$work/quick.txtpb" --session s >/dev/null
glasswing preview -o "$work/live.jpg" --fps 4 --width 24 --count 8 | tee "$work/preview.out"
glasswing show s --json >"$work/during.json"
grep -q CAPTURING "$work/during.json" || fail "the capture was over before the preview"
glasswing watch s || fail "not captured"
(($(wc -l <"$work/preview.out") == 8)) || fail "eight lines were expected"
grep -q " 24x24: " "$work/preview.out" || fail "the preview has the wrong size"
[[ $(head -c 2 "$work/live.jpg" | od -An -tx1) == " ff d8" ]] || fail "live.jpg is no JPEG"
glasswing show s --json >"$work/show.json"
echo "retaken: $(field retaken_count "$work/show.json")"
# On a busy machine some simulated frames are late by themselves.
(($(field retaken_count "$work/show.json") * 20 <= $(field step_count "$work/show.json"))) || fail "steps were retaken"

echo "== a good rig has no problem; doctor reports a wrongly declared lag"
glasswing doctor >"$work/good.out" || fail "doctor found a problem"
cat "$work/good.out"
grep -q "declares 3.00 ms lag" "$work/good.out" || fail "doctor believes the declared lag"
grep -q "back: its id is read" "$work/good.out" || fail "doctor does not see the id patch"

problem() { # SUBJECT [OPTION...]: doctor fails and names SUBJECT
  if glasswing doctor "${@:2}" >"$work/doctor.out" 2>&1; then
    cat "$work/doctor.out"
    fail "doctor did not find the problem"
  fi
  grep -q "^problem *$1" "$work/doctor.out" || { cat "$work/doctor.out"; fail "doctor did not name: $1"; }
  grep "^problem" -A 1 "$work/doctor.out"
}
echo "== an exposure that is too long"
printf 'method: "gaussian"\nsolids { colour: [1, 1, 1] }\nexposure_ms: 4.9\nexposure_ms: 40\n' >"$work/long.txtpb"
problem camera --plan "$work/long.txtpb"
echo "== a camera that is too slow"
stop "$camera"
camera --fps 20
ready
printf 'method: "gaussian"\nsolids { colour: [1, 1, 1] }\nexposure_ms: 30\n' >"$work/slow.txtpb"
problem window --plan "$work/slow.txtpb"
echo "== missed flips"
stop "$camera"
stop "$display"
display --monitor back=96x96@60 "${truth[@]}" --fault-missed-flips 0.4
camera
ready
problem flips
echo "== no camera"
stop "$camera"
until_true 20 up 1 || fail "the camera is still up"
problem nodes
echo "all checks passed"
