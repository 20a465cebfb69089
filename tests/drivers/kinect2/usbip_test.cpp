// The emulated sensor's far end of USB/IP, spoken to as a kernel would, and as nothing should.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <thread>

#include "drivers/clock/system_clock.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/emulator/usbip_device.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t kDevice = 0x10003;

void put(std::vector<std::byte>& out, std::uint32_t v) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::byte>(v >> shift & 0xFF));
}
std::uint32_t get(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t v = 0;
  for (std::size_t i = 0; i < 4; ++i) v = v << 8 | std::to_integer<std::uint32_t>(bytes[at + i]);
  return v;
}

/// Fields in the order of the wire (Linux, usbip_protocol.rst, USBIP_CMD_SUBMIT).
struct Header {
  std::uint32_t command = 1, sequence = 1, device = kDevice, direction = 1, endpoint = 0, flags = 0, length = 0, start = 0, packets = 0xFFFF'FFFF, interval = 0;
  std::array<std::uint8_t, 8> setup{};
  std::vector<std::byte> bytes() const {
    std::vector<std::byte> out;
    for (const auto field : {command, sequence, device, direction, endpoint, flags, length, start, packets, interval}) put(out, field);
    for (const auto b : setup) out.push_back(static_cast<std::byte>(b));
    return out;
  }
};

struct Reply {
  std::uint32_t command = 0, sequence = 0, actual = 0;
  std::int32_t status = 0;
  std::vector<std::byte> data;
};

/// The kernel's end of the connection.
class UsbipDeviceTest : public testing::Test {
 protected:
  UsbipDeviceTest() {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) throw std::runtime_error("no pair of sockets");
    host_ = ends[0];
    const EmulatedDeviceSettings settings{.serial = "000000000042", .camera = typical_camera(), .view = [](auto, auto depth, auto infrared) {
                                            std::fill(depth.begin(), depth.end(), 2000.0f);
                                            std::fill(infrared.begin(), infrared.end(), 5000.0f);
                                          }};
    model_ = std::make_shared<DeviceModel>(settings);
    device_ = std::make_unique<UsbipDevice>(model_, Identity{.serial = settings.serial}, kDevice, ends[1], std::make_shared<SystemClock>(), 125us);
  }
  ~UsbipDeviceTest() override {
    device_.reset();
    close(host_);
  }

  void send(const std::vector<std::byte>& bytes) { ASSERT_EQ(::send(host_, bytes.data(), bytes.size(), MSG_NOSIGNAL), static_cast<ssize_t>(bytes.size())); }
  void send(const Header& header) { send(header.bytes()); }

  std::vector<std::byte> receive(std::size_t count) {
    std::vector<std::byte> out(count);
    for (std::size_t at = 0; at < count;) {
      pollfd wait{.fd = host_, .events = POLLIN, .revents = 0};
      if (poll(&wait, 1, 20'000) != 1) throw std::runtime_error("no answer within 20 s");
      const ssize_t n = recv(host_, out.data() + at, count - at, 0);
      if (n <= 0) throw std::runtime_error("the connection is over");
      at += static_cast<std::size_t>(n);
    }
    return out;
  }
  Reply reply(bool in) {
    const auto header = receive(usbip::kHeaderBytes);
    Reply out{
        .command = get(header, 0), .sequence = get(header, 4), .actual = get(header, 24), .status = static_cast<std::int32_t>(get(header, 20)), .data = {}};
    if (in) out.data = receive(out.actual);
    return out;
  }
  /// Waits until the device has given the connection up.
  bool over() {
    for (int i = 0; i < 2000 && !device_->ended(); ++i) std::this_thread::sleep_for(10ms);
    return device_->ended();
  }

  int host_ = -1;
  std::shared_ptr<DeviceModel> model_;
  std::unique_ptr<UsbipDevice> device_;
};

TEST_F(UsbipDeviceTest, IntroducesItself) {
  send(Header{.sequence = 5, .length = 18, .setup = {0x80, 6, 0, kDeviceDescriptor, 0, 0, 18, 0}});
  const Reply answer = reply(true);
  EXPECT_EQ(answer.command, 3u);
  EXPECT_EQ(answer.sequence, 5u);
  EXPECT_EQ(answer.status, 0);
  ASSERT_EQ(answer.data.size(), 18u);
  const auto vendor = std::to_integer<unsigned>(answer.data[8]) | std::to_integer<unsigned>(answer.data[9]) << 8;
  EXPECT_EQ(vendor, kDeviceIds[0].first);
}

TEST_F(UsbipDeviceTest, StallsOnWhatItDoesNotKnow) {
  send(Header{.length = 18, .setup = {0x80, 6, 9, 99, 0, 0, 18, 0}});
  EXPECT_EQ(reply(false).status, -EPIPE);
  send(Header{.sequence = 2, .endpoint = 9, .length = 64});
  EXPECT_EQ(reply(false).status, -EPIPE);
  EXPECT_FALSE(device_->ended());
}

TEST_F(UsbipDeviceTest, CancelsATransferOnceAndSaysWhenItIsTooLate) {
  send(Header{.sequence = 7, .endpoint = kReplyIn & 0x0F, .length = 512});
  Header cancel{.command = 2, .sequence = 8, .endpoint = 0, .flags = 7};
  send(cancel);
  const Reply first = reply(false);
  EXPECT_EQ(first.command, 4u);
  EXPECT_EQ(first.sequence, 8u);
  EXPECT_EQ(first.status, -ECONNRESET);
  cancel.sequence = 9;
  send(cancel);
  EXPECT_EQ(reply(false).status, 0);
}

TEST_F(UsbipDeviceTest, GivesUpOnAnotherDevicesRequest) {
  send(Header{.device = kDevice + 1});
  ASSERT_TRUE(over());
  EXPECT_NE(device_->error().find("the device"), std::string::npos) << device_->error();
}

TEST_F(UsbipDeviceTest, GivesUpOnGarbage) {
  send(std::vector<std::byte>(usbip::kHeaderBytes, std::byte{0xA5}));
  ASSERT_TRUE(over());
  EXPECT_FALSE(device_->error().empty());
}

TEST_F(UsbipDeviceTest, GivesUpOnAPacketOutsideItsTransfer) {
  auto bytes = Header{.endpoint = kInfraredIn & 0x0F, .length = 1000, .packets = 1}.bytes();
  for (const std::uint32_t field : {999u, 2u, 0u, 0u}) put(bytes, field);
  send(bytes);
  ASSERT_TRUE(over());
  EXPECT_NE(device_->error().find("the place of a packet"), std::string::npos) << device_->error();
}

TEST_F(UsbipDeviceTest, GivesUpOnATransferThatNoBufferHolds) {
  send(Header{.direction = 0, .endpoint = kCommandOut, .length = 7u << 20});
  ASSERT_TRUE(over());
  EXPECT_NE(device_->error().find("bytes are sent"), std::string::npos) << device_->error();
}

TEST_F(UsbipDeviceTest, EndsQuietlyInTheMiddleOfARequest) {
  auto bytes = Header{.direction = 0, .endpoint = kCommandOut, .length = 400}.bytes();
  bytes.resize(bytes.size() + 100);
  send(bytes);
  shutdown(host_, SHUT_WR);
  ASSERT_TRUE(over());
  EXPECT_TRUE(device_->error().empty()) << device_->error();
}

TEST_F(UsbipDeviceTest, ManyTransfersThatNobodyFillsEndWithThePlug) {
  for (std::uint32_t i = 0; i < 500; ++i) send(Header{.sequence = 100 + i, .endpoint = kReplyIn & 0x0F, .length = 512});
  device_->leave();
  EXPECT_TRUE(over());
}

}  // namespace
}  // namespace booth::drivers::kinect2::emulator
