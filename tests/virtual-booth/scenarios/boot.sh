# Scenario: the guest itself.
# does: the guest boots, sees the host's files and writes nothing to them
# limit: 30
set -eu
marker=/usr/booth-marker-$$
touch "$marker"
[ -e "$marker" ] || fail "the guest's layer above the host's files does not take a file"
[ -d /sys/devices/platform/vhci_hcd.0 ] || fail "the kernel has no USB/IP host controller"
grep -q ' 0' /sys/devices/platform/vhci_hcd.0/status || fail "the USB/IP host controller lists no ports"
figure "kernel $(uname -r), up $(cut -d' ' -f1 /proc/uptime) s"
