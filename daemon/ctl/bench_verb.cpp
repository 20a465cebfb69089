// boothctl bench: what can be measured or proved without a booth. So far: the fit signature.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/ctl/verbs.hpp"
#include "daemon/pipeline/fit_signature.hpp"

namespace booth::daemon {

void add_bench_verb(CLI::App& app) {
  struct Options {
    int threads = 2, frames = kGoldenFrames;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* bench = app.add_subcommand("bench", "Measurements that need no booth");
  bench->require_subcommand(1);
  CLI::App* verb = bench->add_subcommand("signature", "A hash over the fitted parameters of the golden frames (tests/golden/signature.txt)");
  verb->add_option("--threads", options->threads, "Worker threads; the signature does not depend on it")->check(CLI::Range(1, 64))->capture_default_str();
  verb->add_option("--frames", options->frames, "How many frames; the committed signature is that of the default")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] {
    const std::string signature = golden_signature(options->threads, options->frames);
    if (options->json) {
      std::cout
          << nlohmann::ordered_json{{"benchmark", "signature"}, {"signature", signature}, {"frames", options->frames}, {"threads", options->threads}}.dump()
          << "\n";
    } else {
      std::cout << signature << "\n";
    }
  });
}

}  // namespace booth::daemon
