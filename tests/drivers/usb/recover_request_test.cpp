// A request for a step that needs root: asked, believed only where it names what the machine has, answered; and everything that is not one.
#include "drivers/usb/recover_request.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <utime.h>

#include "tests/drivers/usb/planted_sysfs.hpp"

namespace booth::drivers::usb {
namespace {

using ::testing::HasSubstr;
using Result = PowerOutcome::Result;

TEST(RecoverRequest, OnlyItsOwnWordsAreOne) {
  const auto good = parse_recover_request("1f 0000:03:00.0\n");
  ASSERT_TRUE(good.has_value());
  EXPECT_EQ(good->number, "1f");
  EXPECT_EQ(good->argument, "0000:03:00.0");
  for (const std::string bad : {"", "\n", "1f\n", "1f \n", " 2-1\n", "1f 2-1", "1f 2-1\n\n", "1f 2/1\n", "1f 2-1 x\n", "G 2-1\n", "12345678901234567 2-1\n",
                                "1f ../../etc\n", "1f 2-1;reboot\n"})
    EXPECT_FALSE(parse_recover_request(bad).has_value()) << bad;
  EXPECT_FALSE(parse_recover_request("1f " + std::string(80, '1') + "\n").has_value());
  EXPECT_FALSE(parse_recover_request(std::string("1f 2-\0001\n", 8)).has_value());
  for (const auto step : {RecoverStep::port, RecoverStep::controller, RecoverStep::usbfs_memory}) EXPECT_EQ(parse_recover_step(to_string(step)), step);
  EXPECT_FALSE(parse_recover_step("../port").has_value());
}

/// A machine with two controllers, and both folders.
struct RecoverTest : ::testing::Test {
  RecoverTest() {
    tree.controller({.address = "0000:03:00.0"});
    tree.controller({.address = "0000:04:00.0", .first_bus = 3});
    tree.sensor("2-1", {});
    tree.make("requests");
    tree.make("answers");
  }
  tests::PlantedSysfs tree;
  const std::filesystem::path requests = tree.root() / "requests", answers = tree.root() / "answers";
  PowerControl power{[](const hal::UsbDevice& d) { return d.vendor == 0x045E; }, tree.root(), [](hal::Nanoseconds) {}};

  PowerOutcome answer(RecoverStep step) { return answer_recover_request(step, requests, answers, power); }
  std::string driver(const std::string& file) const { return tree.get("sys/bus/pci/drivers/xhci_hcd/" + file); }
  std::string memory() const { return tree.get("sys/module/usbcore/parameters/usbfs_memory_mb"); }
  /// The other side takes its turn whenever this one waits.
  RecoverClient client(RecoverStep step) {
    return {requests, answers, std::chrono::seconds(1), [this, step](hal::Nanoseconds) { last = answer(step); }};
  }
  PowerOutcome last;
};

TEST_F(RecoverTest, APortIsAskedForAndSwitched) {
  const auto outcome = client(RecoverStep::port).ask(RecoverStep::port, "2-1");
  EXPECT_EQ(outcome.result, Result::done) << outcome.sentence;
  EXPECT_EQ(outcome.sentence, last.sentence);
  EXPECT_FALSE(std::filesystem::exists(requests / "port"));
}

TEST_F(RecoverTest, AControllerIsAskedForByItsAddress) {
  EXPECT_EQ(power.controller_of("2-1"), "0000:03:00.0");
  const auto outcome = client(RecoverStep::controller).ask(RecoverStep::controller, "0000:03:00.0");
  EXPECT_EQ(outcome.result, Result::done) << outcome.sentence;
  EXPECT_THAT(driver("unbind"), HasSubstr("0000:03:00.0"));
  EXPECT_THAT(driver("bind"), HasSubstr("0000:03:00.0"));
}

TEST_F(RecoverTest, AControllerThatDiedIsKnownByItsAddressAlone) {
  for (const char* gone : {"2-1", "usb1", "usb2"}) std::filesystem::remove(tree.root() / "sys/bus/usb/devices" / gone);
  EXPECT_EQ(client(RecoverStep::controller).ask(RecoverStep::controller, "0000:03:00.0").result, Result::done);
}

TEST_F(RecoverTest, NamesThatThisMachineDoesNotHaveAreRefused) {
  for (const char* bad : {"0000:05:00.0", "2-1", "0000:03:00.8", "0000:03:00", "3", "."}) {
    const auto outcome = client(RecoverStep::controller).ask(RecoverStep::controller, bad);
    EXPECT_EQ(outcome.result, Result::refused) << bad << ": " << outcome.sentence;
  }
  EXPECT_EQ(client(RecoverStep::port).ask(RecoverStep::port, "9-1").result, Result::refused);
  EXPECT_EQ(driver("unbind"), "\n");
}

TEST_F(RecoverTest, AControllerWithTwoSensorsOrADiskIsLeftAlone) {
  tree.sensor("2-2", {.serial = "2"});
  EXPECT_EQ(client(RecoverStep::controller).ask(RecoverStep::controller, "0000:03:00.0").result, Result::refused);
  std::filesystem::remove(tree.root() / "sys/bus/usb/devices/2-2");
  tree.device("1-4", "0781", "5567", "a disk", "480");
  EXPECT_EQ(client(RecoverStep::controller).ask(RecoverStep::controller, "0000:03:00.0").result, Result::refused);
  EXPECT_EQ(driver("unbind"), "\n");
}

TEST_F(RecoverTest, MemoryIsRaisedWithinReasonAndNeverLowered) {
  EXPECT_EQ(client(RecoverStep::usbfs_memory).ask(RecoverStep::usbfs_memory, "256").result, Result::done);
  EXPECT_EQ(std::stoi(memory()), 256);
  for (const char* bad : {"0", "1025", "99999", "0256", "ff", "-1"})
    EXPECT_EQ(client(RecoverStep::usbfs_memory).ask(RecoverStep::usbfs_memory, bad).result, Result::refused) << bad;
  tree.set("sys/module/usbcore/parameters/usbfs_memory_mb", "300");
  EXPECT_EQ(client(RecoverStep::usbfs_memory).ask(RecoverStep::usbfs_memory, "100").result, Result::done);
  EXPECT_EQ(std::stoi(memory()), 300);
}

TEST_F(RecoverTest, WhatIsNoPlainFreshFileIsDeletedAndRefused) {
  const auto secret = tree.set("secret", "1f 2-1");
  const auto place = requests / "port";
  const auto expect_refused = [&](const char* what) {
    const auto outcome = answer(RecoverStep::port);
    EXPECT_EQ(outcome.result, Result::refused) << what << ": " << outcome.sentence;
    EXPECT_FALSE(std::filesystem::is_symlink(place) || std::filesystem::exists(place)) << what;
    EXPECT_FALSE(std::filesystem::exists(answers / "port")) << what;
  };
  expect_refused("nothing");
  std::filesystem::create_symlink(secret, place);
  expect_refused("a link");
  EXPECT_TRUE(std::filesystem::exists(secret));
  ASSERT_EQ(::mkfifo(place.c_str(), 0600), 0);
  expect_refused("a pipe");
  tree.set("requests/port", std::string(100'000, '1'));
  expect_refused("a large file");
  tree.set("requests/port", "1f 2-1");
  const utimbuf old{1, 1};
  ASSERT_EQ(::utime(place.c_str(), &old), 0);
  expect_refused("an old request");
  tree.set("requests/port", "no request");
  expect_refused("other words");
}

TEST_F(RecoverTest, AFolderInThePlaceOfARequestFailsInsteadOfComingAgain) {
  tree.make("requests/port/within");
  EXPECT_EQ(answer(RecoverStep::port).result, Result::failed);
}

TEST_F(RecoverTest, ALinkedFolderIsNotFollowed) {
  std::filesystem::remove_all(requests);
  tree.make("elsewhere");
  tree.set("elsewhere/port", "1f 2-1");
  std::filesystem::create_directory_symlink(tree.root() / "elsewhere", requests);
  EXPECT_EQ(answer(RecoverStep::port).result, Result::failed);
  EXPECT_TRUE(std::filesystem::exists(tree.root() / "elsewhere/port"));
}

TEST_F(RecoverTest, AnAnswerToAnotherRequestIsNotTaken) {
  tree.set("answers/port", "dead done port 2-1 was without power for two seconds");
  RecoverClient lonely(requests, answers, std::chrono::milliseconds(300), [](hal::Nanoseconds) {});
  const auto outcome = lonely.ask(RecoverStep::port, "2-1");
  EXPECT_EQ(outcome.result, Result::not_permitted) << outcome.sentence;
  EXPECT_FALSE(std::filesystem::exists(requests / "port")) << "a request that nobody answered must not be found later";
}

TEST_F(RecoverTest, TheFolderOfRequestsIsMadeForTheGroup) {
  std::filesystem::remove_all(requests);
  EXPECT_EQ(client(RecoverStep::port).ask(RecoverStep::port, "2-1").result, Result::done);
  struct stat s {};
  ASSERT_EQ(::stat(requests.c_str(), &s), 0);
  EXPECT_EQ(s.st_mode & 0777, 0770u);
}

}  // namespace
}  // namespace booth::drivers::usb
