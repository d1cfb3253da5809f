# Sourced by shell tests and benchmarks that start daemons.

free_port() { # COUNT: the first of COUNT free loopback ports in a row, below those that the kernel gives to outgoing calls
  local first p
  while first=$((10000 + RANDOM % 22000)); do
    for ((p = first; p < first + $1; ++p)); do
      (exec 3<>"/dev/tcp/127.0.0.1/$p") 2>/dev/null && continue 2
    done
    echo "$first"
    return
  done
}
