// Puts the daemon together as boothd.cpp does, with a tap between pipeline and controller.
#include "tests/support/memory_booth.hpp"

#include <dds/dds.h>
#include <unistd.h>

#include <algorithm>

#include "booth.h"
#include "daemon/config/config.hpp"

namespace booth::tests {

using namespace std::chrono_literals;

/// Looks at what passes: the fitter's input and the sink's output, both on the fit thread.
struct MemoryBooth::Tap final : daemon::FrameFitter, daemon::FrameSink {
  MemoryBooth& booth;
  explicit Tap(MemoryBooth& b) : booth(b) {}
  std::int64_t arrived = 0;

  void reset() override { booth.setup_.fitter->reset(); }
  void step(const daemon::FitInput& input, daemon::FrameRecord& out) override {
    arrived = 0;
    for (const hal::DepthFrame* frame : input.frames)
      if (frame) arrived = std::max<std::int64_t>(arrived, frame->received.time_since_epoch().count());
    booth.setup_.fitter->step(input, out);
  }
  const char* remark() const override { return booth.setup_.fitter->remark(); }
  std::vector<daemon::MemoryItem> memory_plan() const override { return booth.setup_.fitter->memory_plan(); }

  void publish(daemon::FrameRecord& record) noexcept override { booth.controller_->publish(record); }
  void log(const daemon::FrameRecord& record) noexcept override {
    booth.controller_->log(record);
    const std::uint64_t n = booth.frames_.load(std::memory_order_relaxed);
    if (n < booth.notes_.size()) booth.notes_[n] = {record.captured_ns, arrived, record.published_ns, record.person, record.cameras};
    booth.frames_.store(n + 1, std::memory_order_release);
    if (booth.after_frame) booth.after_frame();
  }
};

MemoryBooth::MemoryBooth(const FrameMemory& memory, hal::Clock& clock, Options options) : clock_(clock), notes_(options.notes) {
  const hal::MonotonicTime begin = clock.now() + 200ms;
  for (std::size_t i = 0; i < memory.cameras.size(); ++i)
    cameras_.push_back(std::make_unique<MemoryCamera>(memory, i, clock, begin, options.decode ? options.decode(i) : MemoryCamera::Decode{}));
  daemon::Config config;
  config.fit.threads = options.threads;
  setup_ = daemon::make_fit_setup(config, cameras_, memory.background);

  daemon::ControllerSettings settings;
  settings.session_directory = folder_.path;
  settings.limits.search = std::chrono::hours(24);
  settings.limits.session = std::chrono::hours(24);
  settings.models = setup_.models;
  controller_ = std::make_unique<daemon::Controller>(settings, clock);
  const auto domain = static_cast<std::uint32_t>(100 + ::getpid() % 100);  // tests that run side by side do not hear each other
  daemon::DdsSettings dds{.booth = "memory", .domain = domain, .interface = "lo", .multicast = false, .peers = {}};
  if (options.ros2) dds.ros2 = daemon::Ros2Settings{.cameras = {cameras_.front()->description()}};
  dds_ = std::make_unique<daemon::DdsLink>(dds, clock, [](daemon::DdsCommand) { return daemon::DdsAnswer{}; });
  tap_ = std::make_unique<Tap>(*this);
  cloud_tap_ = std::make_unique<daemon::CloudTap>(*tap_, setup_.fitter->observation(), *dds_);
  pipeline_ = std::make_unique<daemon::Pipeline>(daemon::Pipeline::Settings{}, cameras_, clock, *cloud_tap_, *tap_);
  controller_->run(*pipeline_, *cloud_tap_, dds_.get());
  reader_ = std::thread([this, domain] {
    const dds_entity_t participant = dds_create_participant(domain, nullptr, nullptr);
    dds_qos_t* qos = dds_create_qos();
    const char* partition = "memory";
    dds_qset_partition(qos, 1, &partition);
    const dds_entity_t subscriber = dds_create_subscriber(participant, qos, nullptr);
    dds_delete_qos(qos);
    const dds_entity_t topic = dds_create_topic(participant, &booth_msg_Skeleton_desc, "booth/skeleton", nullptr, nullptr);
    const dds_entity_t reader = dds_create_reader(subscriber, topic, nullptr, nullptr);
    while (!stop_) {
      void* samples[1] = {nullptr};
      dds_sample_info_t info[1];
      while (dds_take(reader, samples, info, 1, 1) == 1) {
        heard_ += info[0].valid_data;
        dds_return_loan(reader, samples, 1);
        samples[0] = nullptr;
      }
      std::this_thread::sleep_for(5ms);
    }
    dds_delete(participant);
  });
  controller_->request(daemon::SessionEvent::start, "memory booth");
}

MemoryBooth::~MemoryBooth() {
  controller_->shutdown("end");
  stop_ = true;
  reader_.join();
  pipeline_.reset();
}

}  // namespace booth::tests
