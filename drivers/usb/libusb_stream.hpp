// The transfers of one stream: allocated once, kept in flight, and never freed before they have called back.
#pragma once

#include <memory>

#include "drivers/usb/libusb_context.hpp"
#include "drivers/usb/usb.hpp"

namespace booth::drivers::usb {

/// `name` is the device's, for sentences. Throws Error when fewer than half of the transfers could be submitted; those that were have been cancelled.
std::unique_ptr<Stream> open_libusb_stream(const std::shared_ptr<Handle>& device, const StreamSettings& settings, StreamSink& sink, const std::string& name);

}  // namespace booth::drivers::usb
