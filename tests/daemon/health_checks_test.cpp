// What doctor says of planted machines: each trouble by its name, with its remedy, and silence where nothing is wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/statvfs.h>

#include "daemon/drivers_factory.usb.hpp"
#include "daemon/health/checks.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/drivers/usb/planted_sysfs.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;

struct DoctorTest : ::testing::Test {
  DoctorTest() { in.config.cameras.driver = "kinect2"; }
  Checks examine(Checks (*group)(const DoctorInputs&) = check_usb) {
    in.root = tree.root();
    in.is_sensor = is_sensor;
    in.usbfs_bytes_per_sensor = usbfs_bytes(in.config);
    in.usb = open_usb_topology(tree.root())->read();
    return group(in);
  }
  static std::string worst(const Checks& checks, const std::string& name) {
    std::string out = "none";
    for (const auto& c : checks)
      if (c.name.starts_with(name) && (out == "none" || c.result == CheckResult::error || (c.result == CheckResult::warning && out == "ok")))
        out = to_string(c.result);
    return out;
  }
  static std::string troubles(const Checks& checks) {
    std::string out;
    for (const auto& c : checks)
      if (c.result == CheckResult::error || c.result == CheckResult::warning) {
        out += c.name + ": " + c.seen + "\n";
        EXPECT_FALSE(c.advice.empty()) << c.seen;
      }
    return out;
  }
  void healthy() {
    tree.set("sys/module/usbcore/parameters/usbfs_memory_mb", "256");
    tree.set("etc/udev/rules.d/90-boothd-kinect2.rules", "");
    for (int i = 0; i < 4; ++i) {
      tree.controller({.address = "0000:0" + std::to_string(4 + i) + ":00.0",
                       .vendor = "0x1912",
                       .first_bus = 1 + 2 * i,
                       .link_width = "1",
                       .link_speed = "5.0 GT/s PCIe",
                       .switches = {"0000:00:01.0", "0000:02:00.0"},
                       .switch_width = switch_width,
                       .switch_speed = switch_speed});
      in.serials.push_back("00000000000" + std::to_string(i));
      tree.sensor(std::to_string(2 + 2 * i) + "-1", {.serial = in.serials.back(), .streaming = true});
    }
  }

  tests::PlantedSysfs tree;
  DoctorInputs in;
  std::string switch_width = "4", switch_speed = "5.0 GT/s PCIe";
};

TEST_F(DoctorTest, HasNothingToSayOfFourSensorsOnFourGoodControllers) {
  healthy();
  EXPECT_EQ(troubles(examine()), "");
  EXPECT_EQ(troubles(examine(check_cameras)), "");
}

TEST_F(DoctorTest, NamesTheSlotThatIsTooSlowForAllOfThem) {
  switch_width = "1";
  healthy();
  const auto checks = examine();
  EXPECT_EQ(worst(checks, "PCIe link"), "error");
  EXPECT_THAT(troubles(checks), HasSubstr("0000:02:00.0 runs x1"));
  EXPECT_THAT(troubles(checks), HasSubstr("4 sensors"));
}

TEST_F(DoctorTest, FindsSensorsThatShareAControllerAndLackMemory) {
  tree.controller({});
  for (int i = 1; i <= 4; ++i) tree.sensor("2-" + std::to_string(i), {.serial = std::to_string(i)});
  const auto checks = examine();
  EXPECT_EQ(worst(checks, "one sensor per controller"), "error");
  EXPECT_EQ(worst(checks, "usbfs memory"), "error") << "16 MiB for four";
  EXPECT_EQ(worst(checks, "udev rule"), "warning");
  EXPECT_EQ(worst(checks, "controller 0000"), "none") << "Intel's are good";
}

TEST_F(DoctorTest, KnowsTheMakersOfControllersOnlyWhereASensorHangs) {
  for (const auto& [vendor, expected] : {std::pair<std::string, std::string>{"0x1b21", "error"},
                                         {"0x1b6f", "error"},
                                         {"0x1106", "error"},
                                         {"0x1022", "warning"},
                                         {"0x8086", "none"},
                                         {"0x1033", "none"}}) {
    tests::PlantedSysfs fresh;
    fresh.controller({.vendor = vendor});
    in.is_sensor = is_sensor;
    in.usb = open_usb_topology(fresh.root())->read();
    EXPECT_EQ(worst(check_usb(in), "controller 0000"), "none") << vendor;
    fresh.sensor("2-1", {});
    in.usb = open_usb_topology(fresh.root())->read();
    EXPECT_EQ(worst(check_usb(in), "controller 0000"), expected) << vendor;
  }
}

TEST_F(DoctorTest, FindsUsb2SpeedAudioSleepAndMissingNodes) {
  tree.controller({});
  tree.sensor("1-3", {.speed = "480", .audio = true, .autosuspend = true, .node = false});
  const auto checks = examine();
  EXPECT_EQ(worst(checks, "USB 3 speed"), "error");
  EXPECT_EQ(worst(checks, "audio"), "warning");
  EXPECT_EQ(worst(checks, "autosuspend"), "warning");
  EXPECT_EQ(worst(checks, "permissions"), "error");
}

TEST_F(DoctorTest, FindsADeadControllerAndOneWithoutADriver) {
  tree.controller({.address = "0000:05:00.0", .dead = true});
  tree.controller({.address = "0000:06:00.0", .driver = ""});
  const std::string found = troubles(examine());
  EXPECT_THAT(found, HasSubstr("0000:05:00.0: has died"));
  EXPECT_THAT(found, HasSubstr("0000:06:00.0: is bound to no driver"));
}

TEST_F(DoctorTest, ComparesWhatIsPluggedInWithWhatIsConfigured) {
  tree.controller({});
  tree.sensor("2-1", {.serial = "111"});
  tree.sensor("2-2", {.serial = "222"});
  tree.sensor("2-3", {.serial = "222"});
  in.serials = {"111", "333"};
  const std::string found = troubles(examine(check_cameras));
  EXPECT_THAT(found, HasSubstr("333 is configured but not plugged in"));
  EXPECT_THAT(found, HasSubstr("222 at port 2-2 is plugged in but not configured"));
  EXPECT_THAT(found, HasSubstr("222 is plugged in 2 times"));
}

TEST_F(DoctorTest, OfAMachineWithoutUsbIsAnErrorOnlyWhereSensorsAreWanted) {
  const tests::TemporaryFolder empty;
  in.is_sensor = is_sensor;
  in.usb = open_usb_topology(empty.path)->read();
  in.root = empty.path;
  EXPECT_EQ(worst(check_usb(in), "kernel"), "error");
  EXPECT_THAT(troubles(check_usb(in)), HasSubstr("no " + (empty.path / "sys/bus/usb").string())) << "the place that was looked at";
  in.config.cameras.driver = "synthetic";
  EXPECT_EQ(worst(check_usb(in), "kernel"), "skipped");
  for (const auto& check : run_checks(in)) EXPECT_FALSE(check.seen.empty()) << check.name;
}

TEST_F(DoctorTest, FindsAnInterfaceThatDoesNotExist) {
  in.config.dds.interface = "nosuchinterface0";
  EXPECT_EQ(worst(check_dds(in), "interface"), "error");
  in.config.dds.interface = "127.0.0.1";
  EXPECT_EQ(worst(check_dds(in), "interface"), "ok");
}

TEST_F(DoctorTest, AnInterfaceWithoutAnAddressServesNobody) {
  const std::vector<NetworkAddress> there{{"lo", "127.0.0.1", true, true}, {"eth0", "", true, false}};
  EXPECT_EQ(judge_network("eth0", there).result, CheckResult::error);
  EXPECT_THAT(judge_network("eth0", there).seen, HasSubstr("no IPv4 address"));
  EXPECT_EQ(judge_network("lo", there).result, CheckResult::ok);
  EXPECT_EQ(judge_network("", there).result, CheckResult::warning) << "loopback alone is no network";
  const std::vector<NetworkAddress> more{{"eth0", "", true, false}, {"eth0", "192.0.2.7", true, false}};
  for (const char* wanted : {"", "eth0", "192.0.2.7"}) EXPECT_EQ(judge_network(wanted, more).result, CheckResult::ok) << wanted;
  EXPECT_EQ(judge_network("eth0", {{"eth0", "192.0.2.7", false, false}}).result, CheckResult::error) << "down";
}

TEST_F(DoctorTest, OfADiskThatTakesNothingWhateverRoomItHas) {
  struct statvfs disk {};
  disk.f_frsize = 4096;
  disk.f_bavail = 100'000'000;
  disk.f_files = disk.f_favail = 1000;
  EXPECT_EQ(judge_disk(in.config, disk).result, CheckResult::ok);
  disk.f_flag = ST_RDONLY;
  EXPECT_EQ(judge_disk(in.config, disk).result, CheckResult::error);
  EXPECT_THAT(judge_disk(in.config, disk).seen, HasSubstr("only be read"));
  disk.f_flag = 0;
  disk.f_favail = 0;
  EXPECT_THAT(judge_disk(in.config, disk).seen, HasSubstr("no more files"));
  disk.f_files = 0;
  EXPECT_EQ(judge_disk(in.config, disk).result, CheckResult::ok) << "a file system that does not count them";
  disk.f_bavail = 10;
  EXPECT_EQ(judge_disk(in.config, disk).result, CheckResult::error);
}

TEST_F(DoctorTest, OfAFolderThatBelongsToSomebodyElse) {
  const Account boothd{"boothd", 990, {990, 44}};
  struct stat folder {};
  const auto judged = [&](uid_t user, gid_t group, mode_t mode) {
    folder.st_uid = user;
    folder.st_gid = group;
    folder.st_mode = mode;
    return judge_folder("/sessions", folder, boothd).result;
  };
  EXPECT_EQ(judged(990, 990, S_IFDIR | 0750), CheckResult::ok);
  EXPECT_EQ(judged(0, 0, S_IFDIR | 0755), CheckResult::error);
  EXPECT_EQ(judge_folder("/sessions", folder, boothd).seen, "user boothd may not write into /sessions");
  EXPECT_EQ(judged(0, 44, S_IFDIR | 0770), CheckResult::ok);
  EXPECT_EQ(judged(990, 44, S_IFDIR | 0570), CheckResult::error) << "the owner's rights count for the owner";
  EXPECT_EQ(judged(0, 0, S_IFDIR | 0777), CheckResult::ok);
  EXPECT_EQ(judged(990, 990, S_IFREG | 0770), CheckResult::error);
}

TEST_F(DoctorTest, ReadsWhatBoothdCannotStartWithout) {
  const tests::TemporaryFolder folder;
  EXPECT_EQ(worst(check_files(in), "key"), "skipped");
  in.config.privacy.seal_to = folder.write("key.public", "boothd-public-1 00\n").string();
  in.config.models.directory = folder.path.string();
  folder.write("men.npz", "PK");
  EXPECT_EQ(worst(check_files(in), "body models"), "error");
  EXPECT_EQ(worst(check_files(in), "key"), "error");
  EXPECT_THAT(troubles(check_files(in)), HasSubstr("key.public"));
}

TEST_F(DoctorTest, SaysHowANodeOfRos2FindsTheBooth) {
  EXPECT_EQ(worst(check_ros2(in), "ros2"), "skipped");
  in.config.dds.ros2 = true;
  in.config.booth.id = "front-hall";
  in.config.dds.domain = 7;
  ASSERT_EQ(check_ros2(in).size(), 1u);
  EXPECT_EQ(worst(check_ros2(in), "ros2"), "ok");
  EXPECT_THAT(check_ros2(in)[0].seen, AllOf(HasSubstr("/humans/bodies/front_hall/*"), HasSubstr("ROS_DOMAIN_ID=7")));
  in.config.dds.domain = 102;
  EXPECT_EQ(worst(check_ros2(in), "ros2"), "warning");
}

/// A machine with a busy and a well-behaved chip.
hal::GpioChips planted_chips() {
  hal::GpioChipInfo soc{.path = "/dev/gpiochip0", .name = "gpiochip0", .label = "INTC1057:00", .problem = "", .lines = {}};
  for (unsigned i = 0; i < 4; ++i) soc.lines.push_back({.offset = i, .name = "", .consumer = i == 2 ? "reset" : "", .used = i >= 2, .output = false});
  hal::GpioChipInfo usb{.path = "/dev/gpiochip1", .name = "gpiochip1", .label = "cp2112_gpio", .problem = "", .lines = {}};
  for (const char* name : {"start", "stop", "twice", "twice"})
    usb.lines.push_back({.offset = static_cast<unsigned>(usb.lines.size()), .name = name, .consumer = "", .used = false, .output = false});
  return {soc, usb, {.path = "/dev/gpiochip2", .name = "", .label = "", .problem = "Permission denied", .lines = {}}};
}

TEST_F(DoctorTest, OfButtonsAndLight) {
  auto& keys = in.config.gpio;
  EXPECT_EQ(worst(check_gpio(in), "chip"), "skipped") << "a booth without any";
  keys.chip = "simulated";
  EXPECT_EQ(worst(check_gpio(in), "chip"), "ok");
  keys.chip = "cp2112_gpio";
  keys.start = "start";
  keys.light = "3";
  EXPECT_EQ(worst(check_gpio(in), "chip"), "skipped") << "another root has no lines";
  in.gpio = planted_chips();
  EXPECT_EQ(troubles(check_gpio(in)), "");
  EXPECT_EQ(worst(check_gpio(in), "gpio.start"), "ok");
  EXPECT_EQ(worst(check_gpio(in), "gpio.light"), "ok") << "by its offset";

  keys.light = "lamp";
  EXPECT_THAT(troubles(check_gpio(in)), HasSubstr("gpiochip1 has no line \"lamp\"; it has 4 lines, named start, stop"));
  keys.light = "4";
  EXPECT_EQ(worst(check_gpio(in), "gpio.light"), "error") << "one too far";
  keys.light = "twice";
  EXPECT_THAT(troubles(check_gpio(in)), HasSubstr("two lines \"twice\""));
  keys.light = "";
  keys.chip = "/dev/gpiochip0";
  keys.start = "2";
  EXPECT_THAT(troubles(check_gpio(in)), HasSubstr("line 2 of gpiochip0 is used by \"reset\""));
  keys.start = "3";
  EXPECT_THAT(troubles(check_gpio(in)), HasSubstr("used by \"the kernel\""));
  (*in.gpio)[0].lines[3].consumer = "boothd";
  EXPECT_EQ(troubles(check_gpio(in)), "") << "boothd runs already";
  keys.chip = "/dev/gpiochip2";
  EXPECT_THAT(troubles(check_gpio(in)), HasSubstr("Permission denied"));
  keys.chip = "gpiochip7";
  EXPECT_THAT(troubles(check_gpio(in)), HasSubstr("there are gpiochip0 (INTC1057:00), gpiochip1 (cp2112_gpio), /dev/gpiochip2"));
  in.gpio->clear();
  EXPECT_THAT(troubles(check_gpio(in)), HasSubstr("this machine has no GPIO chip"));
}

}  // namespace
}  // namespace booth::daemon
