// A booth whose swarm lives on a device (emulated here): it is lost, comes back, has no memory; what the daemon says of it; that it agrees with the CPU.
#include <gtest/gtest.h>

#include <fstream>
#include <mutex>

#include "daemon/drivers_factory.hpp"
#include "daemon/io/model_file.hpp"
#include "daemon/pipeline/fit_setup.hpp"
#include "daemon/pipeline/fit_signature.hpp"
#include "daemon/pipeline/offline_run.hpp"
#include "daemon/session/controller.hpp"
#include "fit/swarm/device/cuda_device.hpp"
#include "fit/swarm/device/device_swarm.hpp"
#include "fit/swarm/device/emulated_device.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using fit::device::DeviceError;

/// The simulated booth in real time, preset paper with a small swarm, a device that does what `faults` say.
struct DeviceBooth : ::testing::Test {
  void build() {
    config.cameras.driver = "synthetic";
    source = open_source(config);
    std::vector<hal::CameraDescription> descriptions;
    for (const auto& camera : source.cameras) descriptions.push_back(camera->description());
    FitSetup setup = make_fit_setup(config, source.cameras, source.background);
    fit::EstimatorSettings settings;
    settings.preset = fit::Preset::paper, settings.sex = fit::SexChoice::men, settings.backend = fit::BackendChoice::cuda;
    settings.swarm.particles = settings.device_particles = 24, settings.swarm.iterations = 2;
    settings.guard = {.first_wait = 5ms, .longest_wait = 20ms};
    settings.open_device = [this](std::string&) { return fit::device::make_emulated_device(faults); };
    fitter = std::make_unique<EstimatorFitter>(descriptions, source.background, FitModels{setup.models.men, nullptr, prior()}, fit::CloudSettings{}, settings);
    ControllerSettings c;
    c.session_directory = folder.path;
    c.limits.search = 600s, c.limits.session = 600s;
    c.on_event = [this](const std::string& kind, const std::string& from, const std::string& text) {
      const std::lock_guard lock(events_mutex);
      if (from == "fit" && text.rfind("the fit is computed", 0) == 0) events.push_back(kind + ": " + text);
    };
    c.models = setup.models;
    controller = std::make_unique<Controller>(c, *source.clock);
    pipeline = std::make_unique<Pipeline>(Pipeline::Settings{.minimum_cameras = 2, .synchroniser = {}}, source.cameras, *source.clock, *fitter, *controller);
    controller->run(*pipeline, *fitter, nullptr);
    ASSERT_TRUE(controller->request(SessionEvent::start, "test").accepted);
  }
  std::shared_ptr<const fit::PosePrior> prior() const { return std::make_shared<const fit::PosePrior>(load_pose_prior(find_models() / "pose.npz")); }
  void TearDown() override {
    if (controller) controller->shutdown("test");
    pipeline.reset();
  }
  std::uint64_t frames() const { return controller->status().counters.fitted; }
  BackendStatus backend() const { return controller->status().backend; }
  bool frames_go_on() {
    const std::uint64_t before = frames();
    return tests::eventually([&] { return frames() >= before + 2; }, 120s);
  }

  /// Of the fit, so far.
  std::vector<std::string> said() {
    const std::lock_guard lock(events_mutex);
    return events;
  }

  Config config;
  tests::TemporaryFolder folder;
  std::mutex events_mutex;
  std::vector<std::string> events;
  fit::device::Faults faults;
  DepthSource source;
  std::unique_ptr<EstimatorFitter> fitter;
  std::unique_ptr<Controller> controller;
  std::unique_ptr<Pipeline> pipeline;
};

TEST_F(DeviceBooth, GoesOnWithoutADeviceThatIsLostAndTakesItBack) {
  ::testing::internal::CaptureStderr();
  build();
  ASSERT_TRUE(frames_go_on());
  EXPECT_EQ(backend().name, "device emulated");
  EXPECT_EQ(backend().problem, "");
  EXPECT_TRUE(said().empty());
  // Its driver is reset, it hangs, it is removed, it has no memory.
  std::size_t times = 0;
  for (const DeviceError error : {DeviceError::lost, DeviceError::late, DeviceError::absent, DeviceError::out_of_memory}) {
    ++times;
    const int tried = faults.starts;
    faults.at_start = DeviceError::absent;  // and away for a while
    faults.error = error;
    faults.runs_left = 0;
    ASSERT_TRUE(tests::eventually([&] { return backend().losses == times; }, 120s));
    ASSERT_TRUE(frames_go_on());
    EXPECT_EQ(backend().name.substr(0, 3), "cpu");
    EXPECT_NE(backend().problem, "");
    ASSERT_TRUE(tests::eventually([&] { return said().size() == 2 * times - 1; }, 120s));
    EXPECT_EQ(said().back().rfind("fault: the fit is computed by cpu", 0), 0u) << said().back();
    ASSERT_TRUE(tests::eventually([&] { return faults.starts >= tried + 2; }, 120s)) << "nobody tries the device again";
    EXPECT_EQ(said().size(), 2 * times - 1) << "a device that is tried in vain is no news";
    // It comes back.
    faults.runs_left = -1;
    faults.at_start = DeviceError::none;
    ASSERT_TRUE(tests::eventually([&] { return backend().name == "device emulated"; }, 120s));
    ASSERT_TRUE(frames_go_on());
    EXPECT_EQ(backend().problem, "");
    EXPECT_EQ(backend().changes, 2 * times);
    ASSERT_TRUE(tests::eventually([&] { return said().size() == 2 * times; }, 120s));
    EXPECT_EQ(said().back(), "state: the fit is computed by device emulated");
  }
  controller->shutdown("test");
  const std::string log = ::testing::internal::GetCapturedStderr();
  EXPECT_NE(log.find("the fit is computed by cpu"), std::string::npos) << log;
  EXPECT_NE(log.find("the fit is computed by device emulated"), std::string::npos) << log;
}

TEST_F(DeviceBooth, StartsOnTheCpuWhereTheDeviceHasNoMemory) {
  faults.at_start = DeviceError::out_of_memory;
  build();
  ASSERT_TRUE(frames_go_on());
  EXPECT_EQ(backend().name.substr(0, 3), "cpu");
  EXPECT_NE(backend().problem.find("out of device memory"), std::string::npos) << backend().problem;
  EXPECT_EQ(backend().losses, 0u);
  ASSERT_TRUE(tests::eventually([&] { return !said().empty(); }, 120s));
  EXPECT_EQ(said().front().rfind("fault: the fit is computed by cpu", 0), 0u) << said().front();
}

TEST_F(DeviceBooth, CountsTheDevicesMemoryInThePlan) {
  faults.at_start = DeviceError::absent;  // it is planned for all the same
  build();
  std::size_t pinned = 0, device = 0;
  for (const MemoryItem& item : fitter->memory_plan()) {
    if (item.what == "pinned for the graphics processor") pinned = item.bytes;
    if (item.what == "on the graphics processor") device = item.bytes;
  }
  EXPECT_GT(pinned, 3 * sizeof(float) * 120000);  // the cloud
  EXPECT_GT(device, std::size_t{20} << 20);
  EXPECT_LT(device, std::size_t{200} << 20);
}

/// The device's field holds the exact nearest points, the CPU's nearly: so far may a particle's data terms differ.
constexpr double kTolerance = 0.02;

TEST(DeviceAndCpu, AgreeOnTheGoldenFrames) {
  Config config;
  DepthSource source = open_synthetic_source(config, static_cast<double>(kGoldenFrames + 2) / 30);
  FitSetup setup = make_fit_setup(config, source.cameras, source.background);
  const auto prior = std::make_shared<const fit::PosePrior>(load_pose_prior(find_models() / "pose.npz"));
  const fit::BodyModel* model = setup.models.men.get();
  const fit::SwarmSizes sizes{.swarm = {.particles = 16, .iterations = 1}};
  fit::WorkerPool pool(2);
  fit::device::Faults none;
  const auto device = fit::device::make_device_swarm(fit::device::make_emulated_device(none), {&model, 1}, *prior, sizes);
  const auto cpu = fit::make_cpu_swarm({&model, 1}, *prior, sizes, pool);
  int frames = 0;
  run_offline(source.cameras, static_cast<int>(source.cameras.size()), *setup.fitter, [&](const FitInput&, const FrameRecord& record) {
    std::vector<float> particle(static_cast<std::size_t>(cpu->dimensions(0)), 0.0f);
    for (std::size_t k = 0; k < kRecordDofs; ++k) particle[k] = static_cast<float>(record.q[k]);
    const fit::Cloud& cloud = setup.fitter->observation().cloud;
    fit::ParticleTerms a{}, b{};
    EXPECT_TRUE(device->set_cloud(cloud) && device->evaluate(0, particle, a) && cpu->set_cloud(cloud) && cpu->evaluate(0, particle, b));
    EXPECT_NEAR(a.point / b.point, 1, kTolerance) << "frame " << frames;
    EXPECT_NEAR(a.plane / b.plane, 1, kTolerance) << "frame " << frames;
    EXPECT_EQ(a.bone, b.bone);
    return ++frames < kGoldenFrames;
  });
  EXPECT_EQ(frames, kGoldenFrames);
}

/// tests/golden/signature-cuda.txt: lines of a number of frames and their signature.
std::string committed_signature(int frames) {
  std::ifstream file(BOOTH_SOURCE_DIR "/tests/golden/signature-cuda.txt");
  int n = 0;
  for (std::string text; file >> n >> text;)
    if (n == frames) return text;
  return "";
}

TEST(DeviceSignature, IsTheCommittedOneForTheFirstFrameEmulated) {
  fit::device::Faults none;
  EXPECT_EQ(golden_device_signature(2, 1, [&](std::string&) { return fit::device::make_emulated_device(none, 132); }), committed_signature(1))
      << "what a device computes has changed. If that is what you want, put the new values there (boothctl bench signature --backend emulated --frames 1, and "
         "--backend cuda) and say so in the commit";
}

TEST(DeviceSignature, IsTheCommittedOneOnACudaDevice) {
  std::string why;
  if (!fit::device::make_cuda_device(why)) GTEST_SKIP() << "skipped: " << why;
  for (int run = 0; run < 2; ++run) EXPECT_EQ(golden_device_signature(2, kGoldenFrames), committed_signature(kGoldenFrames));
}

}  // namespace
}  // namespace booth::daemon
