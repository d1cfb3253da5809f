#!/bin/bash
# A release in a copy: dated, tagged, its section of the changelog as the tag's message; twice is refused.
set -euo pipefail
cd "$(dirname "$0")/../.."
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }
git ls-files -z | tar -c --null -T - | tar -x -C "$copy"
cd "$copy"
export GIT_AUTHOR_NAME=test GIT_AUTHOR_EMAIL=test@localhost GIT_COMMITTER_NAME=test GIT_COMMITTER_EMAIL=test@localhost
git init -q && git add -A && git commit -qm copy
version=$(sed -n 's/^## \([0-9.]*\) (unreleased)$/\1/p' CHANGELOG.md | head -n 1)
section=$(sed -n "/^## $version /,/^## /p" CHANGELOG.md | grep -v '^## ' | sed '/./,$!d')

if deploy/release 9.9.9 >out 2>&1; then fail "a version without a section is released"; fi
grep -q '9.9.9' out || fail "$(cat out)"
rm out
deploy/release "$version" || fail "not released"
[[ $(git tag -l --format='%(contents)' "v$version") == "$section" ]] || fail "the tag's message is not the section"
grep -q "^## $version (20[0-9-]*)\$" CHANGELOG.md || fail "the section has no date"
grep -q "^project(glasswing VERSION $version " CMakeLists.txt || fail "the build has another version"
[[ -z $(git status --porcelain) ]] || fail "it left changes"
if deploy/release "$version" >out 2>&1; then fail "it is released twice"; fi
