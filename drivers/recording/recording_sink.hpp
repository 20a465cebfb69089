// Where a running recording puts its moments: a bag that everybody can read, or a sealed file that only the key's holder can.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/recording/rosbag2_writer.hpp"
#include "hal/flight_recorder.hpp"
#include "hal/sealed_file.hpp"

namespace booth::drivers {

/// Not thread-safe. All but the plain questions throw std::runtime_error naming the file and the reason.
class RecordingSink {
 public:
  virtual ~RecordingSink() = default;
  virtual void depth(std::size_t camera, std::span<const std::byte> packed, hal::UtcTime utc) = 0;
  virtual void group(const hal::FittedGroup& group, hal::Nanoseconds utc_offset) = 0;
  virtual void event(const std::string& text, hal::UtcTime utc) = 0;
  /// To be called now and then: what is older than a second goes to the disk.
  virtual void commit_if_due() = 0;
  /// After a failure: what could not be written is given up, so that close() can make something whole of the rest.
  virtual void give_up_last() noexcept = 0;
  virtual void close() = 0;
  virtual std::uint64_t bytes() const = 0;
  virtual const std::filesystem::path& folder() const = 0;
};

/// A rosbag2 folder, or with `seal` a folder that holds the same, sealed. `path` must not exist.
std::unique_ptr<RecordingSink> make_recording_sink(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras,
                                                   const std::vector<hal::DepthFrame>& background, BagContents contents, const hal::SealFiles& seal);

}  // namespace booth::drivers
