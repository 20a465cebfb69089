# Scenario: boothd itself on a kernel's USB.
# does: without sensors boothd names the first that it misses and ends with 69; then it finds four by their serials, follows somebody who walks and leaves a whole session; boothctl doctor sees the sensors
# kernel: usbcore.usbfs_memory_mb=256 time-travel=inf-cpu
# limit: 280
# needs: usb_sensors
set -eu
bin=$BOOTH_BUILD/bin
start_udev

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
driver = "kinect2"
[cameras.kinect2]
serials = ["000000000001", "000000000002", "000000000003", "000000000004"]
cache = "/run/booth/cache"
EOF

# At a boot the sensors may come after boothd: a service manager starts it again after this status.
status=0
"$bin/boothd" --config boothd.toml >boothd.out 2>&1 || status=$?
[ $status = 69 ] && grep -q '000000000001 is not on the bus' boothd.out || { cat boothd.out; fail "boothd ends with $status without sensors, and does not name one of them"; }

"$programs/usb_sensors" 10 >sensors.out &
sensors=$!
for _ in $(seq 100); do grep -q 'plugged in' sensors.out && break; sleep 0.1; done
seen() { cat /sys/bus/usb/devices/*/serial 2>/dev/null | grep -c '^00000000000[1-4]' || true; }
for _ in $(seq 100); do [ "$(seen)" = 4 ] && break; sleep 0.1; done
[ "$(seen)" = 4 ] || fail "the kernel shows $(seen) sensors of 4: $(cat sensors.out)"

# What is wrong with this machine (no clock service, no real controller) is not asked here: whether it sees four sensors is.
"$bin/boothctl" doctor --config boothd.toml >doctor.out 2>&1 || true
grep 'sensors:' doctor.out | sed 's/^ */figure: doctor: /'
grep -q 'not plugged in' doctor.out && { cat doctor.out; fail "boothctl doctor does not see the sensors"; }

"$bin/boothd" --config boothd.toml >boothd.out 2>&1 &
boothd=$!
ctl() { "$bin/boothctl" "$@" --socket /run/booth/control.sock; }
for _ in $(seq 200); do grep -q 'is ready' boothd.out && break; sleep 0.1; done
grep -q 'is ready' boothd.out || { cat boothd.out; fail "boothd does not become ready"; }
ctl start >/dev/null
for _ in $(seq 100); do ctl status | grep -q tracking && break; sleep 0.1; done
ctl status | grep -q tracking || { ctl status; cat boothd.out; fail "nobody is tracked"; }
sleep 3
ctl status | sed 's/^/figure: /'
ctl stop --wait >/dev/null
kill -TERM $boothd && wait $boothd || fail "boothd ended with status $?"
kill -TERM $sensors && wait $sensors || fail "the sensors ended with status $?"

session=$(ls -d sessions/*/ | head -1)
[ -n "$session" ] || fail "no session was left"
for file in session.json skeleton.csv skeleton.bvh body.ply; do [ -s "$session$file" ] || fail "$session$file is missing"; done
figure "session: $(tr -d '\n ' <"${session}session.json" | grep -o '"frames":[0-9]*\|"groups_dropped":[0-9]*\|"fps":[0-9.]*\|"state_at_end":"[a-z]*"' | tr '\n' ' ')"
frames=$(tr -d '\n ' <"${session}session.json" | grep -o '"frames":[0-9]*' | cut -d: -f2)
[ "$frames" -ge 20 ] || { cat boothd.out; fail "only $frames frames in three seconds at 10 a second"; }
