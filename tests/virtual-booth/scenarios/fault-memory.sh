# Scenario: the memory limit is hit.
# does: systemd's limit of memory (MemoryMax of boothd.slice) is hit in each state of a session: the kernel kills boothd, READY within 10 s, nothing acknowledged is lost
# kernel: time-travel=inf-cpu systemd.show_status=no pty.legacy_count=0
# limit: 1800
# init: systemd
# times: 1
# tools: /lib/systemd/systemd jq
# needs: usb_sensors booth_status boothd boothctl
# BOOTH_TIMES kills in each of three states, under the installed unit with its own rules (OOMPolicy, Restart, slice). Simulated cameras: what a kill does to sensors is tried in "appliance".
set -eu
# until_status NAME=VALUE SECONDS: boothd's status says so
until_status() { "$programs/booth_status" /run/boothd/control.sock --until "$1" "$2" >/dev/null; }
show() { journalctl -b --no-pager -o short-precise -u boothd -u boothd.slice -k | tail -40; }
active() { [ "$(systemctl is-active boothd.service)" = active ]; }
becomes() { until_status "state=$1" 90 || { boothctl status || true; show; fail "boothd does not become $1 $2"; }; }
uptime_now() { cut -d' ' -f1 /proc/uptime; }
killed() { awk '$1 == "oom_kill" { print $2 }' $slice/memory.events; }
limit() { systemctl set-property --runtime boothd.slice "MemoryHigh=$1" "MemoryMax=$2" || fail "the limit of memory cannot be set"; }
slice=/sys/fs/cgroup/boothd.slice
held() { awk -v k="$1" '$1 == k { print $2 }' $slice/memory.stat; }
# A neighbour in the slice that takes memory until the limit is hit, and that the kernel may not choose: it wants all that can be given back and half of what boothd holds. (A limit that is
# set below what is held would be hit at once, but then the guest's kernel, which has one processor, waits in a loop for a process that it does not let run.)
hit_the_limit() {
  local room=33554432
  limit infinity $(($(cat $slice/memory.current) + room))
  local wanted=$((room + $(held file) - $(held shmem) + $(held anon) / 2))
  mkdir -p $slice/neighbour
  (
    echo "$BASHPID" >$slice/neighbour/cgroup.procs
    echo -1000 >/proc/self/oom_score_adj
    head -c $wanted /dev/zero | tail -n 1 | wc -c >/dev/null
  )
  limit 3G 4G
}

within 90 active || { show; fail "boothd is not ready after the boot"; }
cat >/etc/boothd/boothd.toml.d/zz-simulated.toml <<EOT
[cameras]
driver = "synthetic"
minimum = 1
[cameras.synthetic]
count = 2
motion = "a-pose"
[dds]
enabled = false
EOT
systemctl stop booth-sensors
systemctl restart boothd || { show; fail "boothd does not start with simulated cameras"; }
until_status running=2 60 || { boothctl status; show; fail "not all cameras run"; }
[ "$(systemctl show -P OOMPolicy boothd)" = stop ] || fail "the unit has lost its OOMPolicy"

sessions=/var/lib/boothd/sessions
worst=0 worst_whole=0 kills=0 frames_told=0 frames_kept=0 most_lost=0
for round in $(seq "$BOOTH_TIMES"); do
  for state in idle estimating tracking; do
    # A session that is complete before: it may not change.
    boothctl start >/dev/null || fail "a session is refused before kill $kills"
    becomes tracking "before kill $kills"
    boothctl stop --wait >/dev/null || fail "a session does not end before kill $kills"
    whole_sum=$(cd $sessions && find . -mindepth 2 -type f | sort | xargs sha256sum)
    folder= told=0
    if [ $state != idle ]; then
      boothctl start >/dev/null || fail "a session is refused"
      # Estimating may be over before anybody looks.
      if [ $state = tracking ]; then becomes tracking "before kill $kills"; sleep 2; fi
      read -r folder told <<<"$("$programs/booth_status" /run/boothd/control.sock session_folder frames)"
    fi
    before=$(killed) old=$(systemctl show -P MainPID boothd)
    begin=$(uptime_now)
    hit_the_limit
    within 5 eval '[ "$(killed)" -gt '"$before"' ]' || { show; cat $slice/memory.*; fail "the kernel kills nobody although the limit of memory is hit"; }
    within 10 eval 'active && [ "$(systemctl show -P MainPID boothd)" != '"$old"' ]' || { systemctl status boothd --no-pager || true; show; fail "boothd is not READY again within 10 s ($state)"; }
    ready=$(awk -v a="$begin" '{ printf "%.1f", $1 - a }' /proc/uptime)
    until_status running=2 30 || { boothctl status; show; fail "the cameras do not come back within 30 s ($state)"; }
    all=$(awk -v a="$begin" '{ printf "%.1f", $1 - a }' /proc/uptime)
    kills=$((kills + 1))
    worst=$(awk -v a="$worst" -v b="$ready" 'BEGIN { print (a > b ? a : b) }')
    worst_whole=$(awk -v a="$worst_whole" -v b="$all" 'BEGIN { print (a > b ? a : b) }')
    if [ -n "$folder" ]; then
      result=$(jq -r .result "$folder/session.json") || fail "the session that ran has no session.json"
      [ "$result" = interrupted ] || fail "the session that ran is \"$result\", not interrupted"
      kept=$(jq .frames "$folder/session.json")
      [ $((kept + 30)) -ge "$told" ] || fail "of the session $told frames were published and $kept are kept"
      frames_told=$((frames_told + told)) frames_kept=$((frames_kept + kept))
      [ $((told - kept)) -le $most_lost ] || most_lost=$((told - kept))
      after=$(cd $sessions && find . -mindepth 2 -type f -not -path "./$(basename "$folder")/*" | sort | xargs sha256sum)
    else
      after=$(cd $sessions && find . -mindepth 2 -type f | sort | xargs sha256sum)
    fi
    [ "$after" = "$whole_sum" ] || { echo "$whole_sum"; echo "$after"; fail "files of complete sessions changed when boothd was killed ($state)"; }
  done
done
figure "$kills kills by the kernel, $BOOTH_TIMES in each of idle, estimating, tracking; READY at most $worst s after the limit was set, all cameras $worst_whole s"
figure "sessions that ran had told of $frames_told frames, $frames_kept are kept; of none more than $most_lost of those told are lost"
[ "$(systemctl show -P Result boothd)" = success ] || fail "the unit ends in $(systemctl show -P Result boothd)"
