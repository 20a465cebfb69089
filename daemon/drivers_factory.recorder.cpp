// From the keys of [record] to a recorder.
#include "daemon/drivers_factory.recorder.hpp"

#include "drivers/recording/bag_file.hpp"
#include "drivers/recording/flight_recorder.hpp"
#include "drivers/recording/sealed_recording.hpp"

namespace booth::daemon {
namespace {

drivers::FlightRecorderSettings settings_of(const Config& config) {
  return {.directory = config.record.directory,
          .depth = config.record.depth,
          .seconds = config.record.memory_seconds,
          .memory_bytes = static_cast<std::size_t>(config.record.memory_bytes),
          .keep_free_bytes = static_cast<std::uint64_t>(config.record.keep_free_bytes),
          .seal = {}};
}

std::vector<hal::CameraDescription> descriptions(const DepthSource& source) {
  std::vector<hal::CameraDescription> out;
  for (const auto& camera : source.cameras) out.push_back(camera->description());
  return out;
}

}  // namespace

std::unique_ptr<hal::FlightRecorder> open_recorder(const Config& config, const DepthSource& source, hal::SealFiles seal) {
  drivers::FlightRecorderSettings settings = settings_of(config);
  settings.seal = std::move(seal);
  return drivers::make_flight_recorder(settings, descriptions(source), source.background, *source.clock);
}

std::size_t recorder_memory(const Config& config, const DepthSource& source) {
  return drivers::flight_recorder_memory(settings_of(config), descriptions(source));
}

std::vector<std::string> recover_recordings(const Config& config) { return drivers::recover_bags(config.record.directory); }

bool is_sealed_recording(const std::filesystem::path& folder) { return drivers::is_sealed_recording(folder); }
const char* const kSealedRecordingName = drivers::kSealedRecording;

std::string unpack_recording(const std::function<bool(std::string&)>& next, const std::string& name, const std::filesystem::path& out) {
  return drivers::unpack_recording(next, name, out).torn ? name + ": its last moment is only half there and was left out" : std::string();
}

}  // namespace booth::daemon
