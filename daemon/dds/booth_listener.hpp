// The other end of a booth's topics: hears any number of booths and remembers the latest of each. What fleet consoles are made from.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/dds_settings.hpp"

namespace booth::daemon {

/// The latest skeleton of a booth, as far as people look at it. Booth frame, metres; what came in is not checked for being finite.
struct HeardSkeleton {
  std::uint64_t serial_number = 0, frame = 0, groups_dropped = 0;
  std::int64_t capture_utc_ns = 0, publish_utc_ns = 0;
  std::uint8_t state = 0, person = 0;  ///< SessionState, PersonState
  std::array<std::array<double, 3>, kRecordJoints> joints{};
  std::array<std::uint8_t, kRecordJoints> seen{};
  float residual = 0;
};

struct HeardBooth {
  bool status_known = false, skeleton_known = false;
  bool present = false;  ///< its skeleton writer is alive
  bool twice = false;    ///< two living writers use this name
  StatusSample status;
  HeardSkeleton skeleton;
  std::int64_t status_utc_ns = 0;                   ///< the booth's clock when it sent its status
  std::uint64_t skeletons = 0, skeletons_lost = 0;  ///< heard, and missing in the row of serial numbers
};

/// Names of states as boothctl says them; a number that is none of them is "?".
const char* session_state_name(std::uint8_t state);
const char* person_state_name(std::uint8_t person);

/// Text from the network as a terminal may see it: control characters become '?', bytes that are no UTF-8 too; at most `limit` bytes.
std::string printable(const std::string& text, std::size_t limit = 400);

/// Not thread-safe. Remembers at most kMostBooths booths, whatever the network says.
class BoothListener {
 public:
  static constexpr std::size_t kMostBooths = 1024;

  /// `settings.booth` is the booth to hear, "*" any. Throws std::runtime_error naming what DDS refused.
  explicit BoothListener(const DdsSettings& settings);
  ~BoothListener();
  BoothListener(const BoothListener&) = delete;

  /// Takes in what has come, waiting up to `wait` for something to come. Returns how many skeletons came.
  int poll(std::chrono::milliseconds wait);

  const std::map<std::string, HeardBooth>& booths() const { return booths_; }
  /// Booths that were heard of but found no place.
  std::uint64_t left_out() const { return left_out_; }

 private:
  struct Impl;
  HeardBooth* place(const char* name);
  void take_skeletons(int& count);
  void take_status();

  std::unique_ptr<Impl> impl_;
  std::map<std::string, HeardBooth> booths_;
  std::uint64_t left_out_ = 0;
};

}  // namespace booth::daemon
