// One thread, one queue ordered by when each frame is due.
#include "tests/daemon/dds/network/faulty_wire.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>

namespace booth::tests {

FaultyWire::FaultyWire(int one, int other) : ends_{one, other}, thread_([this] { run(); }) {}

FaultyWire::~FaultyWire() {
  stop_ = true;
  thread_.join();
  ::close(ends_[0]);
  ::close(ends_[1]);
}

void FaultyWire::take(int from, int to) {
  std::uint8_t bytes[2048];
  for (ssize_t n = 0; (n = ::read(from, bytes, sizeof bytes)) > 0;) {
    const auto chance = [&] { return std::uniform_real_distribution<double>(0, 1)(random_); };
    if (cut || chance() < loss) {
      ++lost_;
      continue;
    }
    auto due = Clock::now() + std::chrono::milliseconds(delay_ms);
    if (chance() < reorder) {
      due += std::chrono::microseconds(5000 + static_cast<int>(20000 * chance()));
      ++late_;
    }
    waiting_.push({due, number_++, to, {bytes, bytes + n}});
  }
}

void FaultyWire::run() {
  while (!stop_) {
    int wait_ms = 20;
    if (!waiting_.empty())
      wait_ms = std::clamp<int>(static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(waiting_.top().due - Clock::now()).count()), 0, 20);
    pollfd ready[2] = {{ends_[0], POLLIN, 0}, {ends_[1], POLLIN, 0}};
    (void)::poll(ready, 2, wait_ms);
    take(ends_[0], ends_[1]);
    take(ends_[1], ends_[0]);
    while (!waiting_.empty() && waiting_.top().due <= Clock::now()) {
      // What was under way when the cable was cut is lost as well.
      if (cut)
        ++lost_;
      else if (::write(waiting_.top().to, waiting_.top().bytes.data(), waiting_.top().bytes.size()) > 0)
        ++carried_;
      waiting_.pop();
    }
  }
}

bool is_udp(const std::uint8_t* frame, std::size_t bytes) { return bytes > 23 && frame[12] == 0x08 && frame[13] == 0x00 && frame[23] == 17; }

}  // namespace booth::tests
