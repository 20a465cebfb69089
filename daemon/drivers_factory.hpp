// The one place where the daemon meets drivers: from configuration to cameras, truth and clock.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "daemon/config/config.hpp"
#include "daemon/record/calibration_used.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"
#include "hal/flight_recorder.hpp"
#include "hal/ground_truth.hpp"

namespace booth::daemon {

struct DepthSource {
  std::shared_ptr<hal::Clock> clock;
  hal::DepthCameras cameras;
  std::shared_ptr<const hal::GroundTruth> truth;  ///< null where nothing is known
  std::vector<hal::DepthFrame> background;        ///< of the empty booth
  std::string name;                               ///< for session.json
  std::vector<hal::FittedGroup> live_groups{};    ///< of a recording: what the live booth did with its frames, where that is known
  hal::Nanoseconds to_live{};                     ///< added to a frame's `captured`, as read at full speed, gives what it was live
  CalibrationUsed calibration{};                  ///< where the places of the cameras are from
};

/// What decoding depth on a graphics processor (cameras.kinect2.decoder) takes of it, and of the host's memory pinned; nothing where that is not asked for.
struct DecodeBytes {
  std::size_t device = 0, pinned = 0;
};
DecodeBytes decode_memory(const Config& config, std::size_t cameras);

/// The machine's clock, for what needs no cameras.
std::shared_ptr<hal::Clock> open_system_clock();

/// What cameras.driver names, at its own pace unless the configuration says otherwise. Throws std::runtime_error or std::invalid_argument naming the
/// file, the key or the device.
DepthSource open_source(const Config& config);

/// Every frame of a recording, as fast as it is read.
DepthSource open_recording_source(const std::filesystem::path& path);

/// The simulated booth of the configuration, as fast as it is read, for so many seconds of scene time.
DepthSource open_synthetic_source(const Config& config, double seconds);

}  // namespace booth::daemon
