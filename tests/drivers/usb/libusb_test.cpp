// The bus over a libusb that refuses, forgets and delays: nothing is freed in flight, nothing waits without end, sinks hear the truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <thread>

#include "drivers/usb/libusb_bus.hpp"
#include "drivers/usb/libusb_context.hpp"
#include "tests/drivers/usb/fake_libusb.hpp"
#include "tests/drivers/usb/planted_sysfs.hpp"

namespace booth::drivers::usb {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using tests::fake_libusb;

constexpr std::array<std::pair<std::uint16_t, std::uint16_t>, 1> kIds{{{0x045E, 0x02C4}}};

template <class Condition>
bool eventually(Condition condition, std::chrono::seconds limit = 20s) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

class Listener final : public StreamSink {
 public:
  void on_packet(Status status, std::span<const std::byte> data, hal::MonotonicTime) override {
    bytes += data.size();
    if (status == Status::completed) ++good;
    if (status != Status::completed) ++bad;
    while (hold) std::this_thread::sleep_for(1ms);
    ++packets;
  }
  void on_end(Status reason) override {
    ended_with = reason;
    ++ends;
  }
  std::atomic<bool> hold{false};
  std::atomic<int> packets{0}, good{0}, bad{0}, ends{0};
  std::atomic<std::size_t> bytes{0};
  std::atomic<Status> ended_with{Status::completed};
};

struct LibusbTest : ::testing::Test {
  LibusbTest() { tests::reset_fake_libusb(); }
  ~LibusbTest() override {
    device.reset();
    bus.reset();
    EXPECT_TRUE(eventually([&] { return counts() == std::array<int, 3>{0, 0, 0}; })) << "handles, transfers, contexts: " << ::testing::PrintToString(counts());
    EXPECT_THAT(fake_libusb().offences, IsEmpty());
    EXPECT_EQ(fake_libusb().kernel_buffers, 0);
  }
  static std::array<int, 3> counts() {
    const std::lock_guard lock(fake_libusb().mutex);
    return {fake_libusb().handles, fake_libusb().transfers, fake_libusb().contexts};
  }
  void open() {
    bus = make_libusb_bus({}, empty.path);
    device = bus->open(bus->list(kIds).at(0));
  }
  std::unique_ptr<Stream> stream(int transfers = 4) {
    return device->open_stream({.endpoint = 0x84, .isochronous = true, .packet_bytes = 1024, .packets_per_transfer = 8, .transfers = transfers}, sink);
  }
  static libusb_transfer* first() {
    const std::lock_guard lock(fake_libusb().mutex);
    return fake_libusb().flying.empty() ? nullptr : fake_libusb().flying.front();
  }

  tests::TemporaryFolder empty;
  Listener sink;  // outlives the streams of the tests below
  std::shared_ptr<Bus> bus;
  std::unique_ptr<Device> device;
};

TEST_F(LibusbTest, PacketsComeFromTheirOwnPlacesAndTransfersFlyAgain) {
  open();
  const auto s = stream();
  EXPECT_EQ(s->transfers_alive(), 4);
  auto* t = first();
  for (int i = 0; i < 8; ++i) t->iso_packet_desc[i].actual_length = 100;
  t->iso_packet_desc[3].status = LIBUSB_TRANSFER_ERROR;
  t->iso_packet_desc[5].actual_length = 100'000;  // more than its place: a liar
  fake_libusb().land(t, LIBUSB_TRANSFER_COMPLETED);
  ASSERT_TRUE(eventually([&] { return sink.packets == 8; }));
  EXPECT_EQ(sink.bad, 1);
  EXPECT_EQ(sink.bytes, 7 * 100u + 1024u);
  EXPECT_TRUE(eventually([&] { return fake_libusb().in_flight() == 4; }));
  EXPECT_TRUE(s->stop(10s));
  EXPECT_TRUE(s->stop(10s)) << "harmless when stopped";
  EXPECT_EQ(s->transfers_alive(), 0);
  EXPECT_EQ(sink.ends, 1);
  EXPECT_EQ(sink.ended_with, Status::cancelled);
}

TEST_F(LibusbTest, AFailedTransferDoesNotRepeatThePacketsOfItsLastFlight) {
  open();
  const auto s = stream();
  auto* t = first();
  for (int i = 0; i < 8; ++i) t->iso_packet_desc[i].actual_length = 100;
  fake_libusb().land(t, LIBUSB_TRANSFER_ERROR);
  ASSERT_TRUE(eventually([&] { return sink.packets == 8; }));
  EXPECT_EQ(sink.good, 0);
  EXPECT_EQ(sink.bytes, 0u);
  EXPECT_EQ(sink.ends, 0);
}

TEST_F(LibusbTest, UnplugIsTold_Once_AndEverythingIsTakenBack) {
  open();
  const auto s = stream();
  fake_libusb().land_all(LIBUSB_TRANSFER_NO_DEVICE);
  ASSERT_TRUE(eventually([&] { return s->transfers_alive() == 0; }));
  EXPECT_TRUE(s->stop(10s));
  EXPECT_EQ(sink.ends, 1);
  EXPECT_EQ(sink.ended_with, Status::no_device);
}

TEST_F(LibusbTest, ASinkIsNotLeftWhileItIsBeingCalled) {
  open();
  auto s = stream();
  sink.hold = true;
  fake_libusb().land(first(), LIBUSB_TRANSFER_COMPLETED);
  ASSERT_TRUE(eventually([&] { return sink.good == 1; }));
  std::atomic<bool> stopped{false};
  std::thread stopping([&] {
    (void)s->stop(1ms);
    stopped = true;
  });
  std::this_thread::sleep_for(50ms);
  EXPECT_FALSE(stopped) << "the owner of the sink may free it as soon as stop() returns";
  sink.hold = false;
  stopping.join();
  EXPECT_TRUE(eventually([&] { return s->transfers_alive() == 0; }));
}

TEST_F(LibusbTest, TransfersThatDoNotComeBackAreKeptUntilTheyDo) {
  open();
  fake_libusb().cancel_answers = false;
  {
    auto s = stream();
    EXPECT_FALSE(s->stop(20ms));
    EXPECT_EQ(sink.ends, 1);
  }
  device.reset();
  EXPECT_EQ(counts()[0], 1) << "the handle stays open under what flies";
  EXPECT_EQ(counts()[1], 4);
  // At last the controller gives them back; the thread that hears of it is the last owner of its own context.
  fake_libusb().land_all(LIBUSB_TRANSFER_CANCELLED);
  EXPECT_TRUE(eventually([&] { return counts() == std::array<int, 3>{0, 0, 1}; }));
  EXPECT_EQ(sink.packets, 0);
}

TEST_F(LibusbTest, FewerThanHalfOfTheTransfersAreARefusalWithItsReason) {
  open();
  fake_libusb().submissions_left = 1;
  fake_libusb().submit_errno = ENOMEM;
  try {
    (void)stream();
    FAIL() << "one of four transfers is no stream";
  } catch (const Error& e) {
    EXPECT_EQ(e.fault(), Fault::no_memory);
    EXPECT_THAT(e.what(), HasSubstr("only 1 of 4"));
    EXPECT_THAT(e.what(), HasSubstr("usbfs_memory_mb"));
  }
  EXPECT_EQ(fake_libusb().in_flight(), 0);
  EXPECT_EQ(sink.ends, 0);
  fake_libusb().submissions_left = 3;
  const auto s = stream();
  EXPECT_EQ(s->transfers_alive(), 3) << "three of four carry it";
}

TEST_F(LibusbTest, AStreamThatLosesHalfOfItsTransfersEnds) {
  open();
  const auto s = stream();
  {
    const std::lock_guard lock(fake_libusb().mutex);
    fake_libusb().submissions_left = 0;
  }
  fake_libusb().land_all(LIBUSB_TRANSFER_COMPLETED);
  ASSERT_TRUE(eventually([&] { return sink.ends == 1; }));
  EXPECT_EQ(sink.ended_with, Status::error);
  EXPECT_TRUE(eventually([&] { return s->transfers_alive() == 0; }));
}

TEST_F(LibusbTest, AnEndpointThatStallsAtOnceIsNotAskedForEver) {
  open();
  const auto s = device->open_stream({.endpoint = 0x83, .packet_bytes = 64, .transfers = 2}, sink);
  ASSERT_TRUE(eventually([&] {
    fake_libusb().land_all(LIBUSB_TRANSFER_STALL);
    return sink.ends == 1;
  }));
  EXPECT_EQ(sink.ended_with, Status::error);
  EXPECT_LE(sink.packets, 40);
}

TEST_F(LibusbTest, WithoutKernelMemoryOrdinaryMemoryDoes) {
  open();
  fake_libusb().kernel_memory = false;
  const auto s = stream();
  EXPECT_EQ(s->transfers_alive(), 4);
  EXPECT_EQ(fake_libusb().kernel_buffers, 0);
}

TEST_F(LibusbTest, ABulkTransferThatNeverComesBackIsWaitedForWithinBounds) {
  open();
  fake_libusb().cancel_answers = false;
  std::array<std::byte, 16> data{};
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(device->bulk_in(0x81, data, 10ms).status, Status::timed_out);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 30s);
  EXPECT_EQ(device->bulk_in(0x81, data, 1000s).status, Status::error) << "nothing more is asked of a controller that does not answer";
  EXPECT_THROW(device->control_out({0, 3, 48, 0}, {}, 1000s), Error);
  device.reset();
  EXPECT_EQ(fake_libusb().in_flight(), 1);
  fake_libusb().land_all(LIBUSB_TRANSFER_CANCELLED);
}

TEST_F(LibusbTest, BulkAndControlTransfersEndAsTheDeviceSays) {
  open();
  std::array<std::byte, 16> data{};
  std::thread answer([&] {
    ASSERT_TRUE(eventually([&] { return first() != nullptr; }));
    std::memset(first()->buffer, 7, 16);
    fake_libusb().land(first(), LIBUSB_TRANSFER_COMPLETED, 9);
  });
  const auto result = device->bulk_in(0x81, data, 60s);
  answer.join();
  EXPECT_EQ(result.status, Status::completed);
  EXPECT_EQ(result.bytes, 9u);
  EXPECT_EQ(data[8], std::byte{7});
  EXPECT_EQ(data[9], std::byte{0}) << "bytes beyond the answer are left alone";
  std::thread stall([&] {
    ASSERT_TRUE(eventually([&] { return first() != nullptr; }));
    fake_libusb().land(first(), LIBUSB_TRANSFER_STALL);
  });
  try {
    device->control_out({0, 3, 48, 0}, {}, 60s);
    ADD_FAILURE();
  } catch (const Error& e) {
    EXPECT_EQ(e.fault(), Fault::stall);
  }
  stall.join();
}

TEST_F(LibusbTest, RefusalsOfTheStreamInterfaceSayWhy) {
  open();
  device->set_alternate(1, 1);
  EXPECT_EQ(fake_libusb().alternates_chosen, 1);
  const auto refusal = [&](int system_error) {
    fake_libusb().alternate_errno = system_error;
    try {
      device->set_alternate(1, 1);
    } catch (const Error& e) {
      return std::pair(e.fault(), std::string(e.what()));
    }
    return std::pair(Fault::other, std::string("no error"));
  };
  EXPECT_EQ(refusal(ENOSPC).first, Fault::no_bandwidth);
  EXPECT_THAT(refusal(ENOSPC).second, HasSubstr("controller of its own"));
  EXPECT_EQ(refusal(ENOMEM).first, Fault::no_bandwidth) << "xHCI has no resources left: the same remedy";
  EXPECT_EQ(refusal(EPROTO).first, Fault::other) << "a device that does not answer is not short of bandwidth";
  EXPECT_THAT(refusal(ETIMEDOUT).second, ::testing::Not(HasSubstr("bandwidth")));
  EXPECT_EQ(refusal(ENODEV).first, Fault::no_device);
}

TEST_F(LibusbTest, ThePacketLengthIsTheActiveConfigurationsCompanion) {
  open();
  EXPECT_EQ(device->bytes_per_interval(1, 1, 0x84), 33'792u);
  EXPECT_EQ(device->bytes_per_interval(1, 0, 0x84), 0u);
  EXPECT_EQ(device->bytes_per_interval(1, 1, 0x81), 0u);
}

TEST_F(LibusbTest, SerialsThatTheKernelKnowsAreNotAskedOfTheDevice) {
  tests::PlantedSysfs tree;
  tree.controller({});
  tree.sensor("2-1", {.serial = "012345678901"});
  tree.set(tree.folder_of("2-1") + "/devnum", "5");
  bus = make_libusb_bus({}, tree.root());
  EXPECT_EQ(bus->list(kIds).at(0).serial, "012345678901");
  EXPECT_EQ(fake_libusb().opens, 0);
  tree.set(tree.folder_of("2-1") + "/devnum", "6");  // another device is there meanwhile
  EXPECT_EQ(bus->list(kIds).at(0).serial, "asked");
  EXPECT_EQ(fake_libusb().opens, 1);
}

TEST_F(LibusbTest, ArrivalsAreCounted) {
  bus = make_libusb_bus({}, empty.path);
  const auto before = bus->changes();
  fake_libusb().fire_hotplug();
  EXPECT_GT(bus->changes(), before);
  bus.reset();
  fake_libusb().hotplug = false;
  bus = make_libusb_bus({}, empty.path);
  const auto first_look = bus->changes();
  EXPECT_EQ(bus->changes(), first_look) << "without hot-plug events the list is compared";
}

TEST_F(LibusbTest, MessagesGoToTheSinkWithoutFloodingIt) {
  std::vector<std::string> heard;
  bus = make_libusb_bus([&](bool, const std::string& text) { heard.push_back(text); }, empty.path);
  ASSERT_NE(fake_libusb().log, nullptr);
  errno = ENOSPC;
  for (int i = 0; i < 1000; ++i) fake_libusb().log(nullptr, LIBUSB_LOG_LEVEL_WARNING, "the same again\n");
  EXPECT_EQ(errno, ENOSPC) << "who reads errno after libusb has logged must find it";
  ASSERT_GE(heard.size(), 1u);
  EXPECT_LE(heard.size(), 10u);
  EXPECT_EQ(heard[0], "the same again");
  set_libusb_log({});
}

TEST_F(LibusbTest, AnErrorThatStaysIsNoBusyLoop) {
  bus = make_libusb_bus({}, empty.path);
  const auto rounds = [] {
    const std::lock_guard lock(fake_libusb().mutex);
    return fake_libusb().event_rounds;
  };
  {
    const std::lock_guard lock(fake_libusb().mutex);
    fake_libusb().events_code = LIBUSB_ERROR_OTHER;
  }
  const int before = rounds();
  std::this_thread::sleep_for(300ms);
  EXPECT_LT(rounds() - before, 100);
}

}  // namespace
}  // namespace booth::drivers::usb
