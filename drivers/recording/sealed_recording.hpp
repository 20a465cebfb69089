// A recording as one stream of bytes that can be sealed while it is written, and the bag that is made of it when it is opened.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/recording/recording_sink.hpp"

namespace booth::drivers {

/// FOLDER/recording.sealed. The stream: records, each its size (4 bytes, little-endian), a byte that says what it is, and the contents
/// (docs/reference/recordings.md).
inline constexpr const char* kSealedRecording = "recording";

std::unique_ptr<RecordingSink> make_sealed_sink(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras,
                                                const std::vector<hal::DepthFrame>& background, BagContents contents, const hal::SealFiles& seal);

/// Whether a folder holds such a recording.
bool is_sealed_recording(const std::filesystem::path& folder);

/// Finishes one that a dead process left behind (NAME.partial-XXXXXX), under the name NAME; nothing of it needs to be read. Returns the sentence to log.
std::string recover_sealed(const std::filesystem::path& partial) noexcept;

struct Unpacked {
  std::uint64_t records = 0;
  bool torn = false;  ///< the stream ended inside a record, which an interruption explains
};

/// The next piece of the opened stream, of any length; false at its end.
using OpenedStream = std::function<bool(std::string& piece)>;

/// Makes a rosbag2 folder `out`, which must not exist, of the stream: message for message what would have been recorded without a seal. Throws
/// std::runtime_error; `name` is the stream's in its sentences.
Unpacked unpack_recording(const OpenedStream& stream, const std::string& name, const std::filesystem::path& out);

}  // namespace booth::drivers
