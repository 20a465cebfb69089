# Scenario: the network goes away, and the clock leaps.
# does: during a session the DDS network is cut, taken down and put back, and the clock leaps by years forwards and back: the session goes on, sessions are kept
# kernel: time-travel=inf-cpu
# limit: 200
# tools: ip
# needs: boothd boothctl
set -eu
bin=$BOOTH_BUILD/bin
make_visitor_network
cat >boothd.toml <<EOT
booth.id = "virtual"
control.socket = "/run/booth/control.sock"
session.directory = "/run/booth/sessions"
record.directory = "/run/booth/recordings"
dds.interface = "booth0"
cameras.synthetic.count = 2
fit.sex = "men"
fit.threads = 1
EOT
"$bin/boothd" --config boothd.toml >boothd.out 2>&1 &
boothd=$!
ctl() { "$bin/boothctl" "$@" --socket /run/booth/control.sock; }
state_now() { ctl status --json | grep -o '"state":"[a-z]*"' | head -1 | cut -d'"' -f4; }
becomes() { within 60 eval '[ "$(state_now)" = '"$1"' ]' || { cat boothd.out; fail "boothd does not become $1 $2"; }; }
frames() { ctl status --json | grep -o '"frames":[0-9]*' | head -1 | cut -d: -f2; }
heard() { ip netns exec visitor "$bin/boothctl" watch '*' --config boothd.toml --json --seconds "$1" 2>/dev/null | grep -c serial_number || true; }
visit() {
  ctl start >/dev/null
  becomes tracking "$1"
  sleep 1
  ctl stop --wait >/dev/null || fail "a session does not end $1"
}
within 60 grep -q 'is ready' boothd.out || { cat boothd.out; fail "boothd is not ready"; }
becomes idle "at the start"
visit "before anything happens"
ctl start >/dev/null
becomes tracking "before the network goes"
[ "$(heard 2)" -ge 10 ] || { cat boothd.out; fail "nobody on the other network hears boothd before the fault"; }

before=$(frames)
ip link set booth0 down
sleep 5
during=$(($(frames) - before))
ip link set booth0 up
begin=$(cut -d' ' -f1 /proc/uptime)
kill -0 $boothd || fail "boothd ended when its network was taken down"
n=0
for _ in 1 2 3 4 5 6; do n=$(heard 5); [ "$n" -ge 10 ] && break; done
figure "interface down for 5 s: $during frames fitted meanwhile; heard again (at most) $(awk -v a="$begin" '{ printf "%.0f", $1 - a }' /proc/uptime) s after it came up, with $n skeletons in 5 s"
[ "$during" -ge 60 ] || fail "only $during frames were fitted while the network was down"
[ "$n" -ge 10 ] || { cat boothd.out; fail "after the interface came up again nobody hears boothd"; }

before=$(frames)
ip address del 10.77.0.1/24 dev booth0
sleep 3
during=$(($(frames) - before))
ip address add 10.77.0.1/24 dev booth0
[ "$during" -ge 30 ] || fail "only $during frames were fitted while the interface had no address"
for _ in 1 2 3 4 5 6; do n=$(heard 5); [ "$n" -ge 10 ] && break; done
figure "address away for 3 s: $during frames fitted meanwhile; $n skeletons in 5 s afterwards"
[ "$n" -ge 10 ] || { cat boothd.out; fail "after the address came back nobody hears boothd"; }
[ "$(state_now)" = tracking ] || fail "the session ended with the network"

for leap in "10 years" "-30 years" "20 years"; do
  before=$(frames)
  date -s "$(date -d "$leap" '+%Y-%m-%d %H:%M:%S')" >/dev/null || fail "the guest's clock cannot be set"
  sleep 4
  kill -0 $boothd 2>/dev/null || { cat boothd.out; fail "boothd ended when the clock leapt by $leap"; }
  during=$(($(frames) - before))
  [ "$during" -ge 40 ] || { cat boothd.out; fail "only $during frames in 4 s after the clock leapt by $leap"; }
  [ "$(state_now)" = tracking ] || { cat boothd.out; fail "the session ended when the clock leapt by $leap"; }
done
ctl stop --wait >/dev/null || { cat boothd.out; fail "the session does not end after the leaps"; }
count() { ls -d sessions/*/ | wc -l; }
[ "$(count)" = 2 ] || fail "there are $(count) sessions of 2"
# The next session's beginning, and the start of boothd, look for what is too old to be kept.
date -s "$(date -d "10 years" '+%Y-%m-%d %H:%M:%S')" >/dev/null
visit "in another decade"
[ "$(count)" = 3 ] || { cat boothd.out; ls sessions; fail "a clock that leapt by ten years cost sessions: $(count) are left of 3"; }
kill -TERM $boothd && wait $boothd || fail "boothd ended with status $?"
"$bin/boothd" --config boothd.toml >boothd.out 2>&1 &
boothd=$!
within 60 grep -q 'is ready' boothd.out || { cat boothd.out; fail "boothd is not ready in another decade"; }
sleep 2
[ "$(count)" = 3 ] || { cat boothd.out; ls sessions; fail "a start with a clock that is ten years ahead cost sessions: $(count) are left of 3"; }
visit "after a start in another decade"
for folder in sessions/*/; do grep -q '"result": "complete"' "$folder/session.json" || { cat "$folder/session.json"; fail "$folder is not complete"; }; done
figure "clock: leaps of +10, -30, +20, +10 years; $(count) sessions of 4 kept, all complete"
[ "$(count)" = 4 ] || fail "there are $(count) sessions of 4"
kill -TERM $boothd && wait $boothd || fail "boothd ended with status $?"
