# Sourced by the tests of docs/clusters.md.
recipe() { # NAME: the code that the page shows under `NAME`:
  local code
  code=$(awk -v name="\`$1\`:" '$0 == name { found = 1 } found && /^```/ { if (inside) exit; inside = 1; next } inside' "$root/docs/clusters.md")
  [[ -n $code ]] || fail "docs/clusters.md has no $1"
  echo "$code"
}
