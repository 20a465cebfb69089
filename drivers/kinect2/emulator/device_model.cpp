// Answers and streams, as the protocol has them.
#include "drivers/kinect2/emulator/device_model.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "drivers/kinect2/bytes.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

using usb::Status;
using Bytes = std::vector<std::byte>;

constexpr std::size_t kPhaseTrailerBytes = 306;

Bytes completion(std::uint32_t transaction, std::uint32_t status) {
  Bytes out(kCompletionBytes);
  write_u32(out, 0, kCompletionMagic);
  write_u32(out, 4, transaction);
  write_u32(out, 8, status);
  return out;
}

std::uint32_t hostile_index(FaultPlan& faults, std::uint32_t index) {
  if (faults.take(Fault::footer_index_ten)) return 10;
  if (faults.take(Fault::footer_index_31)) return 31;
  if (faults.take(Fault::footer_index_32)) return 32;
  return faults.take(Fault::footer_index_huge) ? 0xFFFF'FFFFu : index;
}

}  // namespace

DeviceModel::DeviceModel(EmulatedDeviceSettings settings)
    : settings_(std::move(settings)),
      phase_(settings_.zero_phase_offsets ? zero_phase_offsets() : realistic_phase_offsets()),
      forward_(settings_.camera, phase_),
      depth_(kPixels),
      brightness_(kPixels) {
  if (!settings_.still) return;
  std::vector<std::byte> images(kFrameBytes);
  render({}, 0, images);
}

void DeviceModel::note(const std::string& line) {
  const std::lock_guard lock(mutex_);
  if (log_.size() < 100'000) log_.push_back(line);
}

std::vector<std::string> DeviceModel::log() const {
  const std::lock_guard lock(mutex_);
  return log_;
}

void DeviceModel::bus_reset() {
  const std::lock_guard lock(mutex_);
  replies_.clear();
  late_.clear();
  alternate_ = 0;
  infrared_ = colour_ = suspended_ = reboot_ = false;
}

void DeviceModel::control(const usb::ControlRequest& request) {
  constexpr std::uint8_t kInterface = 0x01, kSetFeature = 0x03;
  if (request.type == kInterface && request.request == kSetFeature && request.value == 0) suspended_ = (request.index & 0x0100) != 0;
}

bool DeviceModel::take_reply(Bytes& out) {
  const std::lock_guard lock(mutex_);
  if (replies_.empty()) return false;
  out = std::move(replies_.front());
  replies_.pop_front();
  return true;
}

Bytes DeviceModel::page(std::uint32_t number) {
  switch (static_cast<Page>(number)) {
    case Page::serial: {
      Bytes out(0x80);
      for (std::size_t i = 0; i < settings_.serial.size() && i < 63; ++i) write_u16(out, 2 * i, static_cast<std::uint8_t>(settings_.serial[i]));
      if (faults_.take(Fault::serial_without_terminator)) out.resize(2 * settings_.serial.size());
      if (faults_.take(Fault::serial_with_control_characters)) write_u16(out, 2, '\n');
      return out;
    }
    case Page::phase_offsets: {
      Bytes out(kPhaseTablesBytes + kPhaseTrailerBytes);
      const std::array<std::uint32_t, 8> header{32, 3, 2, 434'176, 2, 12, 286, 8};
      for (std::size_t i = 0; i < 8; ++i) write_u32(out, 4 * i, header[i]);
      std::size_t at = 32;
      constexpr std::array<std::uint16_t, 3> kMegahertz{80, 16, 120}, kMultiplier{82, 62, 100};
      for (std::size_t f = 0; f < 3; ++f) {
        write_u16(out, at, kMegahertz[f]);
        at += 2;
        for (const std::uint16_t v : phase_.p0[f]) write_u16(out, at, v), at += 2;
        write_u16(out, at, kMultiplier[f]);
        at += 2;
      }
      if (faults_.take(Fault::short_phase_tables)) out.resize(kPhaseTablesBytes - 1);
      return out;
    }
    case Page::depth_camera: {
      Bytes out(kDepthCameraBytes);
      const auto& c = settings_.camera;
      const std::array<double, 10> values{c.fx, c.fy, 0, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3};
      for (std::size_t i = 0; i < values.size(); ++i) write_f32(out, 4 * i, static_cast<float>(values[i]));
      if (faults_.take(Fault::nan_intrinsics)) write_f32(out, 0, std::numeric_limits<float>::quiet_NaN());
      if (faults_.take(Fault::zero_intrinsics)) write_f32(out, 0, 0.0f);
      if (faults_.take(Fault::huge_intrinsics)) write_f32(out, 4, 1e30f);
      return out;
    }
    case Page::colour_camera: {
      Bytes out(kColourCameraBytes);
      out[0] = std::byte{1};
      const double fc = 1081.37, b = 52, d0 = 863;
      std::array<float, 25> v{};
      v[0] = static_cast<float>(fc), v[1] = 959.5f, v[2] = 539.5f, v[3] = static_cast<float>(d0), v[4] = static_cast<float>(b);
      v[5 + 7] = static_cast<float>(0.2199 * fc / settings_.camera.fx);
      v[5 + 9] = static_cast<float>(0.002199 * fc * b / d0);
      v[15 + 8] = static_cast<float>(0.2199 * fc / settings_.camera.fy);
      for (std::size_t i = 0; i < v.size(); ++i) write_f32(out, 1 + 4 * i, v[i]);
      return out;
    }
  }
  return {};
}

Bytes DeviceModel::answer(std::uint32_t code, std::span<const std::uint32_t> parameters, std::uint32_t& status) {
  const std::uint32_t first = parameters.empty() ? 0 : parameters[0];
  switch (static_cast<Command>(code)) {
    case Command::versions: {
      Bytes out(512);
      for (std::size_t i = 0; i < 7; ++i) write_u32(out, 16 * i, 0x0002'0003), write_u32(out, 16 * i + 4, 3912);
      return out;
    }
    case Command::hardware_info: {
      Bytes out(92);
      write_u32(out, 0, 0x0012'0000);
      write_u32(out, 8, 1);
      return out;
    }
    case Command::read_page:
      return page(first);
    case Command::read_parameter: {
      Bytes out(4);
      write_u32(out, 0, faults_.take(Fault::never_ready) ? 0x2600 : infrared_ ? 0x2603 : 0x2601);
      return out;
    }
    case Command::start_infrared:
      infrared_ = true;
      return {};
    case Command::stop_infrared:
      infrared_ = false;
      return {};
    case Command::reboot:
      reboot_ = true;
      return {};
    case Command::colour_streaming:
      colour_ = first != 0;
      return {};
    case Command::light:
      return {};
    case Command::colour_setting: {
      // One setting each; what was set is what a read of the next number says.
      constexpr std::uint32_t kFirstGet = 2;
      Bytes out(16);
      write_u32(out, 0, 1);
      if (parameters.size() < 4) return out;
      const std::uint32_t setting = parameters[2];
      const bool get = setting >= kFirstGet && setting % 2 == 0 && setting <= 26 && colour_settings_.contains(setting - 1);
      if (!get) colour_settings_[setting % 128] = parameters[3];
      write_u32(out, 12, get ? colour_settings_[setting - 1] : parameters[3]);
      return out;
    }
  }
  status = 1;
  return {};
}

void DeviceModel::command(std::span<const std::byte> packet) {
  if (packet.size() < kRequestHeaderBytes || packet.size() > 512 || packet.size() % 4 != 0 || read_u32(packet, 0) != kRequestMagic) return;
  std::uint32_t transaction = read_u32(packet, 4);
  const std::uint32_t most = read_u32(packet, 8), code = read_u32(packet, 12);
  std::vector<std::uint32_t> parameters;
  for (std::size_t at = kRequestHeaderBytes; at < packet.size(); at += 4) parameters.push_back(read_u32(packet, at));
  last_transaction_ = transaction;
  if (faults_.take(Fault::command_timeout)) return;
  std::uint32_t status = faults_.take(Fault::refused) ? 7 : 0;
  Bytes data = answer(code, parameters, status);
  if (data.size() > most) data.resize(most);
  if (faults_.take(Fault::short_data) && data.size() > 3) data.resize(3);
  if (faults_.take(Fault::wrong_transaction)) transaction += 1000;
  if (!data.empty() && faults_.take(Fault::reply_is_completion)) data = completion(0x1234'5678, 0);
  const bool premature = faults_.take(Fault::premature_completion), late = faults_.take(Fault::late_completion);
  const std::lock_guard lock(mutex_);
  for (auto& held : late_) replies_.push_back(std::move(held));
  late_.clear();
  auto& queue = late ? late_ : replies_;
  if (!data.empty() && !premature) queue.push_back(std::move(data));
  queue.push_back(completion(transaction, status));
}

void DeviceModel::render(hal::MonotonicTime at, std::uint64_t frame, std::span<std::byte> images) {
  if (!loop_.empty()) {
    std::memcpy(images.data(), loop_[frame % loop_.size()].data(), kFrameBytes);
    return;
  }
  if (!still_.empty()) {
    std::copy(still_.begin(), still_.end(), images.begin());
    return;
  }
  settings_.view(at, depth_, brightness_);
  forward_.encode(depth_, brightness_, settings_.noise_counts, settings_.seed * 0x1000'0000 + frame, images);
  if (settings_.still) still_.assign(images.begin(), images.end());
}

void DeviceModel::prepare_loop(hal::MonotonicTime at) {
  if (!loop_.empty()) return;
  std::vector<Bytes> frames;
  for (int i = 0; i < settings_.loop_frames; ++i) render(at + i * frame_period(), static_cast<std::uint64_t>(i), frames.emplace_back(kFrameBytes));
  loop_ = std::move(frames);
}

void InfraredSource::send_frame(hal::MonotonicTime at, const std::function<bool(Status, std::span<const std::byte>)>& send) {
  expose(at);
  send_exposed(send);
}

void InfraredSource::expose(hal::MonotonicTime at) {
  exposed_ = at;
  model_.render(at, frame_++, images_);
}

void InfraredSource::send_exposed(const std::function<bool(Status, std::span<const std::byte>)>& send) {
  auto& faults = model_.faults();
  stalled_ = stalled_ || faults.take(Fault::stream_stalls);
  if (stalled_) return;
  if (faults.take(Fault::sequence_jump)) sequence_ += 1'000'000;
  if (faults.take(Fault::sequence_wraps)) sequence_ = 0xFFFF'FFFE;
  if (faults.take(Fault::time_jump)) time_offset_ += 3600 * kTicksPerSecond;
  const auto ticks = static_cast<std::uint32_t>(exposed_.time_since_epoch().count() / (1'000'000'000 / kTicksPerSecond));
  if (faults.take(Fault::time_wraps)) time_offset_ = 0u - ticks - kTicksPerSecond / 10;
  const bool repeat = faults.take(Fault::sequence_repeat);
  for (int i = 0; i < kImages; ++i) {
    if (i < 9 && faults.take(Fault::image_missing)) continue;
    if (!send_image(i, ticks + time_offset_, send)) return;
  }
  if (!repeat) ++sequence_;
}

bool InfraredSource::send_image(int index, std::uint32_t timestamp, const std::function<bool(Status, std::span<const std::byte>)>& send) {
  auto& faults = model_.faults();
  const std::span<std::byte> wire(wire_);
  std::memcpy(wire_.data(), images_.data() + static_cast<std::size_t>(index) * kImageBytes, kImageBytes);
  const auto footer = wire.subspan(kImageBytes);
  std::fill(footer.begin(), footer.end(), std::byte{0});
  write_u32(footer, 4, model_.last_transaction());
  write_u32(footer, 8, timestamp);
  write_u32(footer, 12, sequence_);
  write_u32(footer, 16, hostile_index(faults, static_cast<std::uint32_t>(index)));
  write_u32(footer, 20, static_cast<std::uint32_t>(faults.take(Fault::footer_length) ? kImageBytes - 1 : kImageBytes));
  for (std::size_t at = 0; at < kSubImageBytes; at += kPacketBytes) {
    auto packet = std::span<const std::byte>(wire_).subspan(at, std::min(kPacketBytes, kSubImageBytes - at));
    const bool last = at + kPacketBytes >= kSubImageBytes;
    if (faults.take(Fault::packet_lost) || (last && faults.take(Fault::last_packet_lost))) continue;
    if (faults.take(Fault::empty_packets))
      for (int i = 0; i < 3; ++i)
        if (!send(Status::completed, {})) return false;
    if (faults.take(Fault::packet_truncated)) packet = packet.first(packet.size() - 1000);
    if (!send(faults.take(Fault::packet_error) ? Status::error : Status::completed, packet)) return false;
  }
  for (int i = 0; i < 17; ++i)
    if (!send(Status::completed, {})) return false;
  return true;
}

}  // namespace booth::drivers::kinect2::emulator
