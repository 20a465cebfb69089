# shellcheck shell=bash
# What every scenario may call, whoever is the guest's first process.
programs=$BOOTH_BUILD/tests/virtual-booth
figure() { echo "figure: $*"; }
fail() { echo "why: $*"; exit 1; }
# libusb learns of arrivals from udev, as on the appliance.
start_udev() {
  [ -x /lib/systemd/systemd-udevd ] || fail "the guest needs udev; install the package udev"
  /lib/systemd/systemd-udevd --daemon 2>/dev/null || fail "udev does not start"
  udevadm trigger --action=add --subsystem-match=usb && udevadm settle --timeout=10
}
# within SECONDS COMMAND...: tries until it succeeds; not often, because a start of boothctl costs the guest a tenth of a second and more
within() {
  local end=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    [ "$SECONDS" -lt "$end" ] || return 1
    sleep 0.5
  done
}
# The host's clock, seconds: the guest's stands still in virtual time. BOOTH_FOLDER is the host's, seen by the guest.
host_time() { : >"$BOOTH_FOLDER/now" && stat -c %.3Y "$BOOTH_FOLDER/now"; }
# In kilobytes of resident memory, process $1
resident() { sed -n 's/^VmRSS:[^0-9]*\([0-9]*\).*/\1/p' "/proc/$1/status"; }
