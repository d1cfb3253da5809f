#!/bin/bash
# Live mattes with separate processes: the output, refused options, and the hold of the rig.
source "$(dirname "$0")/rig.sh"
trap '"$root/deploy/local-rig" down --data "$work/rig" >/dev/null || true; kill $(jobs -p) 2>/dev/null || true; wait; rm -rf "$work"' EXIT
unset DISPLAY
width=320 height=240
"$root/deploy/local-rig" up --data "$work/rig" --port "$port" --solvers 1 --scene wobble --size ${width}x$height --fps 60 >/dev/null
back=$root/deploy/pictures/harbour.png
live() { glasswing live --background "$back" "$@"; }

live --output "$work/frames/" --frames 5 --json >"$work/live.json" || fail "live failed"
[[ $(ls "$work/frames") == $(printf '%06d.png\n' {0..4}) ]] || fail "not five pictures: $(ls "$work/frames")"
[[ $(field frames "$work/live.json") == 5 ]] || fail "it reports $(field frames "$work/live.json") frames"
(($(field object_pixel_count "$work/live.json") > width * height / 20)) || fail "it found no object"

live --output - --frames 3 >"$work/live.y4m" 2>"$work/live.log" || fail "a stream failed: $(cat "$work/live.log")"
head -n 1 "$work/live.y4m" | matches "^YUV4MPEG2 W$width H$height F60000:1000 " || fail "no YUV4MPEG2 header"
bytes=$(($(stat -c %s "$work/live.y4m") - $(head -n 1 "$work/live.y4m" | wc -c)))
((bytes == 3 * (6 + 3 * width * height))) || fail "a stream of three frames has $bytes bytes"

live --output - --frames 1 --json >"$work/live.y4m" 2>"$work/live.json" || fail "a stream with --json failed"
[[ $(field frames "$work/live.json") == 1 ]] || fail "beside a stream it reports: $(cat "$work/live.json")"

refused() { # WORDS OPTIONS...: live fails and prints WORDS
  local words=$1
  shift
  "$bin/glasswing" live "$@" >"$work/out" 2>&1 && fail "live $* succeeded"
  grep -q -e "$words" "$work/out" || fail "live $* prints: $(cat "$work/out")"
}
refused "there is no X display" --background "$back"
refused "no.such.png" --background "$work/no.such.png" --output /dev/null
refused 'there is no monitor "front"' --background "$back" --output /dev/null --monitor front
refused "exposure_ms" --background "$back" --output /dev/null --exposure-ms 500
refused "no_such_option" --background "$back" --output /dev/null --set no_such_option=1
refused "cannot write" --background "$back" --output "$work/none/live.y4m"

# One live call at a time; a killed one releases the rig.
"$bin/glasswing" live --background "$back" --output "$work/held.y4m" &
holder=$!
until_true 30 test -s "$work/held.y4m" || fail "the first live call shows nothing"
refused 'the rig is held by live, started by' --background "$back" --output /dev/null
kill -KILL $holder
until_true 20 live --output /dev/null --frames 1 >/dev/null || fail "the rig was not released"

# It ends when the camera goes away.
rm -f "$work/held.y4m"
"$bin/glasswing" live --background "$back" --output "$work/held.y4m" >"$work/out" 2>&1 &
holder=$!
until_true 30 test -s "$work/held.y4m" || fail "live shows nothing"
kill -KILL "$(cat "$work/rig/run/camera-1.pid")"
wait $holder && fail "it continued without a camera"
grep -q "camera node" "$work/out" || fail "without a camera it prints: $(cat "$work/out")"
echo "live mattes: all checks passed"
