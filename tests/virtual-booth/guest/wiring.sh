#!/bin/bash
# What an electrician and an administrator do before boothd is switched on: a chip with button and lamp, a network with another machine on it, the configuration.
set -eu
# shellcheck source=tests/virtual-booth/guest/functions.sh
. "$BOOTH_ROOMS/guest/functions.sh"
mountpoint -q /sys/kernel/config || mount -t configfs config /sys/kernel/config
make_wall
echo pull-up >"$lines/sim_gpio0/pull"
ln -sfn "$lines" /run/booth-lines

make_visitor_network

mkdir -p /etc/boothd/boothd.toml.d
cat >/etc/boothd/boothd.toml.d/site.toml <<EOT
[booth]
id = "virtual"
[cameras]
driver = "kinect2"
[cameras.kinect2]
serials = ["000000000001", "000000000002", "000000000003", "000000000004"]
[fit]
sex = "men"
threads = 1
[gpio]
chip = "booth-wall"
start = "button"
light = "lamp"
[dds]
interface = "booth0"
EOT
# Nobody mounts a booth without its sensors; one whose sensors come late is tried in usb-boothd.
on_the_bus() { local found=(/sys/bus/usb/devices/[0-9]*-[0-9]); [ ${#found[@]} -ge 4 ]; }
within 30 on_the_bus
udevadm settle --timeout=30
