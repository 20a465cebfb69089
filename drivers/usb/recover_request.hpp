// How a process without rights asks one with them for a step on USB: a small file with a name of this machine in it, and an answer.
#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "drivers/usb/power_control.hpp"

namespace booth::drivers::usb {

/// The file of a request has the step's name: "port" (argument: a port, "2-1"), "controller" (a PCI address), "usbfs-memory" (MiB).
enum class RecoverStep : std::uint8_t { port, controller, usbfs_memory };
std::string_view to_string(RecoverStep step);
std::optional<RecoverStep> parse_recover_step(std::string_view text);

struct RecoverRequest {
  std::string number;    ///< comes back with the answer, so that no old one is taken for it
  std::string argument;  ///< only characters of ports, addresses and numbers; whether there is such a thing here is the answerer's question
};
/// "NUMBER ARGUMENT\n", at most 64 bytes; nothing for any other text.
std::optional<RecoverRequest> parse_recover_request(std::string_view text);

/// The side with the rights, once. Whatever lies at the request's name is deleted; what is no plain, small, fresh file with a well-formed request in it is
/// refused. The answer ("NUMBER RESULT SENTENCE\n") replaces that before it. Both folders must exist; nothing in the folder of requests is followed.
PowerOutcome answer_recover_request(RecoverStep step, const std::filesystem::path& requests, const std::filesystem::path& answers, PowerControl& power);

/// The side without. Thread-safe; one request at a time.
class RecoverClient {
 public:
  /// `pause` waits between looks for the answer; `patience` is the longest that an answer is waited for.
  RecoverClient(std::filesystem::path requests, std::filesystem::path answers, hal::Nanoseconds patience = std::chrono::seconds(8),
                std::function<void(hal::Nanoseconds)> pause = {});
  /// `not_permitted` when nobody answers.
  PowerOutcome ask(RecoverStep step, const std::string& argument);

 private:
  const std::filesystem::path requests_, answers_;
  const hal::Nanoseconds patience_;
  const std::function<void(hal::Nanoseconds)> pause_;
  std::mutex mutex_;
};

}  // namespace booth::drivers::usb
