#!/bin/bash
# The package and its examples hold what their types promise.
set -euo pipefail
source=$(cd "$(dirname "$0")/../../../client/python" && pwd)
cache=$(mktemp -d)
trap 'rm -rf "$cache"' EXIT
cd "$PYTHONPATH"
mypy --config-file "$source/mypy.ini" --cache-dir "$cache" -p glasswing
MYPYPATH=$PYTHONPATH mypy --config-file "$source/mypy.ini" --cache-dir "$cache" --scripts-are-modules "$source"/examples/*.py
