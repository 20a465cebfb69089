// Event threads: how they start, how they end, and what happens when the last owner is the thread itself.
#include "drivers/usb/libusb_context.hpp"

#include <pthread.h>
#include <sched.h>

#include <cerrno>
#include <chrono>
#include <mutex>

#include "drivers/usb/libusb_errors.hpp"

namespace booth::drivers::usb {
namespace {

using namespace std::chrono_literals;

struct LogState {
  std::mutex mutex;
  std::function<void(bool, const std::string&)> sink;
  std::chrono::steady_clock::time_point next{};
  std::uint64_t held_back = 0;
};

/// Never destroyed: a thread of libusb may still speak while the process ends.
LogState& log_state() {
  static auto* const state = new LogState;
  return *state;
}

void LIBUSB_CALL on_log(libusb_context*, libusb_log_level level, const char* text) {
  const int kept = errno;  // our callers read errno after libusb has logged
  if (level == LIBUSB_LOG_LEVEL_ERROR || level == LIBUSB_LOG_LEVEL_WARNING) {
    auto& state = log_state();
    const std::lock_guard lock(state.mutex);
    const auto now = std::chrono::steady_clock::now();
    if (!state.sink || now < state.next) {
      ++state.held_back;
    } else {
      std::string line(text == nullptr ? "" : text);
      while (!line.empty() && (line.back() == '\n' || line.back() == '\r')) line.pop_back();
      if (state.held_back > 0) line += " (and " + std::to_string(state.held_back) + " more)";
      state.held_back = 0;
      state.next = now + 1s;
      state.sink(level == LIBUSB_LOG_LEVEL_ERROR, line);
    }
  }
  errno = kept;
}

void prefer_this_thread(const std::string& name) {
  (void)::pthread_setname_np(::pthread_self(), name.substr(0, 15).c_str());
  // Low among the real-time ones: before all ordinary work, behind what the kernel does for its interrupts. Not permitted is no trouble.
  sched_param parameter{};
  parameter.sched_priority = 10;
  (void)::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameter);
}

}  // namespace

void set_libusb_log(std::function<void(bool, const std::string&)> sink) {
  auto& state = log_state();
  const std::lock_guard lock(state.mutex);
  state.sink = std::move(sink);
  state.held_back = 0;
}

Context::Context() {
  static std::once_flag routed;
  // The global call-back replaces stderr; one of a context would only be told as well. Before the first context, whose making LIBUSB_DEBUG can make talkative.
  std::call_once(routed, [] { libusb_set_log_cb(nullptr, on_log, LIBUSB_LOG_CB_GLOBAL); });
  if (const int code = libusb_init(&context_); code != LIBUSB_SUCCESS)
    fail(code, 0, "libusb cannot be initialised (is there /dev/bus/usb, and may this user read it?)");
  (void)libusb_set_option(context_, LIBUSB_OPTION_LOG_LEVEL, LIBUSB_LOG_LEVEL_WARNING);
}

Context::~Context() {
  if (thread_.get_id() == std::this_thread::get_id()) {
    // The last owner was a transfer that called back after everyone had given it up: the thread ends the context itself, once it is out of libusb.
    life_->orphan = true;
    life_->stop = true;
    thread_.detach();
    return;
  }
  life_->stop = true;
  if (thread_.joinable()) {
    libusb_interrupt_event_handler(context_);
    thread_.join();
  }
  libusb_exit(context_);
}

void Context::handle_events(const std::string& name) {
  thread_ = std::thread([context = context_, life = life_, name] {
    prefer_this_thread(name);
    while (!life->stop) {
      timeval tv{.tv_sec = 0, .tv_usec = 100'000};
      const int code = libusb_handle_events_timeout_completed(context, &tv, nullptr);
      // An error that stays must not become a busy loop at real-time priority.
      if (code != LIBUSB_SUCCESS && code != LIBUSB_ERROR_INTERRUPTED) std::this_thread::sleep_for(10ms);
    }
    if (life->orphan) libusb_exit(context);
  });
}

}  // namespace booth::drivers::usb
