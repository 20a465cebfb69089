// Moments lie one behind the other and never across the end; positions are counted from the beginning of time, so that a reader knows when it was overtaken.
#include "drivers/recording/moment_ring.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstring>
#include <new>

namespace booth::drivers {

struct MomentRing::Header {
  std::uint32_t size = 0;  ///< of the bytes behind; kGap: the next moment is at the ring's beginning
  Moment moment;
};

namespace {
constexpr std::uint32_t kGap = 0xffffffff;
constexpr std::size_t kAlign = 16;
constexpr std::size_t aligned(std::size_t n) { return (n + kAlign - 1) / kAlign * kAlign; }
}  // namespace

MomentRing::MomentRing(std::size_t bytes, hal::Nanoseconds keep) : capacity_(std::max(aligned(bytes), std::size_t{4096})), keep_(keep) {
  void* memory = ::mmap(nullptr, capacity_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  (void)::madvise(memory, capacity_, MADV_DONTDUMP);
  memory_ = static_cast<std::byte*>(memory);
}

MomentRing::~MomentRing() { ::munmap(memory_, capacity_); }

MomentRing::Header& MomentRing::header(std::uint64_t position) const { return *reinterpret_cast<Header*>(memory_ + position % capacity_); }

std::uint64_t MomentRing::past_gap(std::uint64_t position) const {
  const std::size_t left = capacity_ - position % capacity_;
  return left < sizeof(Header) || header(position).size == kGap ? position + left : position;
}

void MomentRing::drop_oldest() {
  first_position_ += aligned(sizeof(Header) + header(first_position_).size);
  if (++first_number_ == next_number_)
    first_position_ = next_position_;
  else
    first_position_ = past_gap(first_position_);
}

bool MomentRing::push(const Moment& moment, std::span<const std::byte> bytes) {
  const std::size_t size = aligned(sizeof(Header) + bytes.size());
  if (size > capacity_) return false;
  const std::lock_guard lock(mutex_);
  newest_ = std::max(newest_, moment.time);
  while (first_number_ != next_number_ && header(first_position_).moment.time < newest_ - keep_) drop_oldest();
  const std::size_t left = capacity_ - next_position_ % capacity_;
  const std::uint64_t at = size > left ? next_position_ + left : next_position_;
  while (first_number_ != next_number_ && at + size - first_position_ > capacity_) drop_oldest();
  if (at != next_position_ && left >= sizeof(Header)) header(next_position_).size = kGap;
  if (first_number_ == next_number_) first_position_ = at;
  Header& h = header(at);
  h.size = static_cast<std::uint32_t>(bytes.size());
  h.moment = moment;
  if (!bytes.empty()) std::memcpy(memory_ + at % capacity_ + sizeof(Header), bytes.data(), bytes.size());
  next_position_ = at + size;
  ++next_number_;
  return true;
}

MomentRing::Cursor MomentRing::oldest() const {
  const std::lock_guard lock(mutex_);
  return {first_number_, first_position_};
}

MomentRing::Cursor MomentRing::next() const {
  const std::lock_guard lock(mutex_);
  return {next_number_, next_position_};
}

bool MomentRing::read(Cursor& cursor, Moment& moment, std::vector<std::byte>& bytes, std::uint64_t& missed) const {
  const std::lock_guard lock(mutex_);
  if (cursor.number < first_number_) {
    missed += first_number_ - cursor.number;
    cursor = {first_number_, first_position_};
  }
  if (cursor.number == next_number_) return false;
  // A cursor that stood at the end did not know yet whether the next moment would fit before the ring's end.
  const std::uint64_t at = cursor.number == first_number_ ? first_position_ : past_gap(cursor.position);
  const Header& h = header(at);
  moment = h.moment;
  const std::byte* data = memory_ + at % capacity_ + sizeof(Header);
  bytes.assign(data, data + h.size);
  cursor = {cursor.number + 1, at + aligned(sizeof(Header) + h.size)};
  return true;
}

std::size_t MomentRing::held_bytes() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::size_t>(next_position_ - first_position_);
}

hal::Nanoseconds MomentRing::held_time() const {
  const std::lock_guard lock(mutex_);
  return first_number_ == next_number_ ? hal::Nanoseconds{} : std::max(hal::Nanoseconds{}, newest_ - header(first_position_).moment.time);
}

}  // namespace booth::drivers
