// CUDA: kernels launched from recorded graphs, memory taken once, every error turned into one of ours. For .cu files only, one for each set of kernels.
#pragma once

#include <cuda_runtime.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "fit/gpu/device.hpp"
#include "fit/gpu/launch.hpp"
#include "fit/gpu/reset_gate.hpp"

namespace booth::gpu {

/// A frame takes about one millisecond; who takes so long hangs. Checkers slow a device down a thousandfold: they set BOOTHD_GPU_PATIENCE_MS.
inline std::chrono::milliseconds patience() {
  const char* given = std::getenv("BOOTHD_GPU_PATIENCE_MS");
  return std::chrono::milliseconds(given ? std::max(1L, std::strtol(given, nullptr, 10)) : 250);
}
/// Of every device of this process, whatever its kernels.
inline ResetGate& reset_gate() {
  static ResetGate gate;
  return gate;
}

template <class K, int kPhase>
__device__ __forceinline__ void run_phase(const K& kernel, const Lane& lane, int round, typename K::Shared& shared, typename K::Private& own) {
  if (kernel.template runs<kPhase>(round)) {
    kernel.template phase<kPhase>(lane, round, shared, own);
    if constexpr (K::kPhases > 1) __syncthreads();
  }
  if constexpr (kPhase + 1 < K::kPhases) run_phase<K, kPhase + 1>(kernel, lane, round, shared, own);
}

template <class K>
__global__ void __launch_bounds__(K::kThreads, 1) run_kernel(const __grid_constant__ K kernel) {
  extern __shared__ __align__(16) unsigned char memory[];
  typename K::Shared& shared = *reinterpret_cast<typename K::Shared*>(memory);
  typename K::Private own;
  const Lane lane{static_cast<int>(blockIdx.x), static_cast<int>(gridDim.x), static_cast<int>(threadIdx.x)};
  const int rounds = kernel.rounds(lane);
  for (int round = 0; round < rounds; ++round) run_phase<K, 0>(kernel, lane, round, shared, own);
}

template <class K>
constexpr std::size_t shared_bytes() {
  return std::is_empty_v<typename K::Shared> ? 0 : sizeof(typename K::Shared);
}

template <class Kernels>
class CudaDevice final : public Device<Kernels> {
 public:
  explicit CudaDevice(Waiting waiting) : waiting_(waiting) {}
  ~CudaDevice() override {
    if (lost_) {  // nothing of it can be freed one by one any more
      reset_gate().lose(generation_);
      return;
    }
    const ResetGate::Hold hold(reset_gate(), generation_);
    if (!hold) return;  // a reset has freed everything
    for (const Program& p : programs_) {
      cudaGraphExecDestroy(p.whole);
      for (const cudaGraphExec_t g : p.steps) cudaGraphExecDestroy(g);
    }
    for (void* p : memory_) cudaFree(p);
    for (void* p : pinned_) cudaFreeHost(p);
    if (begin_) cudaEventDestroy(begin_);
    if (end_) cudaEventDestroy(end_);
    if (stream_) cudaStreamDestroy(stream_);
  }

  DeviceError open() {
    generation_ = reset_gate().open([] { cudaDeviceReset(); });
    const ResetGate::Hold hold(reset_gate(), generation_);
    if (!hold) return DeviceError::lost;
    int count = 0;
    if (const DeviceError e = check(cudaGetDeviceCount(&count), DeviceError::absent); e != DeviceError::none) return e;
    if (count == 0) return DeviceError::absent;
    cudaDeviceProp properties{};
    if (const DeviceError e = check(cudaGetDeviceProperties(&properties, 0), DeviceError::absent); e != DeviceError::none) return e;
    name_ = std::string("cuda ") + properties.name;
    processors_ = properties.multiProcessorCount;
    for (const cudaError_t e : {cudaSetDevice(0), cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), cudaEventCreate(&begin_), cudaEventCreate(&end_)})
      if (e != cudaSuccess) return check(e, DeviceError::absent);
    return DeviceError::none;
  }

  const std::string& name() const override { return name_; }
  int processors() const override { return processors_; }
  const std::string& problem() const override { return problem_; }
  ResetGate::Hold hold() override { return {reset_gate(), generation_}; }

  DeviceError allocate(std::size_t bytes, void*& out) override {
    if (const DeviceError e = check(cudaMalloc(&out, bytes), DeviceError::out_of_memory); e != DeviceError::none) return e;
    memory_.push_back(out);
    return check(cudaMemset(out, 0, bytes), DeviceError::lost);
  }
  DeviceError allocate_pinned(std::size_t bytes, void*& host, void*& device) override {
    if (const DeviceError e = check(cudaHostAlloc(&host, bytes, cudaHostAllocMapped), DeviceError::out_of_memory); e != DeviceError::none) return e;
    pinned_.push_back(host);
    return check(cudaHostGetDevicePointer(&device, host, 0), DeviceError::lost);
  }
  DeviceError upload(void* to, const void* from, std::size_t bytes) override {
    return check(cudaMemcpy(to, from, bytes, cudaMemcpyHostToDevice), DeviceError::lost);
  }

  DeviceError record(std::span<const Step<Kernels>> steps, int& program) override {
    program = static_cast<int>(programs_.size());
    Program p;
    if (const DeviceError e = capture(steps, p.whole); e != DeviceError::none) return e;
    for (const Step<Kernels>& step : steps) {
      cudaGraphExec_t one = nullptr;
      if (const DeviceError e = capture({&step, 1}, one); e != DeviceError::none) return e;
      p.steps.push_back(one);
    }
    programs_.push_back(std::move(p));
    // Once for nothing, so that the first frame finds everything loaded.
    return check(cudaGraphUpload(programs_.back().whole, stream_), DeviceError::lost) == DeviceError::none ? check(cudaStreamSynchronize(stream_), DeviceError::lost)
                                                                                                          : DeviceError::lost;
  }

  DeviceError run(int program) override {
    if (const DeviceError e = check(cudaGraphLaunch(programs_[static_cast<std::size_t>(program)].whole, stream_), DeviceError::lost); e != DeviceError::none) return e;
    // Asked rather than waited for: a device that hangs must not hang the booth.
    const auto deadline = std::chrono::steady_clock::now() + patience_;
    for (int turn = 0;; ++turn) {
      const cudaError_t e = cudaStreamQuery(stream_);
      if (e == cudaSuccess) return DeviceError::none;
      if (e != cudaErrorNotReady) return check(e, DeviceError::lost);
      if (waiting_ == Waiting::napping)
        std::this_thread::sleep_for(std::chrono::microseconds(50));
      else if (turn % 16 != 15)
        continue;
      if (std::chrono::steady_clock::now() > deadline) {
        lost_ = true;
        problem_ = "no answer within " + std::to_string(patience_.count()) + " ms";
        return DeviceError::late;
      }
      if (waiting_ == Waiting::busily && turn > 20000) std::this_thread::yield();
    }
  }

  DeviceError time(int program, int step, int repeats, double& milliseconds) override {
    const Program& p = programs_[static_cast<std::size_t>(program)];
    if (step >= static_cast<int>(p.steps.size())) return DeviceError::absent;
    const cudaGraphExec_t graph = step < 0 ? p.whole : p.steps[static_cast<std::size_t>(step)];
    std::vector<float> times(static_cast<std::size_t>(std::max(1, repeats)));
    for (int turn = -3; turn < static_cast<int>(times.size()); ++turn) {  // three turns to warm up
      // A step finds what the steps before it leave, as in a frame.
      for (int before = 0; before < step; ++before)
        if (const DeviceError e = check(cudaGraphLaunch(p.steps[static_cast<std::size_t>(before)], stream_), DeviceError::lost); e != DeviceError::none) return e;
      float& t = times[static_cast<std::size_t>(std::max(turn, 0))];
      for (const cudaError_t e : {cudaEventRecord(begin_, stream_), cudaGraphLaunch(graph, stream_), cudaEventRecord(end_, stream_), cudaEventSynchronize(end_),
                                  cudaEventElapsedTime(&t, begin_, end_)})
        if (e != cudaSuccess) return check(e, DeviceError::lost);
    }
    std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
    milliseconds = static_cast<double>(times[times.size() / 2]);
    return DeviceError::none;
  }

 private:
  struct Program {
    cudaGraphExec_t whole = nullptr;
    std::vector<cudaGraphExec_t> steps;  ///< each by itself, for time()
  };

  DeviceError check(cudaError_t e, DeviceError otherwise) {
    if (e == cudaSuccess) return DeviceError::none;
    problem_ = std::string(cudaGetErrorName(e)) + ": " + cudaGetErrorString(e);
    cudaGetLastError();
    if (otherwise == DeviceError::lost) lost_ = true;
    return e == cudaErrorNoDevice || e == cudaErrorInsufficientDriver ? DeviceError::absent : otherwise;
  }

  template <class K>
  cudaError_t launch(const K& kernel, int blocks) {
    constexpr std::size_t kBytes = shared_bytes<K>();
    if (kBytes > 48 * 1024)
      if (const cudaError_t e = cudaFuncSetAttribute(run_kernel<K>, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(kBytes)); e != cudaSuccess) return e;
    run_kernel<K><<<blocks, K::kThreads, kBytes, stream_>>>(kernel);
    return cudaGetLastError();
  }

  DeviceError capture(std::span<const Step<Kernels>> steps, cudaGraphExec_t& out) {
    if (const DeviceError e = check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), DeviceError::lost); e != DeviceError::none) return e;
    cudaError_t launched = cudaSuccess;
    for (const Step<Kernels>& step : steps)
      if (launched == cudaSuccess) launched = std::visit([&](const auto& kernel) { return launch(kernel, step.blocks); }, step.kernel);
    cudaGraph_t graph = nullptr;
    const cudaError_t ended = cudaStreamEndCapture(stream_, &graph);
    for (const cudaError_t e : {launched, ended})
      if (e != cudaSuccess) return check(e, DeviceError::lost);
    const cudaError_t made = cudaGraphInstantiate(&out, graph, 0);
    cudaGraphDestroy(graph);
    return check(made, DeviceError::out_of_memory);
  }

  std::string name_ = "cuda", problem_;
  const Waiting waiting_;
  std::uint64_t generation_ = 0;
  int processors_ = 1;
  bool lost_ = false;
  std::chrono::milliseconds patience_ = patience();
  cudaStream_t stream_ = nullptr;
  cudaEvent_t begin_ = nullptr, end_ = nullptr;
  std::vector<void*> memory_, pinned_;
  std::vector<Program> programs_;
};

/// The first CUDA device of this machine; null where there is none, `why` then says it in a sentence. Resets it first when an earlier one of this process was
/// lost, whoever that belonged to.
template <class Kernels>
std::unique_ptr<Device<Kernels>> open_cuda_device(Waiting waiting, std::string& why) {
  auto device = std::make_unique<CudaDevice<Kernels>>(waiting);
  if (const DeviceError e = device->open(); e != DeviceError::none) {
    why = std::string(to_string(e)) + (device->problem().empty() ? "" : ": " + device->problem());
    return nullptr;
  }
  return device;
}

}  // namespace booth::gpu
