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
# A chip with button and lamp on the wall; where its simulated lines are is $lines.
make_wall() {
  local chip=/sys/kernel/config/gpio-sim/booth
  mkdir -p $chip/bank0/line0 $chip/bank0/line1
  echo 4 >$chip/bank0/num_lines
  echo booth-wall >$chip/bank0/label
  echo button >$chip/bank0/line0/name
  echo lamp >$chip/bank0/line1/name
  echo 1 >$chip/live
  lines=/sys/devices/platform/$(cat $chip/dev_name)/$(cat $chip/bank0/chip_name)
}
# Another machine on the booth's network: a network namespace; its end of the cable has the same name, so that one configuration serves both.
make_visitor_network() {
  ip netns add visitor
  ip link add booth0 type veth peer name booth0 netns visitor
  ip address add 10.77.0.1/24 dev booth0
  ip link set booth0 up
  ip -n visitor address add 10.77.0.2/24 dev booth0
  ip -n visitor link set booth0 up
  ip -n visitor link set lo up
}
