// Lays out the device's memory, records the programs, and carries clouds in and answers out.
#include "fit/swarm/device/device_swarm.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <vector>

namespace booth::fit::device {
namespace {

class Swarm final : public DeviceSwarm {
 public:
  Swarm(std::unique_ptr<Device> device, std::span<const BodyModel* const> models, const PosePrior& prior, const SwarmSizes& sizes)
      : sizes_(sizes), device_(std::move(device)), name_("device " + device_->name()) {
    const auto need = [](bool good, const char* what) {
      if (!good) throw std::invalid_argument(std::string("swarm on a device: ") + what);
    };
    need(!models.empty(), "there is no model");
    need(sizes.swarm.particles >= 1 && sizes.swarm.particles <= 1'000'000, "particles must be 1 to 1000000");
    need(sizes.swarm.iterations >= 1 && sizes.swarm.iterations <= kMostIterations, "iterations must be 1 to 256");
    for (const BodyModel* model : models) packs_.emplace_back(*model, prior, sizes.energy);
    for (const EnergyPack& p : packs_) need(p.dimensions() <= kMostDimensions, "at most 16 shape coefficients");
    need(sizes.field.cell > 0 && sizes.field.band > 0 && sizes.field.band <= 100 * sizes.field.cell * kBrick, "the field's band must be at most 400 cells");
    need(prior.components.cols() <= kMostPoseComponents, "at most 30 pose components");
    // As many blocks as there are processors, or more.
    const auto hold = device_->hold();
    if (!hold) check(DeviceError::lost);
    particles_a_block_ = sizes.swarm.particles >= 12 * device_->processors() ? 16 : 4;
    take_memory();
    for (const EnergyPack& pack : packs_) take_model(pack);
    best_.resize(kMostDimensions);
    history_.resize(static_cast<std::size_t>(sizes.swarm.iterations));
  }

  const char* name() const override { return name_.c_str(); }
  const char* problem() const override { return error_ == DeviceError::none ? "" : to_string(error_); }
  DeviceError error() const override { return error_; }
  Device& device() override { return *device_; }
  int program(int model, bool with_field) const override { return models_[static_cast<std::size_t>(model)].program[with_field ? 1 : 0]; }
  const BrickView* field() const override { return field_.view; }
  const EnergyView& energy(int model) const override { return models_[static_cast<std::size_t>(model)].view; }
  int dimensions(int model) const override { return packs_[static_cast<std::size_t>(model)].dimensions(); }
  const SwarmSettings& settings() const override { return sizes_.swarm; }
  std::size_t memory_bytes() const override {
    std::size_t bytes = 0;
    for (const EnergyPack& p : packs_) bytes += p.memory_bytes();
    return bytes;
  }

  /// Copies only; what there is to find out about the cloud, the device does.
  DeviceBytes device_bytes() const override { return bytes_; }

  bool set_cloud(const Cloud& cloud) override {
    const auto hold = device_->hold();
    if (!there(hold)) return false;
    const int n = std::min(cloud.size, sizes_.field.max_points);
    const float* from[3] = {cloud.x.data(), cloud.y.data(), cloud.z.data()};
    for (int c = 0; c < 3; ++c) std::copy_n(from[c], n, cloud_ + static_cast<std::size_t>(c) * static_cast<std::size_t>(sizes_.field.max_points));
    field_input_->points = n;
    field_built_ = false;
    best_known_ = -1;
    return true;
  }

  bool minimise(int model, std::span<const float> centres, std::span<const float> deviation, const RandomKey& key, SwarmResult& out) override {
    const auto hold = device_->hold();
    if (!there(hold)) return false;
    const int d = dimensions(model);
    swarm_frame_->key = key;
    swarm_frame_->starts = std::min(static_cast<int>(centres.size()) / d, kMostStarts);
    std::copy_n(centres.data(), swarm_frame_->starts * d, swarm_frame_->centres);
    std::copy_n(deviation.data(), d, swarm_frame_->deviation);
    answer_->done = ~key.frame;
    if (!run(program(model, !field_built_))) return false;
    field_built_ = true;
    if (answer_->done != key.frame) {  // the driver said nothing, and nothing was done
      error_ = DeviceError::lost;
      return false;
    }
    std::copy_n(answer_->best, d, best_.data());
    std::copy_n(answer_->history, history_.size(), history_.data());
    terms_ = answer_->terms;
    best_known_ = model;
    out.best = {best_.data(), static_cast<std::size_t>(d)};
    out.cost = answer_->cost;
    out.history = history_;
    return true;
  }

  bool evaluate(int model, std::span<const float> particle, ParticleTerms& out) override {
    const auto hold = device_->hold();
    if (!there(hold)) return false;
    // Nearly always the particle that was just found: its terms came with it.
    if (best_known_ == model && std::equal(particle.begin(), particle.end(), best_.begin())) {
      out = terms_;
      return true;
    }
    std::copy_n(particle.data(), dimensions(model), given_);
    if (!field_built_) {
      if (!run(field_program_)) return false;
      field_built_ = true;
    }
    if (!run(models_[static_cast<std::size_t>(model)].evaluate)) return false;
    out = answer_->terms;
    return true;
  }

 private:
  struct Model {
    EnergyView view;
    int program[2] = {0, 0}, evaluate = 0;  ///< without the field's build, with it
  };

  bool there(const gpu::ResetGate::Hold& hold) {
    if (!hold) error_ = DeviceError::lost;
    return error_ == DeviceError::none;
  }
  bool run(int program) {
    error_ = device_->run(program);
    return error_ == DeviceError::none;
  }
  void check(DeviceError e) const {
    if (e != DeviceError::none)
      throw std::runtime_error("swarm on a device: " + std::string(to_string(e)) + (device_->problem().empty() ? "" : ": " + device_->problem()));
  }
  template <class T>
  T* take(std::size_t count) {
    T* out = nullptr;
    check(allocate(*device_, std::max<std::size_t>(count, 1), out));
    bytes_.device += std::max<std::size_t>(count, 1) * sizeof(T);
    return out;
  }
  template <class T>
  T* take_pinned(std::size_t count, T*& host) {
    void *h = nullptr, *d = nullptr;
    check(device_->allocate_pinned(count * sizeof(T), h, d));
    bytes_.pinned += count * sizeof(T);
    host = static_cast<T*>(h);
    return static_cast<T*>(d);
  }
  template <class T>
  const T* copy(const std::vector<T>& from) {
    T* to = take<T>(from.size());
    check(device_->upload(to, from.data(), from.size() * sizeof(T)));
    return to;
  }

  void take_memory() {
    const auto points = static_cast<std::size_t>(sizes_.field.max_points), bricks = static_cast<std::size_t>(sizes_.field.max_bricks);
    FieldMemory& f = field_;
    f.capacity = sizes_.field.max_points, f.max_bricks = sizes_.field.max_bricks;
    f.edge = sizes_.field.cell * kBrick, f.fine = sizes_.field.fine, f.band = sizes_.field.band;
    f.input = take_pinned(1, field_input_), f.cloud = take_pinned(3 * points, cloud_);
    *field_input_ = FieldInput{};
    f.frame = take<FieldFrame>(1), f.view = take<BrickView>(1);
    f.count = take<std::int32_t>(bricks), f.start = take<std::int32_t>(2 * bricks + 1), f.across = take<std::int8_t>(bricks);
    f.used = take<std::int32_t>(1), f.key = take<std::int32_t>(points), f.rank = take<std::int32_t>(points), f.given = take<Point>(points),
    f.sorted = take<Point>(points);
    f.nearest = take<Point>(bricks), f.fine_list = take<std::int32_t>(bricks), f.fine_count = take<std::int32_t>(1);
    f.brick = take<std::int32_t>(bricks), f.cell = take<std::int32_t>(1 + bricks * (1 + kBrickCells));
    const std::vector<std::int32_t> box{kEmptyLow, kEmptyLow, kEmptyLow, kEmptyHigh, kEmptyHigh, kEmptyHigh};
    f.box = take<std::int32_t>(box.size());
    check(device_->upload(f.box, box.data(), box.size() * sizeof(std::int32_t)));

    const int n = sizes_.swarm.particles;
    const auto slots = static_cast<std::size_t>(n), blocks = static_cast<std::size_t>((n + particles_a_block_ - 1) / particles_a_block_);
    swarm_from_ = take_pinned(1, swarm_frame_);
    answer_device_ = take_pinned(1, answer_), given_device_ = take_pinned(kMostDimensions, given_);
    *swarm_frame_ = SwarmFrame{};
    SwarmState& s = state_;
    s.frame = take<SwarmFrame>(1);
    for (float** v : {&s.position, &s.velocity, &s.best}) *v = take<float>(slots * kMostDimensions);
    s.best_cost = take<float>(slots);
    for (int i = 0; i < 2; ++i)
      s.block_key[i] = take<std::uint64_t>(blocks), s.block_best[i] = take<float>(blocks * kMostDimensions), s.global[i] = take<float>(1 + kMostDimensions);
    s.history = take<float>(kMostIterations);
    check(device_->record(field_steps(TakeCloud(field_)), field_program_));
  }

  std::vector<Step> field_steps(const TakeCloud& take_cloud) const {
    const int many = 8 * device_->processors();
    return {{take_cloud, many / 4},     {CountPoints(field_), many / 4},    {StartRows(field_), many},
            {SortPoints(field_), many}, {DescribeBricks(field_), 2 * many}, {DescribeCells(field_), many}};
  }

  void take_model(const EnergyPack& pack) {
    Model model;
    EnergyView& v = model.view = pack.view();
    v.shape = copy(pack.shape()), v.weight = copy(pack.weight()), v.segment = copy(pack.segment()), v.segment_start = copy(pack.segment_start());
    v.part = copy(pack.part()), v.joint = copy(pack.joint());
    v.pose_mean = copy(pack.pose_mean()), v.pose_component = copy(pack.pose_component());
    if (particles_a_block_ == 16)
      record<Iterate16>(pack, model);
    else
      record<Iterate4>(pack, model);
    models_.push_back(model);
  }

  template <class K>
  void record(const EnergyPack& pack, Model& model) {
    K kernel;
    kernel.m = model.view, kernel.field = field_.view, kernel.state = state_;
    std::vector<std::int32_t> of_vertex(static_cast<std::size_t>(pack.vertices()));
    for (int b = 0; b < model.view.batches; ++b)
      for (std::int32_t s = pack.segment_start()[static_cast<std::size_t>(b)]; s < pack.segment_start()[static_cast<std::size_t>(b) + 1]; ++s)
        for (int i = pack.segment()[static_cast<std::size_t>(s)].begin; i < pack.segment()[static_cast<std::size_t>(s)].end; ++i)
          of_vertex[static_cast<std::size_t>(b * kBatch + i)] = s;
    kernel.vertex_segment = copy(of_vertex);
    order_parts(pack, kernel);
    kernel.particles = sizes_.swarm.particles, kernel.block_particles = particles_a_block_;
    kernel.cognitive = sizes_.swarm.cognitive, kernel.social = sizes_.swarm.social;

    TakeFrame take_frame;
    take_frame.from = swarm_from_, take_frame.to = const_cast<SwarmFrame*>(state_.frame);
    std::vector<Step> steps{{take_frame, 1}};
    const int blocks = (sizes_.swarm.particles + particles_a_block_ - 1) / particles_a_block_, n = sizes_.swarm.iterations;
    for (int i = 0; i < n; ++i) {
      kernel.iteration = i, kernel.inertia = inertia_of(i, n, sizes_.swarm.inertia_first, sizes_.swarm.inertia_last);
      steps.push_back({kernel, blocks});
    }
    // The answer is one particle: the smaller block has it sooner. What the blocks of the last iteration were is the same for both.
    Iterate4 last;
    last.m = kernel.m, last.field = kernel.field, last.vertex_segment = kernel.vertex_segment, last.state = kernel.state;
    std::copy(std::begin(kernel.level_part), std::end(kernel.level_part), last.level_part);
    std::copy(std::begin(kernel.level_start), std::end(kernel.level_start), last.level_start);
    last.particles = kernel.particles, last.block_particles = particles_a_block_;
    last.iteration = n, last.answer = answer_device_;
    steps.push_back({last, 1});
    check(device_->record(steps, model.program[0]));
    std::vector<Step> with_field =
        field_steps(TakeCloud(field_, reinterpret_cast<const Words*>(take_frame.from), reinterpret_cast<Words*>(take_frame.to), TakeFrame::kWords));
    with_field.insert(with_field.end(), steps.begin() + 1, steps.end());
    check(device_->record(with_field, model.program[1]));
    last.given = given_device_;
    const Step one{last, 1};
    check(device_->record({&one, 1}, model.evaluate));
  }

  template <class K>
  static void order_parts(const EnergyPack& pack, K& kernel) {
    int level[kParts] = {}, at = 0;
    for (int p = 1; p < kParts; ++p) level[p] = level[pack.part()[static_cast<std::size_t>(p)].parent] + 1;
    for (int l = 0; l < kLevels; ++l) {
      kernel.level_start[l] = static_cast<std::int8_t>(at);
      for (int p = 0; p < kParts; ++p)
        if (level[p] == l) kernel.level_part[at++] = static_cast<std::int8_t>(p);
    }
    kernel.level_start[kLevels] = static_cast<std::int8_t>(at);
    if (at != kParts) throw std::invalid_argument("swarm on a device: the kinematic chain is longer than its kernels");
  }

  SwarmSizes sizes_;
  std::unique_ptr<Device> device_;
  std::string name_;
  DeviceError error_ = DeviceError::none;
  int particles_a_block_ = 16;
  std::vector<EnergyPack> packs_;
  std::vector<Model> models_;
  FieldMemory field_{};
  FieldInput* field_input_ = nullptr;
  float *cloud_ = nullptr, *given_ = nullptr;
  const float* given_device_ = nullptr;
  SwarmFrame* swarm_frame_ = nullptr;
  const SwarmFrame* swarm_from_ = nullptr;
  SwarmAnswer *answer_ = nullptr, *answer_device_ = nullptr;
  SwarmState state_{};
  DeviceBytes bytes_;
  int field_program_ = 0, best_known_ = -1;
  bool field_built_ = false;
  ParticleTerms terms_{};
  std::vector<float> best_, history_;
};

/// Gives out pinned memory, which its owner writes to at the start, and addresses of nothing for the rest.
class CountingDevice final : public Device {
 public:
  const std::string& name() const override { return name_; }
  int processors() const override { return 256; }
  const std::string& problem() const override { return problem_; }
  gpu::ResetGate::Hold hold() override { return {gate_, 0}; }
  DeviceError allocate(std::size_t, void*& out) override {
    out = this;
    return DeviceError::none;
  }
  DeviceError allocate_pinned(std::size_t bytes, void*& host, void*& device) override {
    memory_.push_back(std::make_unique<std::uint64_t[]>((bytes + 7) / 8));
    host = device = memory_.back().get();
    return DeviceError::none;
  }
  DeviceError upload(void*, const void*, std::size_t) override { return DeviceError::none; }
  DeviceError record(std::span<const Step>, int& program) override {
    program = 0;
    return DeviceError::none;
  }
  DeviceError run(int) override { return DeviceError::absent; }
  DeviceError time(int, int, int, double&) override { return DeviceError::absent; }

 private:
  gpu::ResetGate gate_;
  std::string name_ = "counted", problem_;
  std::vector<std::unique_ptr<std::uint64_t[]>> memory_;
};

}  // namespace

DeviceBytes plan_device_swarm(std::span<const BodyModel* const> models, const PosePrior& prior, const SwarmSizes& sizes) {
  return Swarm(std::make_unique<CountingDevice>(), models, prior, sizes).device_bytes();
}

std::unique_ptr<DeviceSwarm> make_device_swarm(std::unique_ptr<Device> device, std::span<const BodyModel* const> models, const PosePrior& prior,
                                               const SwarmSizes& sizes) {
  return std::make_unique<Swarm>(std::move(device), models, prior, sizes);
}

}  // namespace booth::fit::device
