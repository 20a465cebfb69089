# Scenario: boothd itself with a button and a light on a real gpiochip.
# does: a press through the kernel begins a session and another ends it, the light's line does what the guide says, a long press is answered, whole files are left
# kernel: time-travel=inf-cpu
# limit: 150
# needs: light_watch boothd boothctl
# In virtual time: the guest's clock stands still while anything computes, so that blinks have their length however busy the host is.
set -eu
bin=$BOOTH_BUILD/bin
make_wall
button() { echo "$1" >"$lines/sim_gpio0/pull"; }
press() { button pull-down; sleep "$1"; button pull-up; }
button pull-up

cat >boothd.toml <<EOT
[booth]
id = "virtual"
[control]
socket = "/run/booth/control.sock"
[session]
directory = "/run/booth/sessions"
[dds]
enabled = false
[cameras.synthetic]
count = 2
[fit]
sex = "men"
threads = 1
[gpio]
chip = "booth-wall"
start = "button"
light = "lamp"
long_press_seconds = 1
EOT

"$programs/light_watch" "$lines/sim_gpio1/value" >light.out &
watch=$!
"$bin/boothd" --config boothd.toml >boothd.out 2>&1 &
boothd=$!
state() { "$bin/boothctl" status --socket /run/booth/control.sock --json | grep -o '"state":"[a-z]*"' | head -1 | cut -d'"' -f4; }
becomes() {
  local turn
  for turn in $(seq 300); do [ "$(state)" = "$1" ] && return; sleep 0.1; done
  cat boothd.out light.out
  fail "boothd does not become $1"
}
for _ in $(seq 300); do grep -q 'is ready' boothd.out && break; sleep 0.1; done
grep -q 'is ready' boothd.out || { cat boothd.out; fail "boothd does not become ready"; }
becomes idle
sleep 0.5
[ "$(cat "$lines/sim_gpio1/value")" = 1 ] || { cat light.out; fail "the light is not lit although boothd is ready"; }

press 1.3
sleep 0.3
[ "$(state)" = idle ] || fail "a long press began a session"
mark() { echo "$1 $(cut -d' ' -f1 /proc/uptime)" >>marks; }
press 0.2
becomes tracking
mark tracking
sleep 4.3
mark done
press 0.2
becomes idle
session=$(ls -d sessions/*/ | head -1)
kill -TERM $boothd && wait $boothd || { cat boothd.out; fail "boothd ended with status $?"; }
sleep 0.1
kill -TERM $watch && wait $watch || fail "light_watch ended with status $?"

# light.out: seconds since boot and the new level, one line for each change.
track=$(sed -n 's/^tracking //p' marks) end=$(sed -n 's/^done //p' marks)
estimating=$(awk -v until="$track" '$1 < until && n && $1 - at > 0.10 && $1 - at < 0.15 { beats++ } { at = $1; n = 1 } END { print beats + 0 }' light.out)
winks=$(awk -v from="$track" -v until="$end" '$1 > from && $1 < until + 0.1 && $2 == 1 && $1 - at > 0.12 && $1 - at < 0.19 { winks++ } { at = $1 } END { print winks + 0 }' light.out)
others=$(awk -v from="$track" -v until="$end" '$1 > from + 0.3 && $1 < until && $2 == 0 { dark++ } END { print dark + 0 }' light.out)
figure "light: $(wc -l <light.out) changes, $estimating quick beats while estimating, $winks winks in 4.3 s of tracking"
[ "$estimating" -ge 2 ] || { cat light.out marks boothd.out; fail "the light did not blink quickly while the body was estimated"; }
{ [ "$winks" -ge 2 ] && [ "$winks" -le 3 ] && [ "$others" -le 3 ]; } || { cat light.out marks; fail "$winks winks of 150 ms and $others times dark while tracking, expected is one every two seconds"; }
[ "$(tail -1 light.out | cut -d' ' -f2)" = 0 ] || { cat light.out; fail "the light still burns for a boothd that has gone"; }

[ "$(ls -d sessions/*/ | wc -l)" = 1 ] || fail "there is not one session: $(ls sessions)"
for file in session.json skeleton.csv skeleton.bvh body.glb body.ply measurements.json; do [ -s "$session$file" ] || fail "$session$file is missing"; done
tr -d '\n ' <"${session}session.json" >flat.json
for word in '"result":"complete"' '"reason":"toggle"' '"source":"gpio","text":"toggle"'; do grep -qF "$word" flat.json || { cat "${session}session.json"; fail "session.json does not say $word"; }; done
frames=$(grep -o '"frames":[0-9]*' flat.json | head -1 | cut -d: -f2)
figure "session: $frames frames, $(wc -l <"${session}skeleton.csv") lines of skeleton.csv"
[ "$frames" -ge 60 ] || { cat boothd.out; fail "only $frames frames in more than four seconds at 30 a second"; }
dmesg | grep -iE 'BUG:|use-after-free|general protection|list_(add|del) corruption' && fail "the kernel complains"
true
