// From what a person asks of `boothctl simulate` to cameras, truth and an open recording, without naming a driver.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "daemon/drivers_factory.hpp"
#include "hal/depth_sink.hpp"

namespace booth::daemon {

struct SimulationRequest {
  std::string body = "men";         ///< "men", "women" or "test:N" (a body set aside from training)
  std::vector<double> beta;         ///< of men or women; the coefficients behind are zero
  std::string motion = "showcase";  ///< a motion's name, or a file that ends in .npy, .amc or .bvh
  double from = 0;                  ///< seconds of a motion file that are left out at its start
  double seconds = 0;               ///< 0: as long as the motion
  std::string noise = "kinect2";    ///< kinect2, none or gaussian:SIGMA
  std::uint64_t seed = 1;
  std::string layout = "rosbag2";  ///< rosbag2 or folder
  bool keep_path = false;          ///< do not bring a motion file's path onto the stage
  std::filesystem::path models;    ///< empty: where find_models() looks
  std::filesystem::path out;       ///< must not exist
};

struct Simulation {
  DepthSource source;                    ///< as fast as it is read
  std::unique_ptr<hal::DepthSink> sink;  ///< what is not closed is a leftover with a temporary name
  double seconds = 0;                    ///< of scene time
};

/// Throws std::invalid_argument or std::runtime_error naming the option or the file, what is wrong and what is allowed.
Simulation open_simulation(const SimulationRequest& request);

}  // namespace booth::daemon
