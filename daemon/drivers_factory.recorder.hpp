// The flight recorder of the configuration, without naming a driver.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "daemon/drivers_factory.hpp"
#include "hal/flight_recorder.hpp"
#include "hal/sealed_file.hpp"

namespace booth::daemon {

/// Its memory is taken when this returns. `seal`: see FlightRecorderSettings. The source's clock outlives it. Throws std::bad_alloc.
std::unique_ptr<hal::FlightRecorder> open_recorder(const Config& config, const DepthSource& source, hal::SealFiles seal);
/// What that takes.
std::size_t recorder_memory(const Config& config, const DepthSource& source);
/// Finishes recordings that a dead boothd left behind; one sentence each.
std::vector<std::string> recover_recordings(const Config& config);

/// Whether a folder holds a sealed recording, and what its stream is called there.
bool is_sealed_recording(const std::filesystem::path& folder);
extern const char* const kSealedRecordingName;
/// Makes a bag of an opened stream (`next` hands out its pieces until it says false). Returns a sentence on its end where that is missing. Throws
/// std::runtime_error.
std::string unpack_recording(const std::function<bool(std::string&)>& next, const std::string& name, const std::filesystem::path& out);

}  // namespace booth::daemon
