#!/bin/bash
# What an electrician and an administrator do before boothd is switched on: a chip with button and lamp, a network with another machine on it, the configuration.
set -eu
chip=/sys/kernel/config/gpio-sim/booth
mountpoint -q /sys/kernel/config || mount -t configfs config /sys/kernel/config
mkdir -p $chip/bank0/line0 $chip/bank0/line1
echo 4 >$chip/bank0/num_lines
echo booth-wall >$chip/bank0/label
echo button >$chip/bank0/line0/name
echo lamp >$chip/bank0/line1/name
echo 1 >$chip/live
lines=/sys/devices/platform/$(cat $chip/dev_name)/$(cat $chip/bank0/chip_name)
echo pull-up >"$lines/sim_gpio0/pull"
ln -sfn "$lines" /run/booth-lines

# The other machine is a network namespace; its end of the cable has the same name, so that one configuration serves both.
ip netns add visitor
ip link add booth0 type veth peer name booth0 netns visitor
ip address add 10.77.0.1/24 dev booth0
ip link set booth0 up
ip -n visitor address add 10.77.0.2/24 dev booth0
ip -n visitor link set booth0 up
ip -n visitor link set lo up

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
