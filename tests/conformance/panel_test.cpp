// What every panel on a GPIO chip must do, whether the chip is the kernel's or simulated.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <thread>

#include "drivers/clock/system_clock.hpp"
#include "drivers/gpio/gpio_panel.hpp"
#include "tests/conformance/panel_bench.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using drivers::gpio::Bias;
using drivers::gpio::PanelSettings;
using drivers::gpio::Role;
using hal::TriggerKind;
using ::testing::HasSubstr;

constexpr auto kDebounce = 150ms;  ///< long enough that a busy machine can bounce a button within it
constexpr auto kQuiet = 3 * kDebounce;

bool eventually(const std::function<bool()>& condition, std::chrono::milliseconds limit = 20s) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

int open_files() {
  int n = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++n;
  return n;
}

class Panel : public testing::TestWithParam<BenchKind> {
 protected:
  void SetUp() override {
    if (const std::string why = why_no_bench(GetParam()); !why.empty()) GTEST_SKIP() << "skipped: " << why;
    bench = make_bench(GetParam(), clock);
    // At rest: buttons to ground are open, the emergency stop's contact is closed.
    for (const char* line : {"start", "stop"}) bench->drive(line, true);
    bench->drive("emergency", false);
    settings.chip = bench->chip();
    settings.debounce = kDebounce;
    settings.first_retry = 50ms;
    settings.last_retry = 400ms;
  }
  void button(Role role, const std::string& line) {
    settings.lines.push_back({role, {.line = line, .output = false, .active_low = true, .bias = Bias::pull_up}});
  }
  void emergency_stop() { settings.lines.push_back({Role::emergency_stop, {.line = "emergency"}}); }
  void lamp(Role role, const std::string& line, bool active_low = false) {
    settings.lines.push_back({role, {.line = line, .output = true, .active_low = active_low}});
  }
  void open() { panel = make_gpio_panel(bench->chips(), settings, clock); }
  /// Opened and all lines lent.
  void open_well() {
    open();
    const auto buzzer = std::find_if(settings.lines.begin(), settings.lines.end(), [](const auto& l) { return l.role == Role::buzzer; });
    ASSERT_TRUE(eventually([&] {
      if (buzzer == settings.lines.end()) panel->play(hal::Sound::countdown);  // wakes it, and is heard by nobody
      return panel->progress() > 2;
    }));
    ASSERT_EQ(problems(), "");
  }
  void press(const char* line) { bench->drive(line, false); }
  void let_go(const char* line) { bench->drive(line, true); }

  std::string problems() {
    std::string out;
    for (const auto& p : panel->problems()) out += p + "\n";
    return out;
  }
  bool well() {
    return eventually([&] { return problems().empty(); });
  }
  bool complains(const std::string& of) {
    return eventually([&] { return problems().find(of) != std::string::npos; });
  }
  ::testing::AssertionResult hears(TriggerKind kind) {
    const auto event = panel->wait(20s);
    if (!event) return ::testing::AssertionFailure() << "nothing was heard; problems: " << problems();
    last = *event;
    if (event->kind != kind) return ::testing::AssertionFailure() << "heard " << static_cast<int>(event->kind);
    return ::testing::AssertionSuccess();
  }
  bool silent(hal::Nanoseconds length = kQuiet) { return !panel->wait(length).has_value(); }

  /// Moves a line quickly; false when the machine was too busy to do so within the debounce time.
  bool quickly(const char* line, int moves, bool first_high) {
    auto before = std::chrono::steady_clock::now();
    for (int i = 0; i < moves; ++i) {
      bench->drive(line, (i % 2 == 0) == first_high);
      const auto now = std::chrono::steady_clock::now();
      if (now - before > kDebounce / 2) return false;
      before = now;
    }
    return true;
  }

  drivers::SystemClock clock;
  std::unique_ptr<PanelBench> bench;
  PanelSettings settings;
  std::unique_ptr<hal::Panel> panel;
  hal::TriggerEvent last;
};

TEST_P(Panel, ReportsAPressOnceAndAsOfItsEdge) {
  button(Role::start, "start");
  button(Role::stop, "1");
  open_well();
  const auto before = clock.now();
  press("start");
  const auto after = clock.now();
  ASSERT_TRUE(hears(TriggerKind::start));
  EXPECT_GE(last.at, before);
  EXPECT_LE(last.at, after + (GetParam() == BenchKind::simulated ? 0s : 1s)) << "gpio-sim's interrupt comes a little after its wire was moved";
  EXPECT_GE(clock.now() - last.at, kDebounce) << "only what has settled counts";
  let_go("start");
  EXPECT_TRUE(silent()) << "letting go is no press";
  press("stop");
  ASSERT_TRUE(hears(TriggerKind::stop)) << "a line by its offset";
  EXPECT_EQ(problems(), "");
}

TEST_P(Panel, OneButtonToggles) {
  button(Role::toggle, "start");
  open_well();
  for (int i = 0; i < 2; ++i) {
    press("start");
    ASSERT_TRUE(hears(TriggerKind::toggle));
    let_go("start");
    std::this_thread::sleep_for(kQuiet);
  }
  EXPECT_TRUE(silent(0ns));
}

TEST_P(Panel, ALongPressIsAnotherThanAShortOne) {
  button(Role::toggle, "start");
  settings.long_press = 3s;
  open_well();
  // Short: as of its press, told when it is let go.
  for (int attempt = 0;; ++attempt) {
    const auto before = clock.now();
    press("start");
    std::this_thread::sleep_for(kQuiet);
    let_go("start");
    const bool in_time = clock.now() - before < settings.long_press - kDebounce;
    const auto event = panel->wait(20s);
    ASSERT_TRUE(event);
    if (!in_time && attempt < 5) continue;  // the machine was away for seconds, and so the finger was on the button
    ASSERT_TRUE(in_time);
    EXPECT_EQ(event->kind, TriggerKind::toggle);
    EXPECT_GE(event->at, before);
    break;
  }
  EXPECT_TRUE(silent());
  // Long: told while it is still pressed, once.
  const auto before = clock.now();
  press("start");
  ASSERT_TRUE(hears(TriggerKind::calibrate));
  EXPECT_GE(clock.now() - before, settings.long_press);
  EXPECT_TRUE(silent());
  let_go("start");
  EXPECT_TRUE(silent()) << "letting go is no press";
}

TEST_P(Panel, TakesABouncingPressForOne) {
  button(Role::start, "start");
  open_well();
  for (int i = 0; i < 10; ++i) {
    const bool quick = quickly("start", 9, false);
    const auto first = panel->wait(20s);
    const bool more = !silent();
    let_go("start");
    std::this_thread::sleep_for(kQuiet);
    while (panel->wait(0ns)) {
    }
    if (!quick) continue;
    ASSERT_TRUE(first);
    EXPECT_EQ(first->kind, TriggerKind::start);
    EXPECT_FALSE(more);
    return;
  }
  GTEST_SKIP() << "skipped: this machine is too busy to bounce a button";
}

TEST_P(Panel, PassesOverASpike) {
  button(Role::start, "start");
  open_well();
  for (int i = 0; i < 10; ++i) {
    const bool quick = quickly("start", 2, false);
    const bool heard = !silent();
    if (!quick) continue;
    EXPECT_FALSE(heard);
    return;
  }
  GTEST_SKIP() << "skipped: this machine is too busy to make a spike";
}

TEST_P(Panel, FindsTheLevelWhenEdgesWereLost) {
  button(Role::start, "start");
  open_well();
  // More than the kernel remembers, and the last ones are those it forgets.
  for (int i = 0; i < 10; ++i) {
    const bool quick = quickly("start", 41, false);
    ASSERT_TRUE(hears(TriggerKind::start));
    const bool more = !silent();
    let_go("start");
    std::this_thread::sleep_for(kQuiet);
    while (panel->wait(0ns)) {
    }
    if (!quick) continue;
    EXPECT_FALSE(more);
    return;
  }
  GTEST_SKIP() << "skipped: this machine is too busy to flood a line";
}

TEST_P(Panel, TakesAButtonThatIsHeldAtTheStartForNoPress) {
  settings.lines.push_back({Role::start, {.line = "start", .output = false, .active_low = true}});
  press("start");
  open_well();
  EXPECT_TRUE(silent());
  let_go("start");
  EXPECT_TRUE(silent());
  press("start");
  EXPECT_TRUE(hears(TriggerKind::start));
}

TEST_P(Panel, TellsBothEndsOfAnEmergencyStop) {
  emergency_stop();
  open_well();
  EXPECT_TRUE(silent());
  bench->drive("emergency", true);
  ASSERT_TRUE(hears(TriggerKind::emergency_pressed));
  EXPECT_TRUE(silent());
  bench->drive("emergency", false);
  ASSERT_TRUE(hears(TriggerKind::emergency_released));
}

TEST_P(Panel, FindsAnEmergencyStopThatIsPressedAlready) {
  emergency_stop();
  bench->drive("emergency", true);
  open();
  ASSERT_TRUE(hears(TriggerKind::emergency_pressed));
  bench->drive("emergency", false);
  ASSERT_TRUE(hears(TriggerKind::emergency_released));
}

TEST_P(Panel, TakesAnEmergencyStopThatCannotBeReadForPressed) {
  emergency_stop();
  open_well();
  bench->unplug();
  ASSERT_TRUE(hears(TriggerKind::emergency_pressed));
  EXPECT_TRUE(complains("cannot be read and counts as pressed"));
  bench->plug_in();
  ASSERT_TRUE(hears(TriggerKind::emergency_released));
  EXPECT_TRUE(well());
}

TEST_P(Panel, LightsTheLight) {
  lamp(Role::light, "light");
  open_well();
  EXPECT_FALSE(bench->high("light"));
  panel->show({hal::LightPattern::idle_steady});
  EXPECT_TRUE(eventually([&] { return bench->high("light"); }));
  panel->show({hal::LightPattern::estimating_fast_blink});
  bool seen = true;
  for (int i = 0; i < 6; ++i, seen = !seen) ASSERT_TRUE(eventually([&] { return bench->high("light") != seen; })) << i;
  panel->show({hal::LightPattern::off});
  std::this_thread::sleep_for(50ms);
  EXPECT_TRUE(eventually([&] { return !bench->high("light"); }));
  panel->show({hal::LightPattern::idle_steady});
  ASSERT_TRUE(eventually([&] { return bench->high("light"); }));
  panel.reset();
  EXPECT_FALSE(bench->high("light")) << "no light for a daemon that is not there";
}

TEST_P(Panel, LightsALightThatIsOnWhenItsLineIsLow) {
  lamp(Role::light, "light", true);
  open_well();
  EXPECT_TRUE(eventually([&] { return bench->high("light"); }));
  panel->show({hal::LightPattern::idle_steady});
  EXPECT_TRUE(eventually([&] { return !bench->high("light"); }));
}

TEST_P(Panel, SoundsTheBuzzerAndEndsIt) {
  lamp(Role::buzzer, "buzzer");
  open_well();
  panel->play(hal::Sound::ended);
  EXPECT_TRUE(eventually([&] { return bench->high("buzzer"); }));
  EXPECT_TRUE(eventually([&] { return !bench->high("buzzer"); }));
  std::this_thread::sleep_for(100ms);
  EXPECT_FALSE(bench->high("buzzer"));
}

TEST_P(Panel, WorksWithoutABusyLineAndTakesItWhenItIsFree) {
  button(Role::start, "start");
  lamp(Role::light, "light");
  bench->occupy("light");
  open();
  panel->show({hal::LightPattern::idle_steady});
  EXPECT_TRUE(complains("light: line \"light\" of chip \"booth-bench\" is used by \"another\""));
  press("start");
  EXPECT_TRUE(hears(TriggerKind::start)) << "one line in trouble is no trouble for the others";
  bench->leave();
  EXPECT_TRUE(eventually([&] { return bench->high("light"); }));
  EXPECT_TRUE(well());
}

TEST_P(Panel, NamesALineThatDoesNotExist) {
  button(Role::start, "start");
  lamp(Role::light, "lamp");
  open();
  EXPECT_TRUE(complains("\"lamp\" of chip \"booth-bench\" does not exist"));
  press("start");
  EXPECT_TRUE(hears(TriggerKind::start));
}

TEST_P(Panel, WaitsForAChipThatIsMissing) {
  button(Role::start, "start");
  lamp(Role::light, "light");
  bench->unplug();
  open();
  panel->show({hal::LightPattern::idle_steady});
  EXPECT_TRUE(complains("gpio.chip \"booth-bench\""));
  EXPECT_TRUE(silent(50ms));
  bench->plug_in();
  EXPECT_TRUE(eventually([&] { return bench->high("light"); }));
  EXPECT_TRUE(well());
  press("start");
  EXPECT_TRUE(hears(TriggerKind::start));
}

TEST_P(Panel, SurvivesAChipThatComesAndGoes) {
  button(Role::toggle, "start");
  emergency_stop();
  lamp(Role::light, "light");
  open_well();
  panel->show({hal::LightPattern::estimating_fast_blink});
  int files = 0;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(eventually([&] { return bench->high("light"); })) << i;
    if (i == 1) files = open_files();
    bench->unplug();
    ASSERT_TRUE(hears(TriggerKind::emergency_pressed)) << i;
    ASSERT_TRUE(complains("booth-bench")) << i;
    bench->plug_in();
    ASSERT_TRUE(hears(TriggerKind::emergency_released)) << i;
    ASSERT_TRUE(well()) << i;
  }
  ASSERT_TRUE(eventually([&] { return bench->high("light"); }));
  EXPECT_EQ(open_files(), files) << "every time the chip went, something stayed open";
  let_go("start");
  std::this_thread::sleep_for(kQuiet);
  while (panel->wait(0ns)) {
  }
  press("start");
  EXPECT_TRUE(hears(TriggerKind::toggle)) << problems();
}

TEST_P(Panel, ShowsAStuckButtonUntilItIsFree) {
  button(Role::start, "start");
  settings.stuck = 400ms;
  open_well();
  press("start");
  ASSERT_TRUE(hears(TriggerKind::start));
  EXPECT_TRUE(complains("stuck"));
  EXPECT_TRUE(silent()) << "however long it is held, it was one press";
  let_go("start");
  EXPECT_TRUE(well());
  press("start");
  EXPECT_TRUE(hears(TriggerKind::start));
}

TEST_P(Panel, GivesUpALineThatChattersAndTriesItAgainLater) {
  button(Role::start, "start");
  lamp(Role::light, "light");
  settings.edges_per_second = 20;
  open_well();
  panel->show({hal::LightPattern::idle_steady});
  bool high = false;
  EXPECT_TRUE(eventually([&] {
    bench->drive("start", high = !high);
    return problems().find("chatters") != std::string::npos;
  }));
  EXPECT_TRUE(eventually([&] { return bench->high("light"); })) << "the light is none the worse for it";
  let_go("start");
  EXPECT_TRUE(well());
  std::this_thread::sleep_for(1s);  // what was before is over
  while (panel->wait(0ns)) {
  }
  press("start");
  EXPECT_TRUE(hears(TriggerKind::start));
}

INSTANTIATE_TEST_SUITE_P(Benches, Panel, testing::Values(BenchKind::simulated, BenchKind::gpio_sim),
                         [](const auto& bench) { return std::string(name_of(bench.param)); });

}  // namespace
}  // namespace booth::tests
