// Every fault of the command channel and of the opening sequence, on an emulated device without streams.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "drivers/clock/system_clock.hpp"
#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/command_channel.hpp"
#include "drivers/kinect2/emulator/emulated_bus.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/kinect_device.hpp"

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;
using emulator::Fault;
using Kind = CommandError::Kind;

emulator::EmulatedDeviceSettings plain(const std::string& serial = "111") {
  return {.serial = serial, .camera = emulator::typical_camera(), .still = true, .view = [](hal::MonotonicTime, std::span<float>, std::span<float>) {}};
}

class CommandTest : public testing::Test {
 protected:
  CommandTest() {
    bus_->add(plain());
    device_ = bus_->open(find_kinect(*bus_, "111"));
    channel_ = std::make_unique<CommandChannel>(*device_);
  }
  /// Kind of the error that a command ends with; nothing when it succeeds.
  template <typename Run>
  static std::optional<Kind> outcome(Run run) {
    try {
      (void)run();
      return std::nullopt;
    } catch (const CommandError& e) {
      return e.kind();
    }
  }
  std::shared_ptr<emulator::EmulatedBus> bus_ = emulator::make_emulated_bus(std::make_shared<SystemClock>());
  std::unique_ptr<usb::Device> device_;
  std::unique_ptr<CommandChannel> channel_;
};

TEST_F(CommandTest, RequestsHaveTheExactLayout) {
  std::array<std::byte, 36> out{};
  const std::array<std::uint32_t, 1> parameter{3};
  EXPECT_EQ(write_request(out, 7, Command::read_page, parameter, 92), 24u);
  for (const auto& [at, value] : {std::pair{0, 0x0602'2009u}, {4, 7u}, {8, 92u}, {12, 0x22u}, {16, 0u}, {20, 3u}})
    EXPECT_EQ(read_u32(out, static_cast<std::size_t>(at)), value) << "offset " << at;
  const std::array<std::uint32_t, 5> five{};
  EXPECT_THROW((void)write_request(out, 0, Command::light, five, 0), std::invalid_argument);
}

TEST_F(CommandTest, ReadsWhatTheDeviceSays) {
  EXPECT_EQ(channel_->firmware(), "2.3.3912.0");
  EXPECT_EQ(channel_->serial(), "111");
  EXPECT_EQ(channel_->status(), 0x2601u);
  channel_->start_infrared();
  EXPECT_EQ(channel_->status(), 0x2603u);
  EXPECT_EQ(channel_->phase_offsets().p0[1][1000], emulator::realistic_phase_offsets().p0[1][1000]);
  EXPECT_NEAR(channel_->colour_camera().fc, 1081.37, 1e-3);
}

struct CommandFault {
  Fault fault;
  const char* name;
  std::optional<Kind> once;  ///< what one occurrence costs: a repetition, or the command
  Kind always;               ///< when it does not stop
};

class CommandFaultTest : public CommandTest, public testing::WithParamInterface<CommandFault> {};

TEST_P(CommandFaultTest, CostsOneRepetitionOrTheCommandAndNotTheNext) {
  bus_->faults(0).inject(GetParam().fault);
  EXPECT_EQ(outcome([&] { return channel_->depth_camera(); }), GetParam().once);
  EXPECT_EQ(channel_->status(), 0x2601u) << "the next command has its own answer";
  EXPECT_NEAR(channel_->depth_camera().fx, 365.4028, 1e-4);
  bus_->faults(0).inject(GetParam().fault, 1000);
  EXPECT_EQ(outcome([&] { return channel_->depth_camera(); }), GetParam().always);
  bus_->faults(0).clear();
  channel_->drain();
  EXPECT_EQ(channel_->firmware(), "2.3.3912.0");
}

INSTANTIATE_TEST_SUITE_P(Commands, CommandFaultTest,
                         testing::Values(CommandFault{Fault::command_timeout, "TimeOut", std::nullopt, Kind::timeout},
                                         CommandFault{Fault::late_completion, "LateCompletion", std::nullopt, Kind::timeout},
                                         CommandFault{Fault::wrong_transaction, "WrongTransaction", std::nullopt, Kind::timeout},
                                         CommandFault{Fault::premature_completion, "PrematureCompletion", Kind::premature, Kind::premature},
                                         CommandFault{Fault::reply_is_completion, "DataThatBeginLikeACompletion", Kind::premature, Kind::premature},
                                         CommandFault{Fault::short_data, "ShortData", Kind::short_data, Kind::short_data},
                                         CommandFault{Fault::refused, "NonZeroStatus", Kind::refused, Kind::refused}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_F(CommandTest, DataOfACommandThatWasGivenUpAreNotTakenForTheNext) {
  // Both tries of the first command come late: its data and completions arrive before those of the second.
  bus_->faults(0).inject(Fault::late_completion, 2);
  EXPECT_EQ(outcome([&] { return channel_->firmware(); }), Kind::timeout);
  EXPECT_EQ(channel_->serial(), "111");
}

TEST_F(CommandTest, ABadCalibrationIsRefusedAndAGoodOneTakenAfterwards) {
  for (const Fault fault : {Fault::nan_intrinsics, Fault::zero_intrinsics, Fault::huge_intrinsics}) {
    bus_->faults(0).inject(fault);
    EXPECT_EQ(outcome([&] { return channel_->depth_camera(); }), Kind::short_data);
    EXPECT_EQ(outcome([&] { return channel_->depth_camera(); }), std::nullopt);
  }
  bus_->faults(0).inject(Fault::short_phase_tables);
  EXPECT_EQ(outcome([&] { return channel_->phase_offsets(); }), Kind::short_data) << "one byte short";
  bus_->faults(0).inject(Fault::serial_without_terminator);
  EXPECT_EQ(channel_->serial(), "111");
  bus_->faults(0).inject(Fault::serial_with_control_characters);
  EXPECT_EQ(outcome([&] { return channel_->serial(); }), Kind::short_data);
}

TEST_F(CommandTest, SaysThatTheDeviceLeft) {
  bus_->unplug(0);
  EXPECT_EQ(outcome([&] { return channel_->status(); }), Kind::gone);
}

// ---- Opening

class OpenTest : public testing::Test {
 protected:
  std::unique_ptr<KinectDevice> open(const std::string& serial, Patience patience = {}) {
    DeviceOptions options{.reset = false, .patience = patience, .notes = [this](Gravity gravity, const std::string& text) {
                            (gravity == Gravity::warning ? warnings_ : infos_).push_back(text);
                          }};
    return std::make_unique<KinectDevice>(*bus_, serial, std::move(options), cancel_);
  }
  std::shared_ptr<emulator::EmulatedBus> bus_ = emulator::make_emulated_bus(std::make_shared<SystemClock>());
  std::atomic<bool> cancel_{false};
  std::vector<std::string> warnings_, infos_;
};

TEST_F(OpenTest, ASerialThatDoesNotMatchIsAWarningOnly) {
  bus_->add(plain());
  bus_->faults(0).inject(Fault::serial_with_control_characters);
  const auto device = open("111");
  EXPECT_EQ(device->calibration(nullptr).firmware, "2.3.3912.0");
  ASSERT_EQ(warnings_.size(), 1u);
  EXPECT_NE(warnings_[0].find("the serial of its plug is used"), std::string::npos);
  ASSERT_FALSE(infos_.empty());
  EXPECT_NE(infos_[0].find("firmware 2.3.3912.0"), std::string::npos);
}

TEST_F(OpenTest, ASensorAtUsb2SpeedIsNotOpened) {
  auto settings = plain();
  settings.speed = usb::Speed::high;
  bus_->add(std::move(settings));
  try {
    (void)open("111");
    FAIL();
  } catch (const usb::Error& e) {
    EXPECT_EQ(e.fault(), usb::Fault::unsupported);
    EXPECT_NE(std::string(e.what()).find("USB 2 speed"), std::string::npos);
  }
  EXPECT_TRUE(bus_->requests(0).empty());
}

TEST_F(OpenTest, ADescriptorThatReservesTooLittleIsRefused) {
  auto settings = plain();
  settings.bytes_per_interval = kPacketBytes - 1024;
  bus_->add(std::move(settings));
  EXPECT_THROW((void)open("111"), usb::Error);
}

TEST_F(OpenTest, NotReadyIsSaidWithTheStatusWord) {
  bus_->add(plain());
  bus_->faults(0).inject(Fault::never_ready, 1000);
  const auto device = open("111", {.ready = 50ms, .ready_poll = 5ms});
  struct Nobody : usb::StreamSink {
    void on_packet(usb::Status, std::span<const std::byte>, hal::MonotonicTime) override {}
    void on_end(usb::Status) override {}
  } nobody;
  try {
    device->start(4, nobody, nullptr);
    FAIL();
  } catch (const NotReady& e) {
    EXPECT_NE(std::string(e.what()).find("0x2600"), std::string::npos);
  }
  bus_->faults(0).clear();
  device->start(4, nobody, nullptr);
  EXPECT_TRUE(device->stop());
  const auto requests = bus_->requests(0);
  EXPECT_EQ(requests.back().substr(0, 12), "control 1 3 ") << "it is left suspended";
}

}  // namespace
}  // namespace booth::drivers::kinect2
