# Sourced by the scripts in guest/: sets up the devices of the guest and waits for them.

until_true() { # SECONDS COMMAND...: repeats the command until it succeeds; fails after SECONDS
  local deadline=$((SECONDS + $1))
  until "${@:2}" 2>/dev/null; do
    ((SECONDS < deadline)) || return 1
    sleep 0.1
  done
}

# Creates three cards with a monitor each, /dev/dri/card0 to card2.
load_monitors() {
  modprobe -a vkms vkms2 vkms3
  until_true 20 test -e /dev/dri/card2
}

# Xorg and libcamera enumerate devices with udev, which must run before they start.
start_udev() {
  /lib/systemd/systemd-udevd --daemon
  udevadm trigger
  udevadm settle -t 60
}
