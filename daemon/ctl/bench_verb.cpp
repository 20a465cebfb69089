// boothctl bench: the fit signature, and the measurements of booth-bench, a program of the test tree that boothctl runs where it is installed.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/ctl/bench_json.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/test_program.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/pipeline/fit_signature.hpp"
#include "fit/swarm/device/emulated_device.hpp"

namespace booth::daemon {
namespace {

void add_signature_verb(CLI::App& bench) {
  struct Options {
    int threads = 2, frames = kGoldenFrames;
    bool json = false;
    std::string backend = "cpu";
  };
  auto options = std::make_shared<Options>();
  CLI::App* verb = bench.add_subcommand("signature", "A hash over the fitted parameters of the golden frames (tests/golden/signature.txt)");
  verb->add_option("--threads", options->threads, "Worker threads; the signature does not depend on it")->check(CLI::Range(1, 64))->capture_default_str();
  verb->add_option("--frames", options->frames, "How many frames; the committed signature is that of the default")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  verb->add_flag("--json", options->json, "One JSON object");
  verb->add_option("--backend", options->backend, "cpu: preset booth; cuda: preset paper on a CUDA device; emulated: the same on the host, slowly")
      ->check(CLI::IsMember({"cpu", "cuda", "emulated"}))
      ->capture_default_str();
  verb->callback([options] {
    fit::device::Faults none;
    fit::DeviceOpen open;
    if (options->backend == "emulated") open = [&](std::string&) { return fit::device::make_emulated_device(none, 132); };
    std::string signature;
    say_step(fmt::format("fitting {} frames", options->frames));
    try {
      signature =
          options->backend == "cpu" ? golden_signature(options->threads, options->frames) : golden_device_signature(options->threads, options->frames, open);
    } catch (const std::runtime_error& e) {
      throw VerbFailure(std::string("bench ") + e.what());
    }
    if (options->json) {
      const nlohmann::ordered_json result{{"name", "golden frames"}, {"unit", ""}, {"value", options->frames}, {"signature", signature}};
      nlohmann::ordered_json j = bench_json("signature", {}, nlohmann::ordered_json::array({result}));
      j.update({{"backend", options->backend}, {"signature", signature}, {"frames", options->frames}, {"threads", options->threads}});
      std::cout << j.dump() << "\n";
    } else {
      std::cout << signature << "\n";
    }
  });
}

}  // namespace

void add_bench_verb(CLI::App& app) {
  CLI::App* bench = app.add_subcommand("bench", "Measurements that need no booth");
  bench->require_subcommand(1);
  add_signature_verb(*bench);
  struct Task {
    const char *name, *what;
  };
  for (const Task task :
       {Task{"dds", "Publish to take of a skeleton between two processes, against ddsperf's ping of the same size"},
        Task{"decode", "Kinect v2 depth decoder, each kernel against the scalar reference; with --backend cuda on a CUDA device"},
        Task{"track", "Preset booth: a tracked frame and a first estimate on one core, and their errors"},
        Task{"fit", "Presets booth and paper against pagmo, nlopt and Ceres: error against time; with --backend cuda as task gpu"},
        Task{"pipeline", "Four cameras from memory through the live pipeline to DDS: latency by stage, losses"},
        Task{"field", "Nearest points: our field against kd-trees and brute force"}, Task{"swarm", "Preset paper: frames per second by kernel and threads"},
        Task{"record", "Depth images packed for recordings: frames per second on one core, size, and what it costs a camera's thread"},
        Task{"gpu", "Preset paper's swarm on a CUDA device: times by kernel and size, its bits, error against budget"}}) {
    CLI::App* verb = bench->add_subcommand(task.name, task.what);
    verb->prefix_command();
    verb->set_help_flag();  // booth-bench knows the options
    verb->callback([verb, task] {
      const std::vector<std::string> words = verb->remaining();
      // A fit on a device is measured by a task of its own, with a device's clock.
      const bool on_device = std::any_of(words.begin(), words.end(), [](const std::string& w) { return w.rfind("--backend", 0) == 0; });
      std::vector<std::string> arguments{task.name == std::string_view("fit") && on_device ? "gpu" : task.name};
      for (const std::string& word : words) arguments.push_back(word);
      become_test_program(std::string("bench ") + task.name, "booth-bench", arguments);
    });
  }
}

}  // namespace booth::daemon
