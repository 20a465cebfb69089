// The few lines between the daemon and drivers/usb.
#include "daemon/drivers_factory.usb.hpp"

#include "drivers/kinect2/layout.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "drivers/usb/sysfs_topology.hpp"

namespace booth::daemon {

namespace kinect2 = drivers::kinect2;

std::unique_ptr<hal::UsbTopologySource> open_usb_topology(const std::filesystem::path& root) { return drivers::usb::make_sysfs_topology(root); }

double usbfs_bytes(const Config& config) {
  constexpr double kLargestReply = 0x1C0000, kColourTransfers = 20;
  const auto& kinect = config.cameras.kinect2;
  return static_cast<double>(kinect.transfers) * kinect2::kPacketsPerTransfer * static_cast<double>(kinect2::kPacketBytes) + kLargestReply +
         (kinect.colour ? kColourTransfers * static_cast<double>(kinect2::kColourTransferBytes) : 0);
}

std::vector<std::string> configured_serials(const Config& config) {
  const auto& kinect = config.cameras.kinect2;
  std::error_code unreadable;
  const bool calibrated = !kinect.calibration.empty() && (std::filesystem::exists(kinect.calibration, unreadable) || unreadable);
  if (!kinect.serials.empty() || !calibrated) return kinect.serials;
  std::vector<std::string> out;
  for (const auto& camera : drivers::read_calibration(kinect.calibration)) out.push_back(camera.serial);
  return out;
}

}  // namespace booth::daemon
