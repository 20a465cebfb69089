# Scenario: a long run in virtual time.
# does: boothd watches an empty room for minutes or hours of the guest's clock, under the rules of its unit, with a session and a fault now and then; nothing grows
# kernel: time-travel=inf-cpu
# limit: 900
# times: 5
# needs: booth-soak boothd
# BOOTH_TIMES minutes of the guest's clock. One sensor with a frame a second: each frame costs the host what it costs anywhere.
set -eu
mkdir -p /run/booth/tmp
began=$(host_time)
hours=$(awk -v m="$BOOTH_TIMES" 'BEGIN { printf "%.4f", m / 60 }')
# A window at each end holds two sessions and the idle after them.
TMPDIR=/run/booth/tmp "$BOOTH_BUILD/bin/booth-soak" --hours "$hours" --window "$(awk -v m="$BOOTH_TIMES" 'BEGIN { print m / 3 }')" --session 15 --idle "$(awk -v m="$BOOTH_TIMES" 'BEGIN { print m * 60 / 8 - 15 }')" \
  --set cameras.driver=kinect2-emulated --set cameras.emulated.rate=1 --set 'cameras.kinect2.serials=["000000000001"]' --set cameras.minimum=1 --set cameras.kinect2.cache=/run/booth/cache \
  --set cameras.synthetic.motion=a-pose >soak.out 2>&1 || { cat soak.out; fail "$(grep -m 1 WRONG soak.out || echo "the soak ended with an error")"; }
sed -n '/^soak of/,$s/^ */figure: /p' soak.out
figure "$BOOTH_TIMES minutes of the guest's clock in $(echo "$(host_time) $began" | awk '{ printf "%.0f", $1 - $2 }') s of the host's"
