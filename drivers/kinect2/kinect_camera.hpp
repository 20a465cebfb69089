// The Kinect v2 as a hal::DepthCamera: frames are assembled on the stream's thread and decoded on the reader's; trouble climbs the recovery ladder.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "drivers/kinect2/calibration_cache.hpp"
#include "drivers/kinect2/decoder.hpp"
#include "drivers/kinect2/notes.hpp"
#include "drivers/kinect2/patience.hpp"
#include "drivers/kinect2/recovery_ladder.hpp"
#include "drivers/usb/usb.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"

namespace booth::drivers::kinect2 {

/// What only an installation that permits it can do; false where it cannot. `path` is the camera's port, "2-1.3".
struct PowerTools {
  std::function<bool(const std::string&path)> reset_port, rebind_controller;
};

/// Makes a camera's decoder.
using DecoderMaker = std::function<std::unique_ptr<Decoder>(const DepthCameraParameters&, const PhaseOffsets&, const DecoderSettings&)>;

/// What the cameras of one booth share. Outlives them.
struct KinectShared {
  std::shared_ptr<usb::Bus> bus;
  std::shared_ptr<hal::Clock> clock;
  std::shared_ptr<CalibrationCache> cache{};  ///< null: calibration is read from the device at each start of the daemon
  std::shared_ptr<ResetGate> gate = std::make_shared<ResetGate>();
  PowerTools power{};
  Notes notes{};
  DecoderMaker decoder{};  ///< empty: the fastest on this processor; make_guarded_decoder() for one on a graphics processor
};

struct KinectSettings {
  hal::CameraIndex index{};
  std::string serial;
  std::string name;  ///< of its position
  hal::RigidTransform camera_to_world{};
  double depth_gain = 0, depth_offset = 0;  ///< as in hal::CameraDescription
  DecoderSettings decoder{};
  int transfers = 24;         ///< of one millisecond each; 24 take 6.5 MB of usbfs memory
  bool colour = false;        ///< receive and check the colour stream (nobody uses it yet; it costs bus time)
  double nominal_rate = 30;   ///< frames per second; only an emulated sensor has another
  bool reset_on_open = true;  ///< nearly ends hangs after an unclean exit
  Patience patience{};
};

/// Opens the device once to learn its calibration, unless the cache knows it. Throws std::runtime_error with the remedy when neither can be had.
std::unique_ptr<hal::DepthCamera> make_kinect_camera(KinectShared shared, KinectSettings settings);

}  // namespace booth::drivers::kinect2
