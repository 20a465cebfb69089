// Runs the golden frames and hashes what comes out.
#include "daemon/pipeline/fit_signature.hpp"

#include <fmt/format.h>

#include <bit>
#include <stdexcept>

#include "daemon/config/config.hpp"
#include "daemon/drivers_factory.hpp"
#include "daemon/pipeline/fit_setup.hpp"
#include "daemon/pipeline/offline_run.hpp"

namespace booth::daemon {

void FitSignature::add_bytes(const void* data, std::size_t size) {
  static_assert(std::endian::native == std::endian::little, "the signature is over little-endian bytes");
  const auto* bytes = static_cast<const unsigned char*>(data);
  for (std::size_t i = 0; i < size; ++i) hash_ = (hash_ ^ bytes[i]) * 0x100000001b3u;
}

void FitSignature::add(const FrameRecord& frame) {
  ++frames_;
  add_bytes(&frame.person, sizeof frame.person);
  add_bytes(&frame.sex, sizeof frame.sex);
  if (frame.person == PersonState::lost) return;
  add_bytes(frame.q.data(), sizeof frame.q);
  add_bytes(frame.beta.data(), frame.shape_count * sizeof(double));
}

std::string FitSignature::text() const { return fmt::format("{:016x}", hash_); }

namespace {

std::string signature_of(const Config& config, int frames, const fit::DeviceOpen& open_device, bool on_device) {
  DepthSource source = open_synthetic_source(config, static_cast<double>(frames + 2) / 30);
  FitSetup setup = make_fit_setup(config, source.cameras, source.background, open_device);
  FitSignature signature;
  run_offline(source.cameras, static_cast<int>(source.cameras.size()), *setup.fitter, [&](const FitInput&, const FrameRecord& record) {
    if (const BackendStatus b = setup.fitter->backend(); on_device && !b.problem.empty()) throw std::runtime_error("signature: " + b.problem);
    signature.add(record);
    return signature.frames() < static_cast<std::uint64_t>(frames);
  });
  return signature.text();
}

}  // namespace

std::string golden_signature(int threads, int frames) {
  Config config;
  config.fit.threads = threads;
  return signature_of(config, frames, {}, false);
}

std::string golden_device_signature(int threads, int frames, const fit::DeviceOpen& open_device) {
  Config config;
  config.fit.threads = threads;
  config.fit.preset = "paper";
  config.fit.backend = "cuda";
  config.fit.particles = 2000;  // the published budget, whatever a device's default
  return signature_of(config, frames, open_device, true);
}

}  // namespace booth::daemon
