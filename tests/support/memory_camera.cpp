// Time decides which frame is next; the memory is read round and round.
#include "tests/support/memory_camera.hpp"

#include <algorithm>
#include <stdexcept>

namespace booth::tests {

MemoryCamera::MemoryCamera(const FrameMemory& memory, std::size_t index, hal::Clock& clock, hal::MonotonicTime begin, Decode decode)
    : memory_(memory), index_(index), clock_(clock), begin_(begin), decode_(std::move(decode)) {}

void MemoryCamera::start() {
  if (lost) throw std::runtime_error(description().name + " is not plugged in; this sentence is longer than a small string");
  running_ = true;
}

hal::MonotonicTime MemoryCamera::captured(std::uint64_t n) const {
  const auto& frames = memory_.frames[index_];
  return begin_ + (frames[n % frames.size()].captured - memory_.origin) + static_cast<std::int64_t>(n / frames.size()) * memory_.length;
}

hal::ReadStatus MemoryCamera::read(hal::DepthFrame& slot, hal::Nanoseconds timeout) {
  if (lost) return hal::ReadStatus::lost;
  if (!running_) return hal::ReadStatus::ended;
  const hal::MonotonicTime now = clock_.now();
  for (; captured(next_ + 1) + kDelivery <= now; ++next_) dropped_.fetch_add(1, std::memory_order_relaxed);
  const hal::MonotonicTime due = captured(next_) + kDelivery;
  clock_.sleep_until(std::min(due, now + timeout));
  if (clock_.now() < due) return hal::ReadStatus::timeout;
  const auto& frames = memory_.frames[index_];
  const std::size_t number = next_ % frames.size();
  slot.sequence = next_;
  slot.captured = captured(next_);
  slot.received = due;
  slot.depth.resize(frames[number].depth.size());
  if (decode_)
    decode_(number, slot.depth);
  else
    std::copy(frames[number].depth.begin(), frames[number].depth.end(), slot.depth.begin());
  ++next_;
  delivered_.fetch_add(1, std::memory_order_relaxed);
  return hal::ReadStatus::frame;
}

}  // namespace booth::tests
