// Who may touch what: slots, counts and flags under the mutex; the sink from the event thread outside of it, marked by `in_sink`.
#include "drivers/usb/libusb_stream.hpp"

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#include "drivers/usb/libusb_errors.hpp"

namespace booth::drivers::usb {
namespace {

using namespace std::chrono_literals;

constexpr unsigned kTransferTimeoutMs = 1000;
/// Failures in a row, for each transfer: an endpoint that stalls at once whenever it is asked must not become a busy loop.
constexpr int kFailuresInARow = 8;

hal::MonotonicTime monotonic_now() { return hal::MonotonicTime(std::chrono::steady_clock::now().time_since_epoch()); }

struct Pool {
  std::shared_ptr<Handle> device;
  StreamSettings settings;
  StreamSink* sink = nullptr;
  struct Slot {
    Pool* pool = nullptr;
    libusb_transfer* transfer = nullptr;
    unsigned char* memory = nullptr;
    bool kernel_memory = false;
    bool flying = false;
  };
  std::vector<Slot> slots;

  mutable std::mutex mutex;
  std::condition_variable landed;
  int alive = 0, failures = 0;
  bool stopping = false, ended = false, in_sink = false;
  std::shared_ptr<Pool> self;  ///< set while transfers fly

  Pool() = default;
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;
  ~Pool();
  std::size_t bytes() const { return settings.packet_bytes * static_cast<std::size_t>(settings.isochronous ? settings.packets_per_transfer : 1); }
  void fill(Slot& slot);
  /// Code and errno of the submission that failed first.
  std::pair<int, int> submit(const std::shared_ptr<Pool>& me);
  bool stop(hal::Nanoseconds at_most, bool tell);
  void deliver(const libusb_transfer& transfer);
  bool worth_another_try(libusb_transfer_status status);
  static void LIBUSB_CALL called_back(libusb_transfer* transfer) noexcept;
};

Pool::~Pool() {
  for (Slot& s : slots) {
    if (s.transfer != nullptr) libusb_free_transfer(s.transfer);
    if (s.memory == nullptr) continue;
    if (s.kernel_memory) {
      libusb_dev_mem_free(device->handle, s.memory, bytes());
    } else {
      delete[] s.memory;
    }
  }
}

void Pool::fill(Slot& slot) {
  const int packets = settings.isochronous ? settings.packets_per_transfer : 0;
  slot.pool = this;
  slot.transfer = libusb_alloc_transfer(packets);
  // Memory of usbfs itself saves a copy of each packet; where the kernel or its limit refuses, ordinary memory does.
  slot.memory = libusb_dev_mem_alloc(device->handle, bytes());
  slot.kernel_memory = slot.memory != nullptr;
  if (!slot.kernel_memory) slot.memory = new (std::nothrow) unsigned char[bytes()];
  if (slot.transfer == nullptr || slot.memory == nullptr) throw Error(Fault::no_memory, "no memory for the transfers of a USB stream");
  const int length = static_cast<int>(bytes());
  if (settings.isochronous) {
    libusb_fill_iso_transfer(slot.transfer, device->handle, settings.endpoint, slot.memory, length, packets, called_back, &slot, kTransferTimeoutMs);
    libusb_set_iso_packet_lengths(slot.transfer, static_cast<unsigned>(settings.packet_bytes));
  } else {
    libusb_fill_bulk_transfer(slot.transfer, device->handle, settings.endpoint, slot.memory, length, called_back, &slot, kTransferTimeoutMs);
  }
}

std::pair<int, int> Pool::submit(const std::shared_ptr<Pool>& me) {
  const std::lock_guard lock(mutex);
  std::pair<int, int> refused{LIBUSB_SUCCESS, 0};
  for (Slot& slot : slots) {
    errno = 0;
    refused.first = libusb_submit_transfer(slot.transfer);
    refused.second = errno;
    if (refused.first != LIBUSB_SUCCESS) break;
    slot.flying = true;
    ++alive;
  }
  if (alive > 0) self = me;
  return refused;
}

void Pool::deliver(const libusb_transfer& transfer) {
  const auto now = monotonic_now();
  const auto* memory = reinterpret_cast<const std::byte*>(transfer.buffer);
  const Status status = status_of(transfer.status);
  if (!settings.isochronous) {
    const auto length = std::min(static_cast<std::size_t>(std::max(transfer.actual_length, 0)), bytes());
    sink->on_packet(status, {memory, length}, now);
    return;
  }
  for (int i = 0; i < transfer.num_iso_packets; ++i) {
    const auto& packet = transfer.iso_packet_desc[i];
    // Of a transfer that failed as a whole, lengths and states of packets are those of its flight before.
    const bool known = transfer.status == LIBUSB_TRANSFER_COMPLETED;
    // The place follows from the index alone: a bad packet takes as much room as a good one.
    const std::size_t length = known ? std::min<std::size_t>(packet.actual_length, settings.packet_bytes) : 0;
    sink->on_packet(known ? status_of(packet.status) : status, {memory + static_cast<std::size_t>(i) * settings.packet_bytes, length}, now);
  }
}

bool Pool::worth_another_try(libusb_transfer_status status) {
  if (status == LIBUSB_TRANSFER_COMPLETED) failures = 0;
  if (status == LIBUSB_TRANSFER_COMPLETED || status == LIBUSB_TRANSFER_TIMED_OUT) return true;  // a time-out took its second
  return ++failures <= kFailuresInARow * static_cast<int>(slots.size());
}

void LIBUSB_CALL Pool::called_back(libusb_transfer* transfer) noexcept {
  Slot& slot = *static_cast<Slot*>(transfer->user_data);
  Pool& pool = *slot.pool;
  std::shared_ptr<Pool> last;  // outlives the lock
  std::unique_lock lock(pool.mutex);
  bool gone = transfer->status == LIBUSB_TRANSFER_NO_DEVICE;
  const bool flies_on = !gone && transfer->status != LIBUSB_TRANSFER_CANCELLED;
  const auto outside = [&](auto call) {
    pool.in_sink = true;
    lock.unlock();
    call();
    lock.lock();
    pool.in_sink = false;
  };
  if (flies_on && !pool.stopping) outside([&] { pool.deliver(*transfer); });
  if (flies_on && !pool.stopping && !pool.ended && pool.worth_another_try(transfer->status)) {
    const int code = libusb_submit_transfer(transfer);
    if (code == LIBUSB_SUCCESS) return;
    gone = code == LIBUSB_ERROR_NO_DEVICE;
  }
  slot.flying = false;
  --pool.alive;
  // Fewer than half of its transfers cannot carry a stream.
  if (!pool.ended && !pool.stopping && (gone || 2 * pool.alive < static_cast<int>(pool.slots.size()))) {
    pool.ended = true;
    outside([&] { pool.sink->on_end(gone ? Status::no_device : Status::error); });
  }
  if (pool.alive == 0) last = std::move(pool.self);
  pool.landed.notify_all();
}

bool Pool::stop(hal::Nanoseconds at_most, bool tell) {
  std::unique_lock lock(mutex);
  stopping = true;
  for (Slot& slot : slots)
    if (slot.flying) (void)libusb_cancel_transfer(slot.transfer);
  const bool all_back = landed.wait_for(lock, at_most, [this] { return alive == 0 && !in_sink; });
  // The device may keep us waiting for ever, the sink may not: its owner is about to let go of it.
  landed.wait(lock, [this] { return !in_sink; });
  if (!std::exchange(ended, true) && tell) {
    lock.unlock();
    sink->on_end(Status::cancelled);
  }
  return all_back;
}

class LibusbStream final : public Stream {
 public:
  explicit LibusbStream(std::shared_ptr<Pool> pool) : pool_(std::move(pool)) {}
  ~LibusbStream() override { (void)stop(3s); }

  bool stop(hal::Nanoseconds at_most) noexcept override { return pool_->stop(at_most, true); }
  int transfers_alive() const override {
    const std::lock_guard lock(pool_->mutex);
    return pool_->alive;
  }

 private:
  const std::shared_ptr<Pool> pool_;
};

}  // namespace

std::unique_ptr<Stream> open_libusb_stream(const std::shared_ptr<Handle>& device, const StreamSettings& settings, StreamSink& sink, const std::string& name) {
  if (settings.transfers < 1 || settings.packets_per_transfer < 1 || settings.packet_bytes < 1 || settings.packet_bytes > (std::size_t{1} << 24))
    throw Error(Fault::unsupported, name + ": a stream needs at least one transfer of at least one byte");
  const auto pool = std::make_shared<Pool>();
  pool->device = device;
  pool->settings = settings;
  pool->sink = &sink;
  pool->slots.resize(static_cast<std::size_t>(settings.transfers));
  for (auto& slot : pool->slots) pool->fill(slot);
  const auto [code, system_error] = pool->submit(pool);
  auto stream = std::make_unique<LibusbStream>(pool);
  if (2 * stream->transfers_alive() < settings.transfers) {
    const int flew = stream->transfers_alive();
    (void)pool->stop(3s, false);  // the sink is told by the exception
    // Isochronous transfers that usbfs has no memory for arrive as a plain I/O error from an older libusb, with no errno that survived.
    fail(code, system_error == 0 && code == LIBUSB_ERROR_IO ? ENOMEM : system_error,
         name + ": only " + std::to_string(flew) + " of " + std::to_string(settings.transfers) + " transfers could be submitted");
  }
  return stream;
}

}  // namespace booth::drivers::usb
