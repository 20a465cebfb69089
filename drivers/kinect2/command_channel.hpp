// One command at a time to a Kinect v2, with time-outs, checked answers and one careful repetition.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/kinect2/calibration.hpp"
#include "drivers/kinect2/layout.hpp"
#include "drivers/kinect2/notes.hpp"
#include "drivers/usb/usb.hpp"

namespace booth::drivers::kinect2 {

class CommandError : public std::runtime_error {
 public:
  enum class Kind : std::uint8_t {
    timeout,     ///< no answer within a second, nor to a second try
    premature,   ///< completed without the data that were asked for
    refused,     ///< completed with a status other than success
    short_data,  ///< fewer bytes than such an answer has, or bytes that make no sense
    protocol,    ///< an answer that is none, or to other commands only
    gone,        ///< the device left the bus
  };
  CommandError(Kind kind, const std::string& sentence) : std::runtime_error(sentence), kind_(kind) {}
  Kind kind() const { return kind_; }

 private:
  Kind kind_;
};

inline constexpr std::size_t kMostParameters = 4;

/// The command packet; returns the bytes used of `out`. At most kMostParameters.
std::size_t write_request(std::span<std::byte> out, std::uint32_t transaction, Command command, std::span<const std::uint32_t> parameters,
                          std::uint32_t most_reply);

struct Completion {
  std::uint32_t transaction = 0, status = 0;
};
/// Whether these bytes are a completion packet; `out` is set when they are.
bool read_completion(std::span<const std::byte> bytes, Completion& out);

/// Not thread-safe. Takes its largest buffer (1.3 MB) only for the calibration pages, and gives it back. A command that no answer of its own came to is
/// repeated once, after everything that was still queued has been read.
class CommandChannel {
 public:
  explicit CommandChannel(usb::Device& device, Notes notes = {}) : device_(device), notes_(std::move(notes)) {}

  /// Reads away what an earlier owner of the device left unread.
  void drain();

  std::string firmware();
  std::string serial();
  /// Code of the circuit board, for the log; may be empty.
  std::string board();
  DepthCameraParameters depth_camera();
  PhaseOffsets phase_offsets();
  ColourCameraParameters colour_camera();
  /// The sensor's status word; bit 0: ready to stream.
  std::uint32_t status();
  void start_infrared() { (void)run(Command::start_infrared, {}, 0, 0); }
  void stop_infrared() { (void)run(Command::stop_infrared, {}, 0, 0); }
  void colour(bool on);
  /// `led`: 0 or 1; `level`: 0 (off) to 1000, steady.
  void light(int led, int level);
  /// The device leaves the bus, perhaps before it answers: only a refusal is an error.
  void reboot();

 private:
  std::vector<std::byte> run(Command command, std::span<const std::uint32_t> parameters, std::size_t most_reply, std::size_t least_reply);
  std::vector<std::byte> attempt(Command command, std::span<const std::uint32_t> parameters, std::size_t most_reply, std::size_t least_reply);
  std::vector<std::byte> page(Page page, std::size_t most, std::size_t least);
  std::vector<std::byte> answer(std::uint32_t transaction, const std::string& name, std::size_t most_reply, std::size_t least_reply);
  template <typename Parse>
  auto parsed(Parse parse) const;
  void require(usb::Status status, const std::string& what) const;
  std::string name() const;
  [[noreturn]] void fail(CommandError::Kind kind, const std::string& what) const;

  usb::Device& device_;
  const Notes notes_;
  std::uint32_t transaction_ = 0;
};

}  // namespace booth::drivers::kinect2
