// Decides from what boothd says of itself whether an update may stay: one rule, apart from sockets and clocks, so that tests hold it.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "daemon/ctl/status_reading.hpp"

namespace booth::daemon {

struct HealthDemand {
  std::uint64_t frames = 0;   ///< whole frames that each camera has to deliver while it is watched; a booth without cameras owes none
  bool every_camera = false;  ///< no camera may be missing; otherwise cameras.minimum of them are enough
  std::string software{};     ///< what has to answer, as `software` of the status: an update says nothing while the old process runs; empty: any
};

struct HealthVerdict {
  bool healthy = false;
  std::string sentence;  ///< why not, or what was seen
};

/// Fed with one status after another. Not thread-safe.
class HealthGate {
 public:
  explicit HealthGate(HealthDemand demand) : demand_(demand) {}

  /// `status` is boothd's answer to the request "status", which it gives only when it is ready; anything else is unhealthy.
  HealthVerdict look(const StatusJson& status);
  /// The connection broke: frames of another boothd, or of the same before a restart, do not count.
  void forget() { first_.clear(); }

  struct Camera {
    std::string name, state;
    std::uint64_t frames = 0;  ///< since it was first seen
  };
  const std::vector<Camera>& cameras() const { return cameras_; }

 private:
  void count(const StatusJson& status);

  const HealthDemand demand_;
  std::map<std::string, std::uint64_t> first_;  ///< what each camera had delivered when it was first seen
  std::vector<Camera> cameras_;
};

}  // namespace booth::daemon
