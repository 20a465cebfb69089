// Options of `boothctl simulate`, and the loop that brings the cameras' frames in order of time into the recording.
#include "daemon/ctl/simulate_verb.hpp"
#include "daemon/ctl/seed_option.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/seed_option.hpp"
#include "daemon/simulation.hpp"

namespace booth::daemon {
namespace {

struct Options {
  SimulationRequest request;
  bool json = false;
};

void run(const Options& options) {
  Simulation simulation = open_simulation(options.request);
  auto& source = simulation.source;
  // A simulated day has no date; this one makes the same request give the same bytes.
  const hal::UtcTime epoch(std::chrono::seconds(1'767'225'600));
  std::vector<hal::DepthFrame> next(source.cameras.size());
  std::vector<bool> waiting(source.cameras.size());
  for (auto& camera : source.cameras) camera->start();
  const auto fill = [&](std::size_t i) { waiting[i] = source.cameras[i]->read(next[i], std::chrono::seconds(10)) == hal::ReadStatus::frame; };
  for (std::size_t i = 0; i < next.size(); ++i) fill(i);

  std::uint64_t frames = 0;
  hal::MonotonicTime begin{}, last{};
  ProgressLine line;
  while (true) {
    std::size_t first = next.size();
    for (std::size_t i = 0; i < next.size(); ++i)
      if (waiting[i] && (first == next.size() || next[i].captured < next[first].captured)) first = i;
    if (first == next.size()) break;
    const auto captured = next[first].captured;
    const auto utc = epoch + captured.time_since_epoch();
    simulation.sink->write(next[first], utc);
    // The truth at every camera's own instants; once where two coincide.
    if (source.truth && captured != last)
      if (const auto truth = source.truth->at(captured)) simulation.sink->write_truth(utc, *truth);
    if (frames++ == 0) begin = captured;
    last = captured;
    if (frames % 20 == 0) line.show(fmt::format("simulating {:5.1f} of {:.1f} s", hal::seconds(captured - begin), simulation.seconds));
    fill(first);
  }
  simulation.sink->close();
  line.clear();
  if (options.json) {
    std::cout << nlohmann::json{{"recording", options.request.out.string()},
                                {"layout", options.request.layout},
                                {"cameras", next.size()},
                                {"frames", frames},
                                {"seconds", simulation.seconds},
                                {"body", options.request.body},
                                {"motion", options.request.motion},
                                {"noise", options.request.noise},
                                {"seed", options.request.seed}}
                     .dump(2)
              << "\n";
  } else {
    std::cout << fmt::format("{}: {:.1f} s, {} frames of {} cameras ({}), body {}, motion {}, noise {}, seed {}\n", options.request.out.string(),
                             simulation.seconds, frames, next.size(), options.request.layout, options.request.body, options.request.motion,
                             options.request.noise, options.request.seed);
  }
}

}  // namespace

void add_simulate_verb(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  auto& r = options->request;
  auto* verb = app.add_subcommand("simulate", "Make a recording from four simulated cameras, with the truth beside it");
  verb->add_option("--out", r.out, "The recording to make; must not exist")->required();
  verb->add_option("--body", r.body, "men, women or test:N (a body set aside from training)")->capture_default_str();
  verb->add_option("--beta", r.beta, "Shape coefficients B1,B2,... in standard deviations")->delimiter(',');
  verb->add_option("--motion", r.motion,
                   "A motion's name (showcase, walk, turn, wave, kick, squat, roll-hands, jump, a-pose, left-arm) or a file .npy, .amc, .bvh")
      ->capture_default_str();
  verb->add_option("--from", r.from, "Seconds to leave out at the start of a motion file");
  verb->add_option("--seconds", r.seconds, "Length; 0: as long as the motion")->capture_default_str();
  verb->add_option("--noise", r.noise, "kinect2, none or gaussian:SIGMA (metres)")->capture_default_str();
  as_seed(verb->add_option("--seed", r.seed, "The same seed gives the same recording"));
  verb->add_option("--layout", r.layout, "rosbag2 or folder")->capture_default_str();
  verb->add_flag("--keep-path", r.keep_path, "Leave the path of a motion file as it is");
  verb->add_option("--models", r.models, "Folder of men.npz, women.npz and test_bodies.npz");
  verb->add_flag("--json", options->json, "Report as JSON");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon
