// Host memory, recorded steps, and the faults that tests ask for.
#include "fit/swarm/device/emulated_device.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <tuple>

namespace booth::fit::device {
namespace {

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

class EmulatedDevice final : public Device {
 public:
  EmulatedDevice(Faults& faults, int processors) : faults_(faults), processors_(processors) { ++faults.starts; }

  const std::string& name() const override { return name_; }
  int processors() const override { return processors_; }
  const std::string& problem() const override { return problem_; }

  DeviceError allocate(std::size_t bytes, void*& out) override {
    if (faults_.at_start != DeviceError::none) return fail(faults_.at_start);
    if (faults_.allocations_left == 0) return fail(DeviceError::out_of_memory);
    if (faults_.allocations_left > 0) --faults_.allocations_left;
    memory_.push_back(std::make_unique<std::uint64_t[]>((bytes + 7) / 8));
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
  DeviceError record(std::span<const Step> steps, int& program) override {
    program = static_cast<int>(programs_.size());
    programs_.emplace_back(steps.begin(), steps.end());
    return DeviceError::none;
  }
  DeviceError run(int program) override {
    if (faults_.runs_left == 0) return fail(faults_.error);
    if (faults_.runs_left > 0) --faults_.runs_left;
    for (const Step& step : programs_[static_cast<std::size_t>(program)]) launch(step);
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
  DeviceError fail(DeviceError e) {
    problem_ = std::string("injected: ") + to_string(e);
    return e;
  }
  void launch(const Step& step) {
    std::visit(
        [&]<class K>(const K& kernel) {
          Block<K>& block = std::get<Block<K>>(blocks_.of);
          emulate(kernel, step.blocks, *block.shared, block.own.data(), faults_.order);
        },
        step.kernel);
  }

  Faults& faults_;
  int processors_;
  std::string name_ = "emulated", problem_;
  std::vector<std::unique_ptr<std::uint64_t[]>> memory_;
  std::vector<std::vector<Step>> programs_;
  Blocks<Kernel> blocks_;
};

}  // namespace

std::unique_ptr<Device> make_emulated_device(Faults& faults, int processors) { return std::make_unique<EmulatedDevice>(faults, processors); }

}  // namespace booth::fit::device
