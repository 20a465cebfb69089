// A device that is the host: kernels run block by block, so that tests and machines without a graphics processor execute every line of them.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <memory>
#include <tuple>
#include <vector>

#include "fit/gpu/device.hpp"
#include "fit/gpu/launch.hpp"

namespace booth::gpu {

/// What goes wrong, and when; tests change it while the device works, from any thread.
struct Faults {
  std::atomic<DeviceError> at_start{DeviceError::none};  ///< of the first allocation
  std::atomic<int> allocations_left{-1};                 ///< then out of memory; -1: never
  std::atomic<int> runs_left{-1};                        ///< then `error`, for ever; -1: never
  std::atomic<DeviceError> error{DeviceError::lost};
  std::atomic<int> starts{0};  ///< devices made with these faults
  ResetGate gate;              ///< of the devices made with these faults, as if they were one
  Order order = Order::forwards;
};

namespace detail {

/// One kernel's block memory, taken once.
template <class K>
struct Block {
  std::unique_ptr<typename K::Shared> shared = std::make_unique<typename K::Shared>();
  std::vector<typename K::Private> own = std::vector<typename K::Private>(static_cast<std::size_t>(K::kThreads));
};
template <class>
struct Blocks;
template <class... K>
struct Blocks<std::variant<K...>> {
  std::tuple<Block<K>...> of;
};

}  // namespace detail

/// Instantiated once for each set of kernels, in a .cpp file of its user.
template <class Kernels>
class EmulatedDevice final : public Device<Kernels> {
 public:
  /// `faults` outlives the device.
  EmulatedDevice(Faults& faults, int processors) : faults_(faults), processors_(processors), generation_(faults.gate.open([] {})) { ++faults.starts; }
  ~EmulatedDevice() override {
    if (lost_) faults_.gate.lose(generation_);
  }

  const std::string& name() const override { return name_; }
  int processors() const override { return processors_; }
  const std::string& problem() const override { return problem_; }
  ResetGate::Hold hold() override { return {faults_.gate, generation_}; }

  DeviceError allocate(std::size_t bytes, void*& out) override {
    if (faults_.at_start != DeviceError::none) return fail(faults_.at_start);
    if (faults_.allocations_left == 0) return fail(DeviceError::out_of_memory);
    if (faults_.allocations_left > 0) --faults_.allocations_left;
    memory_.push_back(std::make_unique<Unit[]>((bytes + sizeof(Unit) - 1) / sizeof(Unit)));
    out = memory_.back().get();
    return DeviceError::none;
  }
  DeviceError allocate_pinned(std::size_t bytes, void*& host, void*& device) override {
    const DeviceError e = allocate(bytes, host);
    device = host;
    return e;
  }
  DeviceError upload(void* to, const void* from, std::size_t bytes) override {
    std::memcpy(to, from, bytes);
    return DeviceError::none;
  }
  DeviceError record(std::span<const Step<Kernels>> steps, int& program) override {
    program = static_cast<int>(programs_.size());
    programs_.emplace_back(steps.begin(), steps.end());
    return DeviceError::none;
  }
  DeviceError run(int program) override {
    if (faults_.runs_left == 0) {
      lost_ = true;
      return fail(faults_.error);
    }
    if (faults_.runs_left > 0) --faults_.runs_left;
    for (const Step<Kernels>& step : programs_[static_cast<std::size_t>(program)]) launch(step);
    return DeviceError::none;
  }
  DeviceError time(int program, int step, int repeats, double& milliseconds) override {
    std::vector<double> times;
    for (int r = 0; r < std::max(1, repeats); ++r) {
      const auto& steps = programs_[static_cast<std::size_t>(program)];
      for (int i = 0; i < step; ++i) launch(steps[static_cast<std::size_t>(i)]);
      const auto begin = std::chrono::steady_clock::now();
      for (std::size_t i = 0; i < steps.size(); ++i)
        if (step < 0 || static_cast<int>(i) == step) launch(steps[i]);
      times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
    }
    std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
    milliseconds = times[times.size() / 2];
    return DeviceError::none;
  }

 private:
  struct alignas(16) Unit {
    unsigned char byte[16];
  };

  DeviceError fail(DeviceError e) {
    problem_ = std::string("injected: ") + to_string(e);
    return e;
  }
  void launch(const Step<Kernels>& step) {
    std::visit(
        [&]<class K>(const K& kernel) {
          detail::Block<K>& block = std::get<detail::Block<K>>(blocks_.of);
          emulate(kernel, step.blocks, *block.shared, block.own.data(), faults_.order);
        },
        step.kernel);
  }

  Faults& faults_;
  int processors_;
  std::uint64_t generation_;
  bool lost_ = false;
  std::string name_ = "emulated", problem_;
  std::vector<std::unique_ptr<Unit[]>> memory_;
  std::vector<std::vector<Step<Kernels>>> programs_;
  detail::Blocks<typename Kernels::Any> blocks_;
};

}  // namespace booth::gpu
