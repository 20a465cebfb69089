// What the daemon asks of USB apart from cameras: a picture of the machine, and which sensors the configuration names.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "hal/usb_topology.hpp"

namespace booth::daemon {

/// `root` stands for "/".
std::unique_ptr<hal::UsbTopologySource> open_usb_topology(const std::filesystem::path& root = "/");

/// Whether a device is a sensor that cameras.driver = "kinect2" can use.
bool is_sensor(const hal::UsbDevice& device);
/// Bytes of usbfs memory for one sensor, streams and the largest reply of its start.
double usbfs_bytes(const Config& config);

/// Serials of cameras.kinect2, from the key or from the calibration file. Throws std::runtime_error when that file cannot be read.
std::vector<std::string> configured_serials(const Config& config);

}  // namespace booth::daemon
