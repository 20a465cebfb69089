// A libusb context with the thread that handles its events, and a handle that lives as long as anything flies on it.
#pragma once

#include <libusb-1.0/libusb.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace booth::drivers::usb {

/// Where libusb's own messages go from now on, in every context; without one they are dropped. Never to stderr. At most one message a second is handed on,
/// the others are counted.
void set_libusb_log(std::function<void(bool error, const std::string& text)> sink);

/// One for each opened device, so that a slow camera never holds up another's packets.
class Context {
 public:
  /// Throws Error.
  Context();
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  /// Starts the thread, with a name that `top -H` shows (15 bytes at most) and real-time priority where that is permitted. Once.
  void handle_events(const std::string& name);
  libusb_context* get() const { return context_; }

 private:
  struct Life {
    std::atomic<bool> stop{false}, orphan{false};
  };
  libusb_context* context_ = nullptr;
  const std::shared_ptr<Life> life_ = std::make_shared<Life>();
  std::thread thread_;
};

/// Closed when the last transfer on it has called back, however late that is: libusb_close() and libusb_exit() with transfers in flight abort the process.
struct Handle {
  std::shared_ptr<Context> context;
  libusb_device_handle* handle = nullptr;
  std::atomic<bool> wedged{false};  ///< a cancelled transfer did not come back: the controller answers no more, nothing else is asked of it

  Handle() = default;
  ~Handle() {
    if (handle != nullptr) libusb_close(handle);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
};

}  // namespace booth::drivers::usb
