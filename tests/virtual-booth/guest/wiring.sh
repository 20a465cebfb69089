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
udevadm settle --timeout=30
