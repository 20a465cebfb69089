// What is written to a planted /sys, in which order, and all that is not.
#include "drivers/usb/power_control.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/drivers/usb/planted_sysfs.hpp"

namespace booth::drivers::usb {
namespace {

using ::testing::HasSubstr;
using Result = PowerOutcome::Result;

struct PowerTest : ::testing::Test {
  PowerTest() {
    tree.controller({.address = "0000:03:00.0"});
    tree.controller({.address = "0000:04:00.0", .first_bus = 3});
    tree.sensor("2-1", {});
    tree.sensor("4-2", {.serial = "2"});
  }
  std::string port_file() const { return tree.folder_of("usb2") + "/2-0:1.0/usb2-port1/disable"; }
  std::string driver(const std::string& file) const { return tree.get("sys/bus/pci/drivers/xhci_hcd/" + file); }

  tests::PlantedSysfs tree;
  std::vector<std::string> meanwhile;
  PowerControl make(const std::string& watched) {
    return {[](const hal::UsbDevice& d) { return d.vendor == 0x045E; }, tree.root(),
            [this, watched](hal::Nanoseconds) { meanwhile.push_back(tree.get(watched)); }};
  }
};

TEST_F(PowerTest, APortIsSwitchedOffAndOn) {
  auto power = make(port_file());
  const auto outcome = power.reset_port("2-1");
  EXPECT_EQ(outcome.result, Result::done) << outcome.sentence;
  ASSERT_EQ(meanwhile.size(), 1u);
  EXPECT_EQ(meanwhile[0][0], '1');
  EXPECT_EQ(tree.get(port_file())[0], '0');
}

TEST_F(PowerTest, AControllerIsUnboundAndBound) {
  auto power = make("sys/bus/pci/drivers/xhci_hcd/unbind");
  const auto outcome = power.rebind_controller("2-1");
  EXPECT_EQ(outcome.result, Result::done) << outcome.sentence;
  ASSERT_EQ(meanwhile.size(), 1u);
  EXPECT_THAT(meanwhile[0], HasSubstr("0000:03:00.0"));
  EXPECT_THAT(driver("bind"), HasSubstr("0000:03:00.0"));
}

TEST_F(PowerTest, AControllerThatDiedIsKnownByWhatHungOnItBefore) {
  auto power = make("sys/bus/pci/drivers/xhci_hcd/unbind");
  for (const char* gone : {"2-1", "usb1", "usb2"}) std::filesystem::remove(tree.root() / "sys/bus/usb/devices" / gone);
  EXPECT_EQ(power.rebind_controller("2-1").result, Result::done);
  EXPECT_THAT(driver("bind"), HasSubstr("0000:03:00.0"));
}

TEST_F(PowerTest, AControllerIsLeftAloneWhileAnythingElseHangsOnIt) {
  auto power = make("sys/bus/pci/drivers/xhci_hcd/unbind");
  tree.sensor("2-2", {.serial = "3"});
  EXPECT_EQ(power.rebind_controller("2-1").result, Result::refused);
  EXPECT_EQ(power.rebind_controller("2-2").result, Result::refused);
  std::filesystem::remove(tree.root() / "sys/bus/usb/devices/2-2");
  tree.device("1-4", "0781", "5567", "a disk", "480");
  EXPECT_THAT(power.rebind_controller("2-1").sentence, HasSubstr("1-4"));
  EXPECT_EQ(driver("unbind"), "\n");
  EXPECT_EQ(driver("bind"), "\n");
}

TEST_F(PowerTest, NothingIsWrittenForNamesThatAreNone) {
  auto power = make(port_file());
  for (const char* bad : {"", "usb2", "2-1/../../..", "../../etc", "2-1\n", "9-1", "2-99", "2-1:1.0"}) {
    EXPECT_EQ(power.reset_port(bad).result, Result::refused) << bad;
    EXPECT_EQ(power.rebind_controller(bad).result, Result::refused) << bad;
  }
  EXPECT_TRUE(meanwhile.empty());
  EXPECT_EQ(driver("unbind"), "\n");
  EXPECT_EQ(tree.get(port_file()), "0\n");
}

TEST_F(PowerTest, APortWithSomethingElseKeepsItsPower) {
  tree.device("2-3", "0781", "5567", "a disk", "5000");
  auto power = make(port_file());
  EXPECT_EQ(power.reset_port("2-3").result, Result::refused);
}

TEST_F(PowerTest, AControllerThatCouldNotBeBoundAgainIsNotUnbound) {
  std::filesystem::remove(tree.root() / "sys/bus/pci/drivers/xhci_hcd/bind");
  auto power = make(port_file());
  EXPECT_EQ(power.rebind_controller("2-1").result, Result::failed);
  EXPECT_EQ(driver("unbind"), "\n");
}

TEST_F(PowerTest, ALinkInThePlaceOfAnAttributeIsNotWrittenThrough) {
  const tests::TemporaryFolder elsewhere;
  const auto victim = elsewhere.write("victim", "untouched");
  std::filesystem::remove(tree.root() / port_file());
  std::filesystem::create_symlink(victim, tree.root() / port_file());
  std::filesystem::remove(tree.root() / "sys/bus/pci/drivers/xhci_hcd/unbind");
  std::filesystem::create_symlink(victim, tree.root() / "sys/bus/pci/drivers/xhci_hcd/unbind");
  auto power = make("sys/bus/pci/drivers/xhci_hcd/bind");
  EXPECT_FALSE(power.reset_port("2-1"));
  EXPECT_FALSE(power.rebind_controller("2-1"));
  EXPECT_EQ(tests::read_text(victim), "untouched");
}

}  // namespace
}  // namespace booth::drivers::usb
