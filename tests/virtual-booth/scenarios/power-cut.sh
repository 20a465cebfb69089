# Scenario: the power goes away.
# does: the guest loses its power in each state of a session, and its disk whatever was not brought to it; after each boot nothing is lost that was acknowledged
# limit: 200
# disk: 256M
# times: 1
# tools: mkfs.ext4
# needs: boothd boothctl booth_status
# In real time: virtual time leaps ahead while the guest waits for its disk. One boot for each cut: look at what the last one left, then do the next thing and ask for the cut. BOOTH_TIMES cuts in each of six states.
set -eu
bin=$BOOTH_BUILD/bin
disk=/run/booth/disk
book=$BOOTH_FOLDER/book
states=(idle countdown estimating tracking searching finishing)
mkdir -p $disk
# User Mode Linux's disk cannot write zeros in one step, and says so each time.
echo 1 >/proc/sys/kernel/printk
if [ ! -e "$book" ]; then mkfs.ext4 -q -E nodiscard /dev/ubda >/dev/null 2>&1 || fail "no file system on the disk; install e2fsprogs"; echo 0 >"$book"; fi
mount -t ext4 -o commit=30 /dev/ubda $disk || { dmesg | tail -5; fail "the disk's file system cannot be mounted after the cut"; }
cut=$(tail -1 "$book")
state=${states[$((cut % 6))]}

cat >boothd.toml <<EOT
booth.id = "virtual"
control.socket = "/run/booth/control.sock"
session.directory = "$disk/sessions"
dds.enabled = false
cameras.synthetic.count = 2
cameras.synthetic.motion = "a-pose"
fit.sex = "men"
fit.threads = 1
EOT
[ "$state" = countdown ] && echo 'session.countdown_seconds = 60' >>boothd.toml
# A stage beside the person: nobody is found.
[ "$state" = searching ] && printf 'stage.centre_x = 9\nsession.lost_seconds = 0.1\n' >>boothd.toml

begin=$(cut -d' ' -f1 /proc/uptime)
"$bin/boothd" --config boothd.toml >boothd.out 2>&1 &
socket=/run/booth/control.sock
ctl() { "$bin/boothctl" "$@" --socket $socket; }
becomes() { "$programs/booth_status" $socket --until "state=$1" 60 >/dev/null || { cat boothd.out; fail "cut $cut: boothd does not become $1"; }; }
becomes idle
within 60 grep -q 'is ready' boothd.out || { cat boothd.out; fail "boothd is not ready after cut $cut"; }
awk -v a="$begin" '{ printf "%.1f\n", $1 - a }' /proc/uptime >>"$BOOTH_FOLDER/ready"

number() { tr -d '\n ' <"$1" | grep -o "\"$2\":[0-9]*" | head -1 | cut -d: -f2; }
result() { tr -d '\n ' <"$1/session.json" | grep -o '"result":"[a-z]*"' | cut -d'"' -f4; }
# "SUM ./ID/FILE" of all sessions in one go: a look at each of a hundred would take the guest minutes.
sums() { (cd $disk/sessions 2>/dev/null && find . -mindepth 2 -type f | sort | xargs -r sha256sum) || true; }
# What was acknowledged before the last cut lies in the host's folder: `complete`, the sums of sessions that were complete, and `running`, "ID FRAMES" of one that was not.
sums >now
if [ -s "$BOOTH_FOLDER/complete" ]; then
  awk 'NR == FNR { split($2, part, "/"); known[part[2]]; next } { split($2, part, "/") } part[2] in known' "$BOOTH_FOLDER/complete" now >kept
  cmp -s kept "$BOOTH_FOLDER/complete" || { diff "$BOOTH_FOLDER/complete" kept; cat boothd.out; fail "cut $cut: files of complete sessions are missing or changed"; }
fi
if [ -s "$BOOTH_FOLDER/running" ]; then
  read -r id told <"$BOOTH_FOLDER/running"
  folder=$disk/sessions/$id
  [ -s "$folder/session.json" ] || { ls -la $disk/sessions "$folder" 2>&1; cat boothd.out; fail "cut $cut: session $id was acknowledged and is not there"; }
  case $(result "$folder") in interrupted | complete) ;; *) cat "$folder/session.json"; fail "cut $cut: session $id was not brought to its end" ;; esac
  kept=$(number "$folder/session.json" frames)
  # All but the last second, and the second in which the log was being brought to the disk.
  [ $((kept + 60)) -ge "$told" ] || { ls -la "$folder"; fail "cut $cut: of session $id $told frames were published and $kept are kept"; }
  echo "$told $kept" >>"$BOOTH_FOLDER/frames"
fi
if ls $disk/sessions/*/session.json >/dev/null 2>&1; then
  said=$(grep -lE '"result": *"running"' $disk/sessions/*/session.json || true)
  [ -z "$said" ] || fail "cut $cut: $said still says that it runs"
fi
half=$(find $disk/sessions -name '*.part' 2>/dev/null || true)
[ -z "$half" ] || fail "cut $cut: half a file: $half"
if [ "$cut" -ge $((6 * BOOTH_TIMES)) ]; then
  figure "$cut cuts, $BOOTH_TIMES in each of ${states[*]}; boothd's start to READY: $(sort -n "$BOOTH_FOLDER/ready" | awk '{ r[NR] = $1 } END { print r[int((NR + 1) / 2)] " s in the middle, " r[NR] }') s at most; $(ls $disk/sessions | wc -l) sessions on the disk"
  [ -e "$BOOTH_FOLDER/frames" ] && figure "$(awk '{ p += $1; k += $2; d = $1 - $2; if (d > m) m = d } END { printf "%d sessions were cut while they ran: they had told of %d frames, %d are kept; of none more than %d of those told are lost", NR, p, k, m + 0 }' "$BOOTH_FOLDER/frames")"
  exit 0
fi

# What the start has brought to its end, and what was complete before, has to outlive this cut too.
mv now "$BOOTH_FOLDER/complete.new"
: >"$BOOTH_FOLDER/running.new"
begin_session() {
  ctl start >/dev/null || fail "cut $cut: a session is refused"
  becomes "$1"
}
# One answer of boothd: on a busy host the guest may stand still for longer than anybody waits, and an answer that was not given acknowledges nothing.
running() {
  local folder frames
  for _ in $(seq 20); do
    read -r folder frames <<<"$("$programs/booth_status" $socket session_folder frames 2>/dev/null)"
    case ${folder:-} in /*) echo "$(basename "$folder") $frames" >"$BOOTH_FOLDER/running.new"; return ;; esac
    sleep 0.2
  done
  cat boothd.out
  fail "cut $cut: boothd does not say which session runs"
}
case $state in
  idle)
    begin_session tracking
    ctl stop --wait >/dev/null || fail "cut $cut: a session does not end"
    sums >"$BOOTH_FOLDER/complete.new"
    ;;
  countdown) begin_session countdown ;;
  estimating) ctl start >/dev/null || fail "cut $cut: a session is refused"; sleep "$(awk -v r=$RANDOM 'BEGIN { print r / 32768 }')"; running ;;
  tracking) begin_session tracking; sleep "$(awk -v r=$RANDOM 'BEGIN { print 1.5 + r / 16384 }')"; running ;;
  searching) begin_session searching; sleep "$(awk -v r=$RANDOM 'BEGIN { print r / 16384 }')"; running ;;
  finishing)
    begin_session tracking
    sleep 2
    running
    ctl stop >/dev/null
    sleep "$(awk -v r=$RANDOM 'BEGIN { print r / 32768 / 20 }')"
    ;;
esac
# The host's folder outlives the guest only where it was brought to the host.
for list in complete running; do mv "$BOOTH_FOLDER/$list.new" "$BOOTH_FOLDER/$list"; done
echo $((cut + 1)) >>"$book"
sync -f "$BOOTH_FOLDER/book" 2>/dev/null || sync "$book" "$BOOTH_FOLDER/complete" "$BOOTH_FOLDER/running"
: >"$BOOTH_FOLDER/cut"
sleep 1000
