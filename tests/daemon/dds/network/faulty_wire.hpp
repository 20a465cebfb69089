// A cable between two interfaces that loses, delays and reorders frames, or is cut: what tc netem does, without needing it in the kernel.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <queue>
#include <random>
#include <thread>
#include <vector>

namespace booth::tests {

/// Runs a thread from construction to destruction; owns both descriptors.
class FaultyWire {
 public:
  FaultyWire(int one, int other);
  ~FaultyWire();
  FaultyWire(const FaultyWire&) = delete;

  // Faults, to be changed at any time; each frame meets those of its moment, in both directions.
  std::atomic<double> loss{0};     ///< fraction of frames that vanish
  std::atomic<double> reorder{0};  ///< fraction of frames that are overtaken: they come 5 to 25 ms later than the rest
  std::atomic<int> delay_ms{0};
  std::atomic<bool> cut{false};

  std::uint64_t carried() const { return carried_; }
  std::uint64_t lost() const { return lost_; }
  std::uint64_t late() const { return late_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Frame {
    Clock::time_point due;
    std::uint64_t number;
    int to;
    std::vector<std::uint8_t> bytes;
    bool operator<(const Frame& other) const { return due != other.due ? due > other.due : number > other.number; }
  };
  void run();
  void take(int from, int to);

  int ends_[2];
  std::priority_queue<Frame> waiting_;
  std::mt19937 random_{1};
  std::uint64_t number_ = 0;
  std::atomic<std::uint64_t> carried_{0}, lost_{0}, late_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// True for an Ethernet frame that carries UDP over IPv4, as all of DDS does.
bool is_udp(const std::uint8_t* frame, std::size_t bytes);

}  // namespace booth::tests
