// hal::FlightRecorder over a ring of packed moments in memory and rosbag2 folders on disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "hal/clock.hpp"
#include "hal/flight_recorder.hpp"
#include "hal/sealed_file.hpp"

namespace booth::drivers {

struct FlightRecorderSettings {
  std::filesystem::path directory;          ///< of the recordings; made (mode 0700) when the first one is
  bool depth = false;                       ///< depth images may be kept in memory and written
  double seconds = 30;                      ///< how far back the memory reaches
  std::size_t memory_bytes = 800u << 20;    ///< of packed depth images; without depth a small part of it is taken
  std::uint64_t keep_free_bytes = 1 << 30;  ///< a recording ends when the disk has less left
  hal::SealFiles seal{};                    ///< closes what is written for a key that is elsewhere; empty: recordings are plain
};

/// What it takes, before anything is allocated.
std::size_t flight_recorder_memory(const FlightRecorderSettings& settings, const std::vector<hal::CameraDescription>& cameras);

/// The memory is taken and the thread runs when this returns. Descriptions and background are copied; `clock` outlives the recorder. Its end ends recordings
/// and waits until their files are whole. Throws std::bad_alloc.
std::unique_ptr<hal::FlightRecorder> make_flight_recorder(const FlightRecorderSettings& settings, const std::vector<hal::CameraDescription>& cameras,
                                                          const std::vector<hal::DepthFrame>& background, hal::Clock& clock);

}  // namespace booth::drivers
