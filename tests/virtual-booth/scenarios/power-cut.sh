# Scenario: the power goes away.
# does: the guest loses its power in each state of a session, and its disk whatever was not brought to it; after each boot nothing is lost that was acknowledged
# limit: 200
# disk: 96M
# times: 1
# tools: mkfs.ext4
# needs: boothd boothctl
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
ctl() { "$bin/boothctl" "$@" --socket /run/booth/control.sock; }
status() { ctl status --json; }
state_now() { status | grep -o '"state":"[a-z]*"' | head -1 | cut -d'"' -f4; }
within 60 grep -q 'is ready' boothd.out || { cat boothd.out; fail "boothd is not ready after cut $cut"; }
within 30 ctl status || fail "boothd does not answer after cut $cut"
ready=$(awk -v a="$begin" '{ printf "%.1f", $1 - a }' /proc/uptime)

number() { tr -d '\n ' <"$1" | grep -o "\"$2\":[0-9]*" | head -1 | cut -d: -f2; }
result() { tr -d '\n ' <"$1/session.json" | grep -o '"result":"[a-z]*"' | cut -d'"' -f4; }
# What was acknowledged before the last cut: "complete ID SUM" and "running ID FRAMES", in the host's folder.
sum() { (cd "$1" && find . -type f | sort | xargs sha256sum | sha256sum | cut -d' ' -f1); }
sessions=0
if [ -e "$BOOTH_FOLDER/acknowledged" ]; then
  while read -r kind id value; do
    folder=$disk/sessions/$id
    sessions=$((sessions + 1))
    [ -s "$folder/session.json" ] || { ls -la $disk/sessions "$folder" 2>&1; cat boothd.out; fail "cut $cut: session $id was acknowledged ($kind) and is not there"; }
    if [ "$kind" = complete ]; then
      [ "$(sum "$folder")" = "$value" ] || { ls -la "$folder"; fail "cut $cut: files of the complete session $id changed"; }
    else
      case $(result "$folder") in interrupted | complete) ;; *) cat "$folder/session.json"; fail "cut $cut: session $id was not brought to its end" ;; esac
      kept=$(number "$folder/session.json" frames)
      # All but the last second, and the second in which the log was being brought to the disk.
      [ $((kept + 60)) -ge "$value" ] || { ls -la "$folder"; fail "cut $cut: of session $id $value frames were published and $kept are kept"; }
      echo "$value $kept" >>"$BOOTH_FOLDER/frames"
    fi
  done <"$BOOTH_FOLDER/acknowledged"
fi
for folder in $disk/sessions/*/; do
  [ -d "$folder" ] || continue
  case $(result "$folder") in running) fail "cut $cut: $folder still says that it runs" ;; esac
  ls -a "$folder" | grep -q '\.part$' && fail "cut $cut: half a file in $folder"
done
if [ "$cut" -ge $((6 * BOOTH_TIMES)) ]; then
  figure "$cut cuts, $BOOTH_TIMES in each of ${states[*]}; READY after the last $ready s after boothd's start; $(ls $disk/sessions | wc -l) sessions on the disk"
  [ -e "$BOOTH_FOLDER/frames" ] && figure "$(awk '{ p += $1; k += $2; d = $1 - $2; if (d > m) m = d } END { printf "%d sessions were cut while they ran: they had told of %d frames, %d are kept; of none more than %d of those told are lost", NR, p, k, m + 0 }' "$BOOTH_FOLDER/frames")"
  exit 0
fi

: >"$BOOTH_FOLDER/acknowledged.new"
# What the start has brought to its end, and what was complete before, has to outlive this cut too.
for folder in $disk/sessions/*/; do
  [ -d "$folder" ] && echo "complete $(basename "$folder") $(sum "$folder")" >>"$BOOTH_FOLDER/acknowledged.new"
done
acknowledge() { echo "$*" >>"$BOOTH_FOLDER/acknowledged.new"; }
begin_session() {
  ctl start >/dev/null || fail "cut $cut: a session is refused"
  within 60 eval '[ "$(state_now)" = '"$1"' ]' || { cat boothd.out; fail "cut $cut: boothd does not become $1"; }
}
# One answer of boothd: on a busy host the guest may stand still for longer than boothctl waits, and an answer that was not given acknowledges nothing.
running() {
  local said id frames
  for _ in $(seq 50); do
    said=$(status 2>/dev/null) || said=
    id=$(basename "$(echo "$said" | grep -o '"session_folder":"[^"]*"' | head -1 | cut -d'"' -f4)")
    frames=$(echo "$said" | grep -o '"frames":[0-9]*' | head -1 | cut -d: -f2)
    [ -n "$id" ] && [ -n "$frames" ] && { acknowledge running "$id" "$frames"; return; }
    sleep 0.2
  done
  cat boothd.out
  fail "cut $cut: boothd does not say which session runs"
}
case $state in
  idle)
    begin_session tracking
    ctl stop --wait >/dev/null
    folder=$(ls -td $disk/sessions/*/ | head -1)
    acknowledge complete "$(basename "$folder")" "$(sum "$folder")"
    ;;
  countdown) ctl start >/dev/null; within 60 eval '[ "$(state_now)" = countdown ]' || fail "cut $cut: no countdown" ;;
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
mv "$BOOTH_FOLDER/acknowledged.new" "$BOOTH_FOLDER/acknowledged"
echo $((cut + 1)) >>"$book"
sync -f "$BOOTH_FOLDER/book" 2>/dev/null || sync "$book" "$BOOTH_FOLDER/acknowledged"
: >"$BOOTH_FOLDER/cut"
sleep 1000
