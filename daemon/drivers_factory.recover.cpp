// Little enough to be read whole: it is all that runs as root.
#include "daemon/drivers_factory.recover.hpp"

#include <algorithm>

#include "daemon/drivers_factory.usb.hpp"
#include "drivers/kinect2/layout.hpp"
#include "drivers/usb/recover_request.hpp"

namespace booth::daemon {

bool is_sensor(const hal::UsbDevice& device) {
  using drivers::kinect2::kDeviceIds;
  return std::find(std::begin(kDeviceIds), std::end(kDeviceIds), std::pair(device.vendor, device.product)) != std::end(kDeviceIds);
}

RecoverReport answer_recover_step(const std::string& step, const std::string& requests, const std::string& answers) {
  const auto known = drivers::usb::parse_recover_step(step);
  if (!known) return {.known = false, .failed = true, .sentence = "\"" + step.substr(0, 32) + "\" is no step; there are port, controller and usbfs-memory"};
  drivers::usb::PowerControl power(is_sensor);
  const auto outcome = drivers::usb::answer_recover_request(*known, requests, answers, power);
  using Result = drivers::usb::PowerOutcome::Result;
  return {.known = true, .failed = outcome.result == Result::failed || outcome.result == Result::not_permitted, .sentence = outcome.sentence};
}

}  // namespace booth::daemon
