// boothctl metrics: the status for Prometheus, on stdout or as a file for node_exporter's textfile collector.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "daemon/ctl/care_verbs.hpp"
#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/metrics_text.hpp"
#include "daemon/io/atomic_file.hpp"

namespace booth::daemon {
namespace {

struct Options {
  std::string socket, out;
};

/// Null where boothd does not answer: that is a metric, too, and no reason to leave an old file in place.
StatusJson status_of(const Options& options) {
  try {
    ControlClient client(control_socket_path(options.socket));
    return StatusJson::parse(client.ask(R"({"request":"status"})"), nullptr, false);
  } catch (const std::exception& e) {
    std::cerr << "boothctl: " << e.what() << "\n";
    return nullptr;
  }
}

void run(const Options& options) {
  const std::string text = metrics_text(status_of(options));
  if (options.out.empty())
    std::cout << text << std::flush;
  else
    write_file_atomically(std::filesystem::path(options.out), text);
}

}  // namespace

void add_metrics_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb =
      app.add_subcommand("metrics", "The status as numbers in Prometheus' text format; `boothd_up 0`, and exit status 0, where boothd does not answer");
  verb->add_option("--socket", options->socket, "Control socket of boothd; without it the configuration's");
  verb->add_option("--out", options->out, "File to replace in one step, such as /var/lib/prometheus/node-exporter/boothd.prom; without it stdout");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon
