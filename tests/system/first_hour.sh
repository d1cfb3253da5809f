#!/bin/bash
# A first hour with a rig: the commands of README's "A session, step by step" as they stand there, then common
# mistakes, each with the message that must be printed. No mistake changes what the rig holds.
source "$(dirname "$0")/rig.sh"
export PATH=$bin:$PATH
trap '"$root/deploy/local-rig" down --data "$work/rig" >/dev/null; rm -rf "$work"' EXIT

mistakes=0
mistake() { # STATUS WORDS ARGUMENTS...: glasswing fails with STATUS, in one line that contains WORDS
  local expected=$1 words=$2 status=0
  shift 2
  "$bin/glasswing" "$@" >"$work/stdout" 2>"$work/stderr" || status=$?
  [[ $status == "$expected" ]] || fail "glasswing $*: status $status, not $expected: $(cat "$work/stderr")"
  [[ $(wc -l <"$work/stderr") == 1 ]] || fail "glasswing $*: not one line: $(cat "$work/stderr")"
  grep -qF -- "glasswing: " "$work/stderr" && grep -qF -- "$words" "$work/stderr" ||
    fail "glasswing $*: \"$(cat "$work/stderr")\" does not say \"$words\""
  ((++mistakes))
}

ln -s "$root/deploy" "$work/deploy"
cd "$work"
mapfile -t commands < <(sed -n '/^deploy\/local-rig up/,/^deploy\/local-rig down/p' "$root/README.md" |
  grep -E '^(deploy/local-rig|glasswing|mkdir) ' | sed 's/  *#.*//')
((${#commands[@]} >= 12)) || fail "README has only ${#commands[@]} commands"

says() { # WORDS: the last command printed them
  grep -qF -- "$1" "$work/printed" || fail "it does not print \"$1\": $(cat "$work/printed")"
}
for command in "${commands[@]}"; do
  echo "\$ $command"
  case $command in
    "deploy/local-rig up"*) command+=" --data $work/rig --solvers 2" ;;
    "deploy/local-rig down") break ;; # the mistakes need it
    "glasswing preview "*) command+=" --count 1" ;;
  esac
  eval "$command" >"$work/printed" 2>&1 || fail "$command: $(cat "$work/printed")"
  case $command in
    "deploy/local-rig up"*) says "export GLASSWING_SERVER=$server" ;;
    "glasswing nodes") for node in display-1 camera-1 solver-1 solver-2; do says "$node"; done ;;
    "glasswing doctor") says "proof" ;;
    "glasswing preview"*) says "; focus " ;;
    *"calibrate all"*) says "back uses linear 16-bit codes" ;;
    "glasswing plan make"*) says "images with the object" ;;
    *--dry-run) says "rig       free" && steps=$(sed -n 's/^steps  *\([0-9]*\).*/\1/p' "$work/printed") ;;
    "glasswing capture"*) says "session vase is captured: $steps steps" ;;
    "glasswing solve"*) says "session vase is done" ;;
    "glasswing fetch"*) says "vase.exr: the matte of session vase" ;;
    "glasswing composite"*) [[ -s vase.png ]] || fail "there is no picture" ;;
  esac
done

echo "== a chart to focus on, a plan that fits, and what a session waits for"
glasswing preview --pattern lines --count 1 >printed
grep -Eq '; focus (0\.[1-9]|1\.0)' printed || fail "lines are not in focus: $(cat printed)"
glasswing plan make --for-rig --quality draft -o draft.txtpb 2>printed
says "images with the object"
glasswing plan check draft.txtpb --for-rig 2>printed
[[ ! -s printed ]] || fail "a plan that was made for the rig does not fit it: $(cat printed)"
glasswing plan check deploy/plans/crystal.txtpb --monitor back:1920x1080 2>printed
says "the finest bars are 16 px wide"

plans=$root/deploy/plans
echo "== mistakes"
mistake 2 'did you mean solve?' solv vase
mistake 2 'did you mean --watch?' solve vase --wach
mistake 2 'session is required (glasswing show --help' show
mistake 1 'modes is "99"; it must be a whole number, 1 to 4' solve vase --method fringe --set modes=99
mistake 1 'option "shine" is not known to gaussian; it has: modes' solve vase --set shine=1
mistake 2 'gausian not in {gaussian' solve vase --method gausian
mistake 1 'the plan uses monitor "left"; the rig has: back' capture "$plans/two-monitors.txtpb"
mistake 1 'README.md:3: ' capture "$root/README.md"
mistake 1 'cannot open nowhere.txtpb' capture nowhere.txtpb
mistake 1 'session "vase" already exists' capture "$plans/quick.txtpb" --session vase
mistake 1 'there is no session "vaes"' fetch vaes -o vaes.exr
mistake 1 'server at 127.0.0.1:1 does not answer' nodes --server 127.0.0.1:1
mistake 1 'the CA is vase.png; it must be a certificate in PEM' nodes --ca vase.png
mistake 1 'it must be white, gray, bars, lines, ramp or black' pattern purple
mistake 1 'names the texture "left"; this matte has: back' composite vase.exr --background left=vase.png -o left.png
mistake 1 'session "vase" is done; it cannot be paused' pause vase
mistake 1 '--monitor is "back"; it must be NAME:WIDTHxHEIGHT' plan make --monitor back
glasswing capture "$plans/quick.txtpb" --session running >/dev/null
mistake 1 'session running is capturing; wait for it, or cancel it first' delete running --yes
mistake 1 'session "running" is capturing; ' fetch running -o running.exr
mistake 1 'the rig is held by session running' capture "$plans/quick.txtpb" --session second
glasswing cancel running >/dev/null
glasswing delete running --yes >/dev/null
((mistakes >= 12)) || fail "only $mistakes mistakes were made"

cp vase.exr before.exr
glasswing fetch vase -o vase.exr >/dev/null
cmp vase.exr before.exr || fail "the matte is another"
[[ $(glasswing sessions --json | grep -c '"name": "vase"') == 1 ]] || fail "vase is gone"

echo "== no solver"
for solver in solver-1 solver-2; do kill "$(cat "$work/rig/run/$solver.pid")"; done
no_solver() { glasswing show vase | matches 'waiting *no solver is running'; }
glasswing solve vase >/dev/null
until_true 20 no_solver || fail "nothing says that there is no solver: $(glasswing show vase)"
glasswing sessions | matches 'waits: no solver is running' || fail "the list does not say so: $(glasswing sessions)"
glasswing cancel vase >/dev/null
[[ $(shown vase state) == SESSION_STATE_DONE ]] || fail "vase is $(shown vase state)"
echo "all checks passed: $mistakes mistakes"
