# Scenario: boothd with a real gpiochip.
# does: a visitor presses through the kernel and the light is read back; emergency stop, a chip that is pulled out and put back, boothctl doctor on its lines
# kernel: time-travel=inf-cpu
# limit: 170
# needs: boothd boothctl
# In virtual time, so that what the light does is counted exactly however busy the host is; a low rate of frames, so that this takes seconds.
set -eu
bin=$BOOTH_BUILD/bin

sim=/sys/kernel/config/gpio-sim/booth
mkdir -p $sim/bank0 && echo 8 >$sim/bank0/num_lines && echo booth-io >$sim/bank0/label
number=0
for name in start emergency light; do
  mkdir $sim/bank0/line$number && echo $name >$sim/bank0/line$number/name
  number=$((number + 1))
done
plug() { echo 1 >$sim/live; wires=/sys/devices/platform/$(cat $sim/dev_name)/$(cat $sim/bank0/chip_name); up 0; down 1; }
unplug() { echo 0 >$sim/live; }
up() { echo pull-up >"$wires/sim_gpio$1/pull"; }
down() { echo pull-down >"$wires/sim_gpio$1/pull"; }
light() { cat "$wires/sim_gpio2/value"; }
press() { down 0; sleep 0.1; up 0; sleep 0.5; }
# flashes SECONDS: how often the light went on; lit SECONDS: how often of a hundred looks it was on
flashes() { local n=0 last=1 now i; for ((i = 0; i < $1 * 50; ++i)); do now=$(light); [ "$now$last" = 10 ] && n=$((n + 1)); last=$now; sleep 0.02; done; echo $n; }
lit() { local n=0 i; for ((i = 0; i < 100; ++i)); do n=$((n + $(light))); sleep "$(echo "$1" | awk '{ print $1 / 100 }')"; done; echo $n; }
plug

cat >boothd.toml <<EOF
[booth]
id = "virtual"
[control]
socket = "/run/booth/control.sock"
[session]
directory = "/run/booth/sessions"
[dds]
enabled = false
[cameras]
driver = "kinect2-emulated"
[cameras.emulated]
rate = 3
[cameras.synthetic]
motion = "a-pose"
count = 2
[gpio]
chip = "booth-io"
start = "start"
emergency_stop = "emergency"
light = "light"
bias = "as-is"
EOF
ctl() { "$bin/boothctl" "$@" --socket /run/booth/control.sock; }
reaches() { for _ in $(seq 300); do ctl status | grep -q "^state *$1" && return; sleep 0.1; done; ctl status; cat boothd.out; fail "boothd does not become $1"; }
shows() { for _ in $(seq 100); do ctl status | grep -q "$1" && return; sleep 0.1; done; ctl status; cat boothd.out; fail "status does not show: $1"; }

"$bin/boothctl" doctor --config boothd.toml >doctor.out 2>&1 || true
grep -A4 '^gpio' doctor.out | grep -q 'light: line 2 of gpiochip0 ("light") is free' || { cat doctor.out; fail "boothctl doctor does not see the lines"; }

"$bin/boothd" --config boothd.toml >boothd.out 2>&1 &
boothd=$!
for _ in $(seq 200); do grep -q 'is ready' boothd.out && break; sleep 0.1; done
reaches idle
"$bin/boothctl" doctor --config boothd.toml 2>&1 | grep -q 'gpio.start: line 0 of gpiochip0 ("start") is used by boothd' || fail "boothctl doctor does not say who uses the lines"
sleep 1
[ "$(lit 2)" = 100 ] || fail "the light is not steady while idle"

press
blinked=$(flashes 1)
reaches tracking
burning=$(lit 4)
figure "light: $blinked flashes in the first second of looking for a body, on for $burning % of tracking"
[ "$blinked" -ge 3 ] || fail "the light blinked $blinked times in a second, and should four times"
{ [ "$burning" -ge 80 ] && [ "$burning" -lt 100 ]; } || fail "while tracking the light was on for $burning %, and should be for 92 %"

up 1
reaches idle
[ "$(flashes 7)" = 4 ] || fail "fault 1 is one flash every 1.75 s"
press
ctl status | grep -q '^state *idle' || fail "a session began with the emergency stop pressed"
down 1
shows '^light *steady'
grep -q '"reason": "emergency_pressed"' sessions/*/session.json || fail "session.json does not say that the emergency stop ended it"

press
reaches tracking
unplug
reaches idle
shows 'cannot be read and counts as pressed'
figure "$(ctl status | grep -m1 '^panel')"
plug
shows '^light *steady'
for _ in $(seq 50); do [ "$(light)" = 1 ] && break; sleep 0.1; done
[ "$(light)" = 1 ] || fail "the light does not come back with its chip"
press
reaches tracking
press
reaches idle
sleep 1

kill -TERM $boothd && wait $boothd || fail "boothd ended with status $?"
[ "$(light)" = 0 ] || fail "the light burns for a boothd that is not there"
figure "sessions: $(grep -ho '"reason": "[a-z_]*"' sessions/*/session.json | tr '\n' ' ')"
[ "$(grep -l '"result": "complete"' sessions/*/session.json | wc -l)" = 3 ] || fail "three sessions were held, and not all of them are complete"
grep -c 'panel:' boothd.out | sed 's/^/figure: lines in the log about the panel: /'
