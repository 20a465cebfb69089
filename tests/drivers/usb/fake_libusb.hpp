// A libusb that does what a test says: linked before the real one, it takes the place of every function that drivers/usb calls.
#pragma once

#include <libusb-1.0/libusb.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

namespace booth::tests {

/// One device on bus 2, port 1, address 5. Everything is guarded by `mutex`; change settings before the calls that they concern.
struct FakeLibusb {
  std::mutex mutex;
  std::condition_variable changed;

  // What a test sets.
  int submissions_left = -1;  ///< after so many, submitting fails; -1: never
  int submit_code = LIBUSB_ERROR_IO, submit_errno = 0;
  bool cancel_answers = true;  ///< a cancelled transfer calls back
  bool kernel_memory = true;   ///< libusb_dev_mem_alloc works
  bool hotplug = true;
  int alternate_errno = 0, alternates_chosen = 0;
  int active_configuration = 1;
  int events_code = 0;  ///< what handling events returns when there is nothing

  // What a test looks at.
  std::vector<libusb_transfer*> flying;
  int transfers = 0, kernel_buffers = 0, contexts = 0, handles = 0, opens = 0, event_rounds = 0;
  std::vector<std::string> offences;  ///< freeing what flies, closing under what flies, exiting under what is open

  /// The event thread will call this transfer back.
  void land(libusb_transfer* transfer, libusb_transfer_status status, int bytes = 0);
  /// Every transfer in flight.
  void land_all(libusb_transfer_status status);
  void fire_hotplug();
  int in_flight();

  struct Landing {
    libusb_transfer* transfer;
    libusb_transfer_status status;
    int bytes;
  };
  std::deque<Landing> landings;
  bool interrupted = false;
  libusb_hotplug_callback_fn hotplug_callback = nullptr;
  void* hotplug_data = nullptr;
  libusb_log_cb log = nullptr;
};

/// Replaced by reset_fake_libusb().
FakeLibusb& fake_libusb();
void reset_fake_libusb();

}  // namespace booth::tests
