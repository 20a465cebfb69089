// What a host may send an emulated sensor over USB/IP: headers, packet descriptors and requests to endpoint 0, whole and broken.
#include <algorithm>
#include <variant>

#include "drivers/kinect2/emulator/control_endpoint.hpp"
#include "drivers/kinect2/emulator/device_model.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/emulator/usbip_protocol.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::drivers::kinect2::emulator;
using booth::fuzz::Input;
using booth::fuzz::require;

constexpr std::uint32_t kDevice = 7;

DeviceModel& model() {
  static DeviceModel one({.camera = typical_camera(), .view = [](auto, auto depth, auto infrared) {
                            std::fill(depth.begin(), depth.end(), 2000.0f);
                            std::fill(infrared.begin(), infrared.end(), 5000.0f);
                          }});
  return one;
}

void handle(ControlEndpoint& endpoint, const usbip::Submit& request, Input& input) {
  const auto descriptors = input.bytes(request.packets * usbip::kIsochronousBytes);
  try {
    const auto packets = usbip::parse_packets(descriptors, request);
    for (const auto& packet : packets) require(packet.offset + packet.length <= request.length, "packets lie within their transfer");
  } catch (const usbip::ProtocolError&) {
    return;
  }
  if (request.endpoint != 0) return;
  const Setup setup = parse_setup(request.setup);
  const auto data = input.bytes(std::min<std::size_t>(request.in ? 0 : request.length, 256));
  const auto answer = endpoint.handle(setup, data);
  if (answer && setup.in()) require(answer->size() <= setup.length, "no answer is longer than what was asked for");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  model().bus_reset();
  ControlEndpoint endpoint(model(), {.serial = "000000000001", .high_speed = (input.u8() & 1) != 0});
  for (int i = 0; i < 16 && !input.empty(); ++i) {
    std::array<std::byte, usbip::kHeaderBytes> header{};
    const auto bytes = input.bytes(header.size());
    std::copy(bytes.begin(), bytes.end(), header.begin());
    try {
      const auto request = usbip::parse_request(header, kDevice);
      if (const auto* submit = std::get_if<usbip::Submit>(&request)) handle(endpoint, *submit, input);
    } catch (const usbip::ProtocolError&) {
      return 0;  // the connection is given up
    }
  }
  return 0;
}
