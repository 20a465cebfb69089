// What each rung of the ladder does, and which trouble an exception stands for.
#include "drivers/kinect2/device_keeper.hpp"

#include <algorithm>
#include <thread>
#include <utility>

namespace booth::drivers::kinect2 {

using namespace std::chrono_literals;

namespace {

constexpr std::uint64_t kFramesThatCount = 1000;  ///< more than the ladder needs to forget a trouble

bool means_gone(const usb::Error& e) { return e.fault() == usb::Fault::no_device || e.fault() == usb::Fault::not_found; }

}  // namespace

DeviceKeeper::DeviceKeeper(KinectShared shared, const KinectSettings& settings)
    : shared_(std::move(shared)), settings_(settings), reset_next_(settings.reset_on_open) {}

Calibration DeviceKeeper::learn_calibration() {
  std::string why;
  for (const bool reset : {false, true}) {
    try {
      if (reset) wait_for_gate();
      return KinectDevice(*shared_.bus, settings_.serial, options(reset), cancel_).calibration(shared_.cache.get());
    } catch (const usb::Error& e) {
      why = e.what();
      // Only a device that is there and does not answer may do better after a reset.
      if (means_gone(e) || e.fault() == usb::Fault::unsupported || e.fault() == usb::Fault::access || e.fault() == usb::Fault::busy) break;
    } catch (const std::exception& e) {
      why = e.what();
    }
  }
  if (shared_.cache)
    if (auto known = shared_.cache->load_latest(settings_.serial)) {
      note(shared_.notes, Gravity::warning, why + "; what it said of its lens on an earlier day is used");
      return std::move(*known);
    }
  throw std::runtime_error(why + "; its calibration was never read, so boothd cannot start without it");
}

void DeviceKeeper::wait_for_gate() {
  while (!shared_.gate->enter(shared_.clock->now())) {
    if (cancel_) throw Cancelled(name() + ": stopped while it waited to reset");
    std::this_thread::sleep_for(20ms);
  }
}

bool DeviceKeeper::awaited() const { return back_by_ && !device_ && shared_.clock->now() < *back_by_; }

Trouble DeviceKeeper::missing() {
  const auto now = shared_.clock->now();
  if (!missing_since_) missing_since_ = now;
  return now - *missing_since_ > settings_.patience.absence ? Trouble::absent : Trouble::vanished;
}

void DeviceKeeper::reboot() {
  try {
    if (!device_) device_ = std::make_unique<KinectDevice>(*shared_.bus, settings_.serial, options(false), cancel_);
    device_->reboot();
  } catch (const Cancelled&) {
    throw;
  } catch (const std::exception&) {
    // It may leave before it answers, or not hear at all; either way the next rung decides.
  }
  device_.reset();
  reset_next_ = false;
  back_by_ = shared_.clock->now() + settings_.patience.absence;
  throw Setback(Trouble::stalled, name() + " was told to reboot; it will be back in a few seconds");
}

bool DeviceKeeper::use_tool(Rung rung) {
  const auto& tool = rung == Rung::reset_port ? shared_.power.reset_port : shared_.power.rebind_controller;
  device_.reset();
  if (path_.empty() || !tool) return false;  // not permitted here
  wait_for_gate();
  if (!tool(path_)) return false;
  note(shared_.notes, Gravity::warning, name() + " does not come back by itself: the way out was to " + std::string(to_string(rung)) + " (" + path_ + ")");
  reset_next_ = false;
  back_by_ = shared_.clock->now() + settings_.patience.absence;
  return true;
}

void DeviceKeeper::climb(Trouble trouble) {
  for (Rung rung = ladder_.after(trouble);; rung = ladder_.after(trouble)) {
    switch (rung) {
      case Rung::restart_stream:
        return;
      case Rung::reopen:
      case Rung::ask_for_help:
        device_.reset();
        reset_next_ = settings_.reset_on_open;
        return;
      case Rung::reboot:
        return reboot();
      case Rung::reset_port:
      case Rung::rebind_controller:
        if (use_tool(rung)) return;
        break;  // the next rung
    }
  }
}

void DeviceKeeper::open() {
  path_ = find_kinect(*shared_.bus, settings_.serial).path;
  const bool reset = std::exchange(reset_next_, false);
  if (reset) wait_for_gate();
  device_ = std::make_unique<KinectDevice>(*shared_.bus, settings_.serial, options(reset), cancel_);
  back_by_.reset();
  missing_since_.reset();
}

std::string DeviceKeeper::patient(const std::string& sentence) const {
  return sentence + (ladder_.tried() > 5 ? "; it has not answered for long: unplug it from USB and mains for ten seconds" : "");
}

void DeviceKeeper::start(std::optional<Trouble> trouble, std::uint64_t good_frames, usb::StreamSink& infrared, usb::StreamSink* colour) {
  cancel_ = false;
  for (std::uint64_t i = std::min(good_frames, kFramesThatCount); i > 0; --i) ladder_.delivered();
  try {
    if (trouble && !awaited()) climb(*trouble);
    if (!device_) open();
    device_->start(settings_.transfers, infrared, colour);
  } catch (const Cancelled& e) {
    throw Setback(trouble, e.what());
  } catch (const NotReady& e) {
    throw Setback(Trouble::not_ready, patient(e.what()));
  } catch (const usb::Error& e) {
    device_.reset();
    const Trouble next = means_gone(e) ? missing() : Trouble::failed;
    throw Setback(next, next == Trouble::vanished ? e.what() : patient(e.what()));
  } catch (const CommandError& e) {
    const bool gone = e.kind() == CommandError::Kind::gone;
    if (gone) device_.reset();
    throw Setback(gone ? missing() : Trouble::failed, gone ? e.what() : patient(e.what()));
  }
}

void DeviceKeeper::stop() noexcept {
  if (!device_ || device_->stop()) return;
  device_.reset();
  reset_next_ = settings_.reset_on_open;
}

}  // namespace booth::drivers::kinect2
