# Scenario: buttons and lamps on a real gpiochip.
# does: the panel's conformance suite passes on the kernel's gpio-sim: edges, debouncing, bias, active-low, busy lines, hot removal, stuck and chattering buttons
# limit: 120
# needs: panel_conformance_test
set -eu
[ -d /sys/kernel/config/gpio-sim ] || fail "the kernel has no gpio-sim"
status=0
BOOTH_GPIO_SIM=1 "$BOOTH_BUILD/bin/panel_conformance_test" --gtest_filter='*gpio_sim*' --gtest_color=no >suite.out 2>&1 || status=$?
figure "$(grep -c '^\[       OK \]' suite.out || true) cases passed, $(grep -c '^\[  FAILED  \] .*ms)' suite.out || true) failed, $(grep -c '^\[  SKIPPED \] .*ms)' suite.out || true) skipped"
[ $status = 0 ] || { grep -v '^\[ RUN' suite.out; dmesg | tail -5; fail "the suite ended with status $status"; }
grep '^skipped: ' suite.out | sort | uniq -c | sed 's/^ */figure: /'
[ "$(grep -c '^\[       OK \]' suite.out)" -ge 15 ] || { cat suite.out; fail "cases were skipped"; }
# A kernel that complains of what was done to it is a finding, even when the suite has passed.
dmesg | grep -iE 'BUG:|use-after-free|general protection|list_(add|del) corruption' && fail "the kernel complains"
true
