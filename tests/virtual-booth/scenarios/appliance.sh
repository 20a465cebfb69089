# Scenario: the whole appliance.
# does: systemd boots the installed package; four sensors on USB, button and lamp on a gpiochip, a subscriber on another network: a visit from the press to the files
# kernel: time-travel=inf-cpu systemd.show_status=no pty.legacy_count=0
# limit: 600
# init: systemd
# tools: /lib/systemd/systemd jq ip
# needs: usb_sensors light_watch booth_status boothd boothctl
set -eu
ctl() { ip netns exec visitor boothctl "$@"; }
# How far it is, on the console only: seconds on the host's clock and on the guest's.
step() { echo "step: $1 after $(echo "$(host_time) $(stat -c %.3Y "$BOOTH_FOLDER/booted")" | awk '{ printf "%.0f", $1 - $2 }') s, $(cut -d. -f1 /proc/uptime) of the guest's"; }
socket=/run/boothd/control.sock
# until_status NAME=VALUE SECONDS: boothd's status says so
until_status() { "$programs/booth_status" $socket --until "$1" "$2" >/dev/null; }
becomes() {
  until_status "state=$1" "$2" && return
  boothctl status || true
  journalctl -u boothd --no-pager | tail -30
  fail "boothd does not become $1"
}
running() { until_status running=4 60; }
active() { [ "$(systemctl is-active boothd.service)" = active ]; }
lines=/run/booth-lines
press() { echo pull-down >$lines/sim_gpio0/pull; sleep 0.2; echo pull-up >$lines/sim_gpio0/pull; }
show() { journalctl -b --no-pager -o short-precise | grep -E "boothd|booth-|udevd" | tail -40; }

within 90 active || { show; systemctl status boothd --no-pager || true; fail "boothd is not ready after the boot"; }
: >"$BOOTH_FOLDER/ready"
wall=$(echo "$(stat -c %.3Y "$BOOTH_FOLDER/ready") $(stat -c %.3Y "$BOOTH_FOLDER/booted")" | awk '{ printf "%.1f", $1 - $2 }')
# One question of systemd for all that is asked.
eval "$(systemctl show boothd -p ActiveEnterTimestampMonotonic,NRestarts,MainPID)"
ready=$(awk -v a="$ActiveEnterTimestampMonotonic" 'BEGIN { printf "%.1f", a / 1e6 }')
figure "$(cat "$BOOTH_FOLDER/what")"
figure "READY $ready s after the kernel's start on the guest's clock, $wall s after systemd's start on the host's"
[ "$NRestarts" = 0 ] || { show; fail "boothd needed $((NRestarts + 1)) starts although its sensors are there"; }
[ "$(stat -c %U "/proc/$MainPID")" = boothd ] || fail "boothd does not run as its user"
[ "$(cat /sys/module/usbcore/parameters/usbfs_memory_mb)" = 256 ] || fail "the package did not raise the memory of usbfs"
running || { boothctl status; show; fail "not all four cameras run"; }
ls /dev/boothd | sed 's/^/figure: \/dev\/boothd\//' | head -4
[ "$(ls /dev/boothd | wc -l)" = 4 ] || fail "udev gives the sensors no names of their own"
sleep 0.5
[ "$(cat $lines/sim_gpio1/value)" = 1 ] || fail "the light is not lit although boothd is ready"

"$programs/light_watch" $lines/sim_gpio1/value >/run/light.out &
watch=$!
step "a visit"
press
becomes tracking 90
step "tracked"
ctl watch '*' --json --seconds 2 >/run/heard 2>/run/heard.err || { cat /run/heard.err; fail "the subscriber on the other network hears nothing"; }
sleep 1
press
becomes idle 60
kill -TERM $watch && wait $watch || true
heard=$(grep -c serial_number /run/heard || true)
figure "heard over DDS, secured, on the other network: $heard skeletons in 2 s"
[ "$heard" -ge 6 ] || { head -3 /run/heard; cat /run/heard.err; fail "only $heard skeletons were heard"; }
figure "light: $(wc -l </run/light.out) changes during the visit"
[ "$(wc -l </run/light.out)" -ge 5 ] || { cat /run/light.out; fail "the light did not tell of the visit"; }

step "the files"
# The files, as a visitor's program fetches them.
folder=$(find /var/lib/boothd/sessions -mindepth 1 -maxdepth 1 -type d)
[ "$(echo "$folder" | wc -l)" = 1 ] || fail "there is not one session: $folder"
[ "$(stat -c '%a %U' "$folder")" = "700 boothd" ] || fail "others may read the session"
mkdir /run/fetched
boothctl export "$(basename "$folder")" --format bvh,csv,glb,fbx,ply --out /run/fetched >/dev/null || fail "the session cannot be exported"
for file in /run/fetched/*; do mv "$file" "/run/fetched/session.${file##*.}"; done
[ "$(jq -r .result "$folder/session.json")" = complete ] || { cat "$folder/session.json"; fail "the session is not complete"; }
frames=$(jq .frames "$folder/session.json")
[ "$frames" -ge 12 ] || fail "only $frames frames"
[ "$(wc -l <"$folder/skeleton.csv")" = $((frames + 1)) ] || fail "skeleton.csv has not a line for each of $frames frames"
cmp -s "$folder/skeleton.csv" /run/fetched/session.csv || fail "what was fetched differs from what was written"
[ "$(head -c 4 /run/fetched/session.glb)" = glTF ] || fail "session.glb is no glTF"
[ "$(od -An -tu4 -j8 -N4 /run/fetched/session.glb | tr -d ' ')" = "$(stat -c %s /run/fetched/session.glb)" ] || fail "session.glb has not the length that it names"
grep -q '^HIERARCHY' /run/fetched/session.bvh || fail "session.bvh is no BVH"
[ "$(head -c 3 /run/fetched/session.ply)" = ply ] || fail "session.ply is no PLY"
head -c 20 /run/fetched/session.fbx | grep -q Kaydara || fail "session.fbx is no FBX"
stature=$(jq '.. | .stature? // empty | if type == "object" then .value else . end' "$folder/measurements.json" | head -1)
figure "session: $frames frames, $(jq .fps "$folder/session.json") frames/s of 10, nothing dropped: $(jq .groups_dropped "$folder/session.json"); stature ${stature:-?}"

step "cables"
# All cables out and in again, as when somebody stumbles over the hub's plug.
systemctl stop booth-sensors
until_status paused=true 30 || { boothctl status; fail "boothd does not notice that the cameras are gone"; }
active || fail "boothd ended because its cameras were pulled"
begin=$(cut -d' ' -f1 /proc/uptime)
systemctl start booth-sensors
running || { boothctl status; show; fail "the cameras do not come back"; }
figure "four cables pulled and put back: all cameras run $(awk -v a="$begin" '{ printf "%.1f", $1 - a }' /proc/uptime) s later, boothd did not end"

step "killed"
# The program dies in the middle of the next visit.
press
becomes estimating 90
sleep 1
old=$(systemctl show -P MainPID boothd)
kill -KILL "$old"
begin=$(cut -d' ' -f1 /proc/uptime)
within 30 eval 'active && [ "$(systemctl show -P MainPID boothd)" != '"$old"' ]' || { show; fail "boothd does not come back"; }
figure "killed during the next visit: ready again $(awk -v a="$begin" '{ printf "%.1f", $1 - a }' /proc/uptime) s later"
running || { boothctl status; show; fail "the cameras do not come back after boothd was killed"; }
figure "all cameras $(awk -v a="$begin" '{ printf "%.1f", $1 - a }' /proc/uptime) s later"
jq -r '.result + " " + (.frames | tostring)' /var/lib/boothd/sessions/*/session.json | sed 's/^/figure: session: /'
[ "$(jq -r .result /var/lib/boothd/sessions/*/session.json | sort | tr '\n' ' ')" = "complete interrupted " ] || fail "the visit that was cut short was not kept"
step "a wrong configuration"
# It ends within milliseconds, and still the journal knows whose sentence it was.
systemctl stop boothd
mkdir -p /etc/boothd/boothd.toml.d
echo 'booth.id = 17' >/etc/boothd/boothd.toml.d/wrong.toml
systemctl start boothd 2>/dev/null && fail "boothd starts with a wrong configuration"
within 20 eval 'journalctl -u boothd --no-pager | grep -q "wrong.toml:1: booth.id"' || { show; fail "the journal of boothd does not say file, line and key"; }
[ "$(systemctl is-failed boothd)" = failed ] && [ "$(systemctl show -P NRestarts boothd)" = 0 ] || fail "a wrong configuration is tried again"
rm /etc/boothd/boothd.toml.d/wrong.toml

journalctl -u boothd --no-pager | grep 'is refused' && fail "a system call that boothd needs is refused"
dmesg | grep -iE 'BUG:|use-after-free|general protection|list_(add|del) corruption' && fail "the kernel complains"
true
