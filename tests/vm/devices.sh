# For the scripts in guest/: the devices of the guest, and waiting for them.

until_true() { # SECONDS COMMAND...: asks again until it holds
  local deadline=$((SECONDS + $1))
  until "${@:2}" 2>/dev/null; do
    ((SECONDS < deadline)) || return 1
    sleep 0.1
  done
}

# Three cards with a monitor each, /dev/dri/card0 to card2.
load_monitors() {
  modprobe -a vkms vkms2 vkms3
  until_true 20 test -e /dev/dri/card2
}

# Programs that ask udev which devices there are (Xorg, libcamera) need it before they start.
start_udev() {
  /lib/systemd/systemd-udevd --daemon
  udevadm trigger
  udevadm settle -t 60
}
