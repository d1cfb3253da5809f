#!/bin/bash
# Calibrates simulated non-linear devices through separate processes: the curves match the devices, sessions
# record them, and they can be fitted again from their frames.
source "$(dirname "$0")/rig.sh"
export GLASSWING_BIN=$bin
trap '"$root/deploy/local-rig" down --data "$work/rig" >/dev/null || true; rm -rf "$work"' EXIT
"$root/deploy/local-rig" up --data "$work/rig" --port "$port" --solvers 1 --devices real >/dev/null

echo "== an uncalibrated session warns"
glasswing capture "$root/deploy/plans/quick.txtpb" --session before --watch >/dev/null 2>&1 || fail "not captured"
glasswing show before | tee "$work/before.out" | matches "^warning .*calibrate camera" || { cat "$work/before.out"; fail "no warning"; }

echo "== the camera"
glasswing calibrate camera -o "$work" >"$work/camera.out" 2>"$work/camera.err" || { cat "$work/camera.err"; fail "camera not calibrated"; }
cat "$work/camera.out"
grep -q "^  warning" "$work/camera.out" && fail "a good camera gets a warning"
[[ -s $work/camera-camera-1.svg ]] || fail "no picture of the curve"

echo "== the monitor"
glasswing calibrate display -o "$work" >"$work/display.out" 2>"$work/display.err" || { cat "$work/display.err"; fail "display not calibrated"; }
cat "$work/display.out"
grep -q "^  warning" "$work/display.out" && fail "a good monitor gets a warning"
[[ -s $work/monitor-back.svg ]] || fail "no picture of the curve"

# Prints the numbers of the NTH list of this name in a JSON file, one a line.
list() { # NAME FILE NTH
  awk -v wanted="\"$1\": [" -v nth="$3" '
    inside && /\]/ { exit }
    inside { gsub(/[ ,]/, ""); print }
    index($0, wanted) && ++seen == nth { inside = 1 }' "$2"
}
echo "== both match the devices within 0.5 % of full scale at every measured code"
monitor=$work/rig/server/calibration/monitor-back.json
for primary in 1 2 3; do
  list radiance "$monitor" "$primary" | awk '
    { off = $1 - ((NR - 1) / 255) ^ 2.2; off = off < 0 ? -off : off; if (off > worst) worst = off }
    END { printf "monitor, primary: %d codes, worst %.3f %%\n", NR, 100 * worst; exit !(NR == 256 && worst <= 0.005) }' ||
    fail "the monitor's curve is not gamma 2.2"
done
camera=$work/rig/server/calibration/camera-camera-1.json
value() { sed -n "s/^ *\"$1\": \([0-9.e-]*\),\{0,1\}\$/\1/p" "$camera" | sed -n "$2p"; }
for channel in 1 2 3; do
  list light "$camera" "$channel" | awk -v saturation="$(value saturation 1)" -v darkest="$(value darkest_seen "$channel")" \
    -v brightest="$(value brightest_seen "$channel")" '
    function coded(linear, u) { u = linear ^ (1 / 2.2); return 0.5 * u + 0.5 * (3 * u * u - 2 * u * u * u) }
    function value(code, low, high, i) { # the inverse, less the black level
      low = 0; high = 1
      for (i = 0; i < 50; ++i) { if (coded((low + high) / 2) < code) low = (low + high) / 2; else high = (low + high) / 2 }
      return (low - 0.03) / 0.97
    }
    { code = (NR - 1) / 255
      if (code < darkest || code > brightest) next
      light[++seen] = $1; truth[seen] = value(code) / value(saturation)
      along += $1 * truth[seen]; square += $1 * $1 }
    END { # The unit of light is arbitrary, because the code of full scale was never measured.
      for (i = 1; i <= seen; ++i) {
        off = light[i] * along / square - truth[i]; off = off < 0 ? -off : off
        if (off > worst) worst = off
      }
      printf "camera, channel: %d knots, worst %.3f %%, unit off by %.2f %%\n", seen, 100 * worst, 100 * (square / along - 1)
      exit !(seen > 128 && worst <= 0.005) }' ||
    fail "the camera's curve differs"
done

echo "== a session records them"
glasswing capture "$root/deploy/plans/quick.txtpb" --session after --watch >/dev/null 2>&1 || fail "not captured"
glasswing show after | grep "^warning" && fail "a calibrated session has a warning"
glasswing solve after --watch >/dev/null || fail "not solved"
for kind in camera_calibration display_calibrations; do
  grep -q "\"$kind\"" "$work/rig/camera/archives/after/header.json" || fail "the archive lacks $kind"
done
grep -q calibration\" "$work/rig/camera/archives/before/header.json" && fail "an old session was changed"

echo "== it can be fitted again from its frames, and deleted"
session=$(glasswing sessions --json | sed -n 's/.*"name": "\(calibrate-display-[^"]*\)".*/\1/p' | head -n 1)
glasswing calibrate display --session "$session" -o "$work" >"$work/again.out" || fail "not fitted again"
grep -q "gamma" "$work/again.out" || fail "nothing was fitted"
glasswing calibrate forget back
glasswing calibrate list | matches "^monitor" && fail "it was not deleted"
glasswing calibrate forget back 2>"$work/forget.err" && fail "it could be deleted twice"
grep -q "no calibration of \"back\"" "$work/forget.err" || fail "the error does not name what is missing"
glasswing solve "$session" 2>"$work/solve.err" && fail "a calibration session was solved"
cat "$work/solve.err"
echo "all checks passed"
