// Where the ROS 2 mirror hears of the person's points: around the fitter, so that neither pipeline nor fitter know of it.
#pragma once

#include "daemon/dds/dds_link.hpp"
#include "daemon/pipeline/frame_fitter.hpp"
#include "fit/cloud/observation.hpp"

namespace booth::daemon {

/// Offers each frame's cloud to the link; all else is the fitter's. `observation` is what the fitter fills in each step. All outlive the tap.
class CloudTap final : public FrameFitter {
 public:
  CloudTap(FrameFitter& fitter, const fit::Observation& observation, DdsLink& dds) : fitter_(fitter), observation_(observation), dds_(dds) {}
  void reset() override { fitter_.reset(); }
  void step(const FitInput& input, FrameRecord& out) override {
    fitter_.step(input, out);
    if (out.person != PersonState::lost) dds_.offer_cloud(observation_.cloud, input.reference.time_since_epoch().count());
  }
  const char* remark() const override { return fitter_.remark(); }
  std::vector<MemoryItem> memory_plan() const override { return fitter_.memory_plan(); }
  BackendStatus backend() const override { return fitter_.backend(); }
  std::vector<CameraDriftStatus> drift() const override { return fitter_.drift(); }

 private:
  FrameFitter& fitter_;
  const fit::Observation& observation_;
  DdsLink& dds_;
};

}  // namespace booth::daemon
