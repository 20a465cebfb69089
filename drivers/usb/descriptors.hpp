// What a device's raw descriptors say of the bandwidth that its alternate settings reserve.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/usb_topology.hpp"

namespace booth::drivers::usb {

/// One alternate setting of one interface of one configuration.
struct AlternateSetting {
  int configuration = 0, interface = 0, alternate = 0;
  double reserved = 0;  ///< bytes per second of its periodic (isochronous and interrupt) endpoints
};

/// `bytes` is the device descriptor followed by its configurations, as the kernel's file `descriptors` has them. Hostile bytes end the walk early; what came
/// before them is returned. The rates are those of a device at this speed: service intervals of 2^(bInterval-1) * 125 us at high speed and above, of
/// milliseconds below it (USB 2.0 section 9.6.6, USB 3.1 sections 9.6.6 and 9.6.7).
std::vector<AlternateSetting> alternate_settings(std::span<const std::byte> bytes, hal::UsbSpeed speed);

}  // namespace booth::drivers::usb
