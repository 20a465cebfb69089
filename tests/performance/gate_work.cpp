// What the performance gate counts: cloud and tracking of a few frames on one thread, each behind a function of its own that callgrind can name.
#include <iostream>
#include <memory>

#include "daemon/io/model_file.hpp"
#include "daemon/pipeline/estimator_fitter.hpp"
#include "tests/support/frame_memory.hpp"

namespace {

using namespace booth;

constexpr std::size_t kGroups = 6;

struct Work {
  tests::FrameMemory memory;
  std::vector<fit::Camera> cameras;
  std::unique_ptr<fit::CloudBuilder> builder;
  std::unique_ptr<fit::Observation> observation;
  std::unique_ptr<fit::Estimator> estimator;
  fit::FollowedPerson followed{{}};
  fit::CloudReport report;
  const fit::FitResult* result = nullptr;
};

}  // namespace

extern "C" {

__attribute__((noinline)) void gate_cloud(Work& work, std::size_t group) {
  std::vector<fit::DepthInput> inputs;
  for (std::size_t c = 0; c < work.cameras.size(); ++c) inputs.push_back({static_cast<int>(c), work.memory.frames[c][group].depth.data(), 0});
  work.observation->frame = group;
  work.observation->time = static_cast<double>(group) / 30;
  work.builder->build(inputs, *work.observation, work.report, work.followed.at(work.observation->time));
}

__attribute__((noinline)) void gate_fit(Work& work) { work.result = &work.estimator->step(*work.observation); }
__attribute__((noinline)) void gate_start(Work& work) { work.result = &work.estimator->step(*work.observation); }
}

int main() {
  tests::SceneRequest request;
  request.motion = "wave", request.seconds = kGroups / 30.0;
  Work work;
  work.memory = tests::render_frames(request);
  for (const auto& camera : work.memory.cameras) work.cameras.push_back(daemon::fit_camera(camera));
  const auto folder = daemon::find_models();
  const auto model = std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "men.npz"));
  const auto prior = std::make_shared<const fit::PosePrior>(daemon::load_pose_prior(folder / "pose.npz"));
  work.builder = std::make_unique<fit::CloudBuilder>(fit::CloudSettings{.threads = 1}, work.cameras);
  for (const auto& frame : work.memory.background) work.builder->set_background(hal::to_int(frame.camera), frame.depth);
  work.observation = std::make_unique<fit::Observation>(work.builder->make_observation(120000));
  fit::EstimatorSettings settings;
  settings.threads = 1;
  work.estimator = std::make_unique<fit::Estimator>(model, nullptr, prior, settings);
  for (std::size_t k = 0; k < kGroups; ++k) {
    gate_cloud(work, k);
    k == 0 ? gate_start(work) : gate_fit(work);
    work.followed.remember(*work.result, *work.observation);
  }
  std::cout << kGroups << " groups, " << work.observation->cloud.size << " points\n";
}
