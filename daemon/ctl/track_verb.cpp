// boothctl track: a recording in, skeletons and a body out, in the order of time and with nothing dropped.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "daemon/config/config.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/seed_option.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/drivers_factory.hpp"
#include "daemon/io/fit_picture.hpp"
#include "daemon/io/png_image.hpp"
#include "daemon/pipeline/coverage.hpp"
#include "daemon/pipeline/fit_setup.hpp"
#include "daemon/pipeline/latency_histogram.hpp"
#include "daemon/pipeline/offline_run.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/record/session_files.hpp"
#include "fit/detail/detail_layer.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

struct Options {
  Config config;
  std::string recording, out;
  int pictures = 0, rotate = 0;
  bool json = false, detail = false, as_live = false;
};

/// Looks at frames that were fitted before, for the pictures.
class NoFit final : public FrameFitter {
 public:
  void reset() override {}
  void step(const FitInput&, FrameRecord&) override {}
  const char* remark() const override { return ""; }
  std::vector<MemoryItem> memory_plan() const override { return {}; }
};

/// Averages a detail layer over the frames in which a person with a settled body was followed.
class DetailAverage {
 public:
  void add(const EstimatorFitter& fitter) {
    const fit::FitResult& result = fitter.result();
    if (result.state != fit::FitState::tracked || !result.body_accepted || fitter.observation().crowded) return;
    const fit::BodyModel& model = fitter.estimator().model();
    if (model_ != &model) layer_.emplace(model, fit::DetailSettings{.sigma = 0.006, .points = kPoints}), model_ = &model;
    layer_->add(fitter.observation(), result.beta, result.q);
  }
  std::vector<double> offsets() const {
    return layer_ ? std::vector<double>(layer_->offsets().data(), layer_->offsets().data() + layer_->offsets().size()) : std::vector<double>();
  }
  int moments() const { return layer_ ? layer_->moments() : 0; }

 private:
  static constexpr int kPoints = 8000;  // of a frame; the next ones bring others
  const fit::BodyModel* model_ = nullptr;
  std::optional<fit::DetailLayer> layer_;
};

/// A second pass over the recording: the first camera's image of evenly chosen frames with what was fitted to it.
int draw_pictures(const Options& options, const fs::path& folder, const std::vector<FrameRecord>& frames, const SessionModels& models) {
  std::vector<std::uint64_t> seen, chosen;
  for (const FrameRecord& f : frames) {
    if (f.person != PersonState::lost) seen.push_back(f.sequence);
  }
  const auto wanted = std::min<std::size_t>(static_cast<std::size_t>(options.pictures), seen.size());
  for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(seen[(2 * i + 1) * seen.size() / (2 * wanted)]);
  DepthSource source = open_recording_source(options.recording);
  NoFit nothing;
  std::size_t next = 0;
  run_offline(source.cameras, 1, nothing, [&](const FitInput& input, const FrameRecord& group) {
    if (next >= chosen.size() || group.sequence != chosen[next]) return next < chosen.size();
    ++next;
    const FrameRecord& fitted = frames[group.sequence];
    const fit::BodyModel* model = models.of(fitted.sex);
    for (std::size_t cam = 0; cam < source.cameras.size(); ++cam) {
      if (!input.frames[cam] || !model) continue;
      fit::Vertices posed;
      model->posed(Eigen::Map<const Eigen::VectorXd>(fitted.beta.data(), fitted.shape_count), Eigen::Map<const fit::PoseVector>(fitted.q.data()), posed);
      fit::Points3 joints;
      for (std::size_t j = 0; j < kRecordJoints; ++j)
        joints.col(static_cast<Eigen::Index>(j)) = fit::cmu_from_booth({fitted.joints[j][0], fitted.joints[j][1], fitted.joints[j][2]});
      const std::string caption =
          fmt::format("frame {}, {}, residual {:.1f} mm", fitted.sequence, source.cameras[cam]->description().name, 1e3 * static_cast<double>(fitted.residual));
      write_png(folder / fmt::format("overlay-{:05}.png", fitted.sequence),
                draw_overlay(input.frames[cam]->depth, fit_camera(source.cameras[cam]->description()), posed, model->data().faces, &joints, caption,
                             {.rotation = options.rotate}));
      break;
    }
    return next < chosen.size();
  });
  return static_cast<int>(next);
}

void print_for_people(const SessionSummary& s, const fs::path& folder, double fit_ms) {
  std::cout << fmt::format("{} frames ({:.1f} s), person seen in {}; residual {:.1f} mm (95 %: {:.1f} mm); {:.0f} ms a frame\n", s.frames, s.seconds,
                           s.frames - s.frames_lost, 1e3 * s.residual_mean, 1e3 * s.residual_p95, fit_ms);
  if (s.truth_known)
    std::cout << fmt::format("against the truth: joints {:.1f} mm (95 %: {:.1f} mm), surface {:.1f} mm\n", 1e3 * s.joint_mean, 1e3 * s.joint_p95,
                             1e3 * s.surface_mean);
  std::cout << "results in " << folder.string() << "\n";
}

/// The groups that were fitted live, and a word on whether the same came out.
void replay(const Options& options, DepthSource& source, FrameFitter& fitter, const std::function<bool(const FitInput&, const FrameRecord&)>& take) {
  if (source.live_groups.empty())
    throw VerbFailure(
        fmt::format("{}: does not say what the live booth did with its frames; --as-live is for recordings of boothctl record --depth", options.recording));
  const ReplayCounters c =
      run_replay(source.cameras, source.live_groups, source.to_live, fitter, [&](const FitInput& input, const FrameRecord& record) { take(input, record); });
  if (c.groups == 0)
    throw VerbFailure(
        fmt::format("{}: no session begins in it, so that nothing can be fitted as it was live; without --as-live it can be tracked", options.recording));
  std::cerr << fmt::format("{} of {} frames have the very bits of the live ones{}\n", c.identical, c.groups,
                           c.skipped > 0 ? fmt::format("; {} were left out, because what led to them is not in the recording", c.skipped) : "");
}

void run(const Options& options) {
  DepthSource source = open_recording_source(options.recording);
  if (static_cast<int>(source.cameras.size()) > kMaxCameras)
    throw VerbFailure(fmt::format("{} has {} cameras; at most {} work together", options.recording, source.cameras.size(), kMaxCameras));
  FitSetup setup = make_fit_setup(options.config, source.cameras, source.background);
  const fs::path folder =
      options.out.empty() ? fs::path(fs::path(options.recording + "/").parent_path().filename().string() + "-track") : fs::path(options.out);
  fs::create_directories(folder);

  std::vector<FrameRecord> frames;
  const auto histograms = std::make_unique<std::array<LatencyHistogram, kStages>>();
  std::string remark;
  DetailAverage detail;
  ProgressLine line;
  const auto take = [&](const FitInput&, const FrameRecord& record) {
    frames.push_back(record);
    if (options.detail) detail.add(*setup.fitter);
    for (const Stage s : {Stage::cloud, Stage::fit})
      (*histograms)[static_cast<std::size_t>(s)].add(hal::Nanoseconds(record.stage_ns[static_cast<std::size_t>(s)]));
    if (record.person == PersonState::lost && remark != setup.fitter->remark()) remark = setup.fitter->remark();
    line.show(fmt::format("frame {:5}  {:<9}  residual {:5.1f} mm", record.sequence, record.person == PersonState::lost ? "lost" : "tracked",
                          1e3 * static_cast<double>(record.residual)));
    return true;
  };
  OfflineCounters counters;
  if (options.as_live)
    replay(options, source, *setup.fitter, take);
  else
    counters = run_offline(source.cameras, 1, *setup.fitter, take);
  line.clear();
  for (const auto& camera : source.cameras) {
    const hal::CameraCounters c = camera->counters();
    if (c.corrupt > 0 || c.dropped > 0)
      std::cerr << fmt::format("warning: camera {}: {} frames missing, {} unreadable\n", camera->description().name, c.dropped, c.corrupt);
  }
  if (frames.empty()) throw VerbFailure(fmt::format("{}: there is no frame in it", options.recording));

  SessionInfo info;
  info.id = folder.filename().string();
  info.booth = options.config.booth.id;
  info.software = "boothctl " BOOTHD_VERSION;
  info.source = source.name;
  info.preset = options.config.fit.preset;
  info.models = setup.versions;
  for (const auto& camera : source.cameras) info.cameras.push_back(camera->description().name);
  info.calibration = source.calibration;
  info.seed = static_cast<std::uint64_t>(options.config.fit.seed);
  info.threads = static_cast<int>(options.config.fit.threads);
  info.result = "complete";
  info.reason = "sources_ended";
  info.state_at_end = frames.back().person == PersonState::lost ? "searching" : frames.back().body_accepted ? "tracking" : "estimating";
  info.live = false;
  info.detail = detail.offsets();
  info.groups = counters.groups + counters.groups_small;
  info.frames_unmatched = counters.frames_unmatched;
  for (std::size_t s = 0; s < kStages; ++s) info.stages[s] = (*histograms)[s].summary();
  const SessionSummary summary = finish_session(folder, info, frames, setup.models, source.truth.get());
  if (options.pictures > 0) draw_pictures(options, folder, frames, setup.models);

  if (options.json) {
    std::cout << summary.json;
  } else {
    if (options.detail) std::cout << fmt::format("body.ply carries detail averaged over {} frames\n", detail.moments());
    print_for_people(summary, folder, info.stages[static_cast<std::size_t>(Stage::cloud)].mean_ms + info.stages[static_cast<std::size_t>(Stage::fit)].mean_ms);
  }
  if (summary.partial) std::cerr << "warning: " << partial_coverage_sentence(summary.coverage) << "\n";
  if (summary.frames_lost == summary.frames) std::cerr << "warning: nobody was found in any frame" << (remark.empty() ? "" : ": " + remark) << "\n";
}

}  // namespace

void add_track_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("track", "Fit every frame of a recording: skeleton.csv, skeleton.bvh, body.ply, session.json");
  auto& fit = options->config.fit;
  verb->add_option("recording", options->recording, "A rosbag2 folder, or a folder of depth images with calibration.toml")->required();
  verb->add_option("--out", options->out, "Folder of the results; without it NAME-track here");
  verb->add_option("--model", fit.sex, "Which body model")->check(CLI::IsMember({"auto", "men", "women"}))->capture_default_str();
  verb->add_option("--preset", fit.preset, "Which estimator")->check(CLI::IsMember({"booth", "paper"}))->capture_default_str();
  verb->add_option("--models", options->config.models.directory, "Folder of the model files");
  as_seed(verb->add_option("--seed", fit.seed, "Seed of the random numbers"));
  verb->add_option("--threads", fit.threads, "Worker threads; the result does not depend on it")->check(CLI::Range(1, 64))->capture_default_str();
  verb->add_option("--stage-radius", options->config.stage.radius, "Radius of the cylinder in which a person is looked for, metres")
      ->check(CLI::Range(0.5, 5.0))
      ->capture_default_str();
  verb->add_option("--pictures", options->pictures, "Draw so many depth images with the fit over them")->check(CLI::Range(0, 1000));
  verb->add_option("--rotate", options->rotate, "Turn the pictures clockwise, for a camera that lies on its side")->check(CLI::IsMember({0, 90, 180, 270}));
  verb->add_flag("--detail", options->detail, "body.ply with folds, hair, shoes and clothes, averaged over the frames");
  verb->add_flag("--as-live", options->as_live, "Fit the very groups of frames that boothd fitted when it made the recording, and compare");
  verb->add_flag("--json", options->json, "Print session.json");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon
