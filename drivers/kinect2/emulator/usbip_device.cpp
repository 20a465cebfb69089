// Requests in, replies and packets out; the stream keeps to its packets in a second (8000 on a real bus) unless the host is slower.
#include "drivers/kinect2/emulator/usbip_device.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <optional>

#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

using namespace std::chrono_literals;
using usb::Status;

/// A device that was held up makes up for so much; beyond that it is slower for good.
constexpr auto kCatchUp = 20ms;
/// Control and command requests with data out are short.
constexpr std::uint32_t kMostDataOut = 64u << 10;
/// While replies are awaited, the model is asked again so often: some of its faults answer late.
constexpr int kReplyPatience = 10;

std::int32_t code_of(Status status) {
  switch (status) {
    case Status::completed:
      return 0;
    case Status::stalled:
      return -EPIPE;
    case Status::overflow:
      return -EOVERFLOW;
    default:
      return -EPROTO;
  }
}

}  // namespace

UsbipDevice::UsbipDevice(std::shared_ptr<DeviceModel> model, Identity identity, std::uint32_t device_id, int socket, std::shared_ptr<hal::Clock> clock,
                         hal::Nanoseconds packet_time)
    : model_(std::move(model)), clock_(std::move(clock)), packet_time_(packet_time), id_(device_id), socket_(socket), control_(*model_, std::move(identity)) {
  requests_thread_ = std::thread([this] { answer_requests(); });
  stream_thread_ = std::thread([this] { stream(); });
}

UsbipDevice::~UsbipDevice() {
  leave();
  requests_thread_.join();
  stream_thread_.join();
  close(socket_);
}

void UsbipDevice::leave() {
  (void)shutdown(socket_, SHUT_RDWR);
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  transfers_.notify_all();
}

std::string UsbipDevice::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

bool UsbipDevice::receive(std::span<std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = recv(socket_, bytes.data(), bytes.size(), 0);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

/// With mutex_ held. What cannot be sent ends the connection, which the requests' thread notices.
void UsbipDevice::send(std::span<const std::byte> header, std::span<const std::byte> payload, std::span<const std::byte> tail) {
  std::array<iovec, 3> parts{};
  std::size_t first = 0;
  for (std::size_t i = 0; const auto& part : {header, payload, tail}) parts[i++] = {const_cast<std::byte*>(part.data()), part.size()};
  while (first < parts.size()) {
    msghdr message{};
    message.msg_iov = &parts[first];
    message.msg_iovlen = parts.size() - first;
    const ssize_t n = sendmsg(socket_, &message, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return (void)shutdown(socket_, SHUT_RDWR);
    auto left = static_cast<std::size_t>(n);
    while (first < parts.size() && left >= parts[first].iov_len) left -= parts[first++].iov_len;
    if (first == parts.size()) break;
    parts[first].iov_base = static_cast<std::byte*>(parts[first].iov_base) + left;
    parts[first].iov_len -= left;
  }
}

void UsbipDevice::answer_requests() {
  std::array<std::byte, usbip::kHeaderBytes> header{};
  try {
    while (!ended_) {
      pollfd wait{.fd = socket_, .events = POLLIN, .revents = 0};
      bool replies_awaited = false;
      {
        const std::lock_guard lock(mutex_);
        replies_awaited = !replies_.empty();
      }
      const int ready = poll(&wait, 1, replies_awaited ? kReplyPatience : -1);
      if (ready > 0) {
        if (!receive(header)) break;
        std::visit([this](const auto& request) { handle(request); }, usbip::parse_request(header, id_));
      }
      pump_replies();
    }
  } catch (const usbip::ProtocolError& e) {
    const std::lock_guard lock(mutex_);
    error_ = e.what();
  }
  leave();
}

/// Whether the plug is pulled at this request.
bool UsbipDevice::leaves_now() {
  if (!model_->faults().take(Fault::unplug_on_request)) return false;
  leave();
  return true;
}

void UsbipDevice::handle(const usbip::Submit& request) {
  std::vector<std::byte> data, descriptors;
  if (!request.in && request.length > 0) {
    if (request.length > kMostDataOut)
      throw usbip::ProtocolError("USB/IP: " + std::to_string(request.length) + " bytes are sent to a device that takes no such thing");
    data.resize(request.length);
    if (!receive(data)) return leave();
  }
  descriptors.resize(request.packets * usbip::kIsochronousBytes);
  if (!receive(descriptors)) return leave();
  auto packets = usbip::parse_packets(descriptors, request);
  if (request.endpoint == 0) return control(request, data);
  if (request.endpoint == kCommandOut && !request.in) return command(request, data);
  const auto address = static_cast<std::uint8_t>(request.endpoint | (request.in ? 0x80 : 0));
  const std::lock_guard lock(mutex_);
  if (address == kInfraredIn && !packets.empty()) {
    infrared_.push_back({request, std::move(packets)});
    transfers_.notify_all();
  } else if (address == kReplyIn) {
    replies_.push_back({request, {}});
  } else if (address == kColourIn) {
    colour_.push_back({request, {}});
  } else if (address == 0x82) {
    other_.push_back({request, {}});  // its purpose is unknown, and it never says anything
  } else {
    send(usbip::submit_reply(request, -EPIPE, 0));
  }
}

void UsbipDevice::handle(const usbip::Unlink& request) {
  const std::lock_guard lock(mutex_);
  bool found = false;
  for (auto* queue : {&infrared_, &colour_, &replies_, &other_})
    found = std::erase_if(*queue, [&](const Waiting& w) { return w.request.sequence == request.victim; }) > 0 || found;
  // Zero: its own answer is already on the way.
  send(usbip::unlink_reply(request, found ? -ECONNRESET : 0));
}

void UsbipDevice::control(const usbip::Submit& request, std::span<const std::byte> data) {
  const Setup setup = parse_setup(request.setup);
  if (setup.in() != request.in && setup.length > 0) throw usbip::ProtocolError("USB/IP: the direction of a control request contradicts itself");
  if (!ControlEndpoint::only_looks(setup) && leaves_now()) return;
  const auto answer = control_.handle(setup, data);
  {
    const std::lock_guard lock(mutex_);
    if (!model_->streams_infrared()) transfers_.notify_all();
    if (!answer) return send(usbip::submit_reply(request, -EPIPE, 0));
    const std::size_t size = request.in ? std::min<std::size_t>(answer->size(), request.length) : 0;
    send(usbip::submit_reply(request, 0, static_cast<std::uint32_t>(request.in ? size : data.size())), std::span(*answer).first(size));
  }
}

void UsbipDevice::command(const usbip::Submit& request, std::span<const std::byte> data) {
  model_->note("command");
  if (leaves_now()) return;
  model_->command(data);
  {
    const std::lock_guard lock(mutex_);
    send(usbip::submit_reply(request, 0, request.length));
  }
  if (!model_->wants_reboot()) return;
  rebooting_ = true;
  leave();
}

/// A reply ends with a packet that is not full, or where the host's buffer ends; what does not fit into less than whole packets babbles.
void UsbipDevice::pump_replies() {
  const std::lock_guard lock(mutex_);
  while (!replies_.empty()) {
    if (reply_at_ == reply_.size()) {
      reply_at_ = 0;
      reply_.clear();
      if (!model_->take_reply(reply_)) return;
    }
    const usbip::Submit request = replies_.front().request;
    replies_.pop_front();
    const std::size_t left = reply_.size() - reply_at_;
    if (left > request.length && request.length % 1024 != 0) {
      reply_at_ = reply_.size();
      send(usbip::submit_reply(request, -EOVERFLOW, 0));
      continue;
    }
    const std::size_t size = std::min<std::size_t>(left, request.length);
    send(usbip::submit_reply(request, 0, static_cast<std::uint32_t>(size)), std::span(reply_).subspan(reply_at_, size));
    reply_at_ += size;
  }
}

void UsbipDevice::stream() {
  std::optional<InfraredSource> source;
  slot_ = clock_->now();
  auto next_frame = slot_;
  while (!ended_) {
    if (!wait_for_transfer()) continue;
    if (!model_->streams_infrared()) {
      source.reset();
      (void)put(Status::completed, {});
      continue;
    }
    if (!source) {
      source.emplace(*model_);
      next_frame = slot_;
    }
    if (slot_ < next_frame) {
      (void)put(Status::completed, {});
      continue;
    }
    source->send_frame(slot_, [this](Status status, std::span<const std::byte> data) { return put(status, data) && model_->streams_infrared(); });
    next_frame = std::max(next_frame + model_->frame_period(), slot_);
  }
}

/// Until there is one to fill; false now and then without one, so that nobody waits for good.
bool UsbipDevice::wait_for_transfer() {
  if (filled_ < packets_.size()) return !ended_;
  std::unique_lock lock(mutex_);
  if (!transfers_.wait_for(lock, 100ms, [this] { return ended_ || !infrared_.empty(); }) || ended_) return false;
  packets_ = infrared_.front().packets;
  lock.unlock();
  begin_transfer();
  return true;
}

void UsbipDevice::begin_transfer() {
  filled_ = 0;
  payload_.clear();
  tail_.clear();
  slot_ = std::max(slot_, clock_->now() - kCatchUp);
}

/// False when nobody reads the stream any more.
bool UsbipDevice::put(Status status, std::span<const std::byte> data) {
  while (!wait_for_transfer())
    if (ended_ || !model_->streams_infrared()) return false;
  usbip::Packet& packet = packets_[filled_];
  packet.status = code_of(status);
  if (data.size() > packet.length) {
    packet.status = -EOVERFLOW;
    data = data.first(packet.length);
  }
  if (packet.status == 0) {
    packet.actual = static_cast<std::uint32_t>(data.size());
    payload_.insert(payload_.end(), data.begin(), data.end());
    packets_sent_ += !data.empty();
  }
  slot_ += packet_time_;
  if (++filled_ == packets_.size()) end_transfer();
  return !ended_;
}

void UsbipDevice::end_transfer() {
  for (auto now = clock_->now(); now < slot_ && !ended_; now = clock_->now()) std::this_thread::sleep_for(std::min<hal::Nanoseconds>(slot_ - now, 50ms));
  std::uint32_t broken = 0;
  for (const auto& packet : packets_) {
    usbip::append(tail_, packet);
    broken += packet.status != 0;
  }
  const std::lock_guard lock(mutex_);
  // It may have been cancelled meanwhile; then what was sent is lost, as on the real bus.
  const bool same = !infrared_.empty() && infrared_.front().packets.size() == packets_.size();
  packets_.clear();
  filled_ = 0;
  if (!same) return;
  send(usbip::submit_reply(infrared_.front().request, 0, static_cast<std::uint32_t>(payload_.size()), broken), payload_, tail_);
  infrared_.pop_front();
}

}  // namespace booth::drivers::kinect2::emulator
