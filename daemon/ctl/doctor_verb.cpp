// boothctl doctor: what is wrong with this machine and what to do about it; needs no daemon and no privileges.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/config/load.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/drivers_factory.gpio.hpp"
#include "daemon/drivers_factory.usb.hpp"
#include "daemon/health/checks.hpp"

namespace booth::daemon {
namespace {

struct Options {
  std::string config, root = "/";
  std::vector<std::string> assignments;
  bool json = false;
};

using Json = nlohmann::ordered_json;

DoctorInputs look(const Options& options) {
  DoctorInputs in;
  in.root = options.root;
  in.is_sensor = is_sensor;
  try {
    ConfigSources sources;
    sources.file = options.config;
    sources.assignments = options.assignments;
    in.config = load_config(sources);
    in.serials = configured_serials(in.config);
  } catch (const std::exception& e) {
    in.config_problem = e.what();
  }
  in.usbfs_bytes_per_sensor = usbfs_bytes(in.config);
  in.usb = open_usb_topology(in.root)->read();
  if (in.root == "/") in.gpio = list_gpio_chips();
  return in;
}

Json topology_json(const hal::UsbTopology& usb) {
  Json out = Json::array();
  for (const auto& c : usb.controllers) {
    Json j{{"id", c.id}, {"vendor", c.vendor_name}, {"vendor_id", c.vendor}, {"device_id", c.device}, {"driver", c.driver}, {"may_rebind", c.may_rebind}};
    j["buses"] = Json::array();
    for (const auto& b : c.buses)
      j["buses"].push_back({{"number", b.number}, {"megabits_per_second", megabits(b.speed)}, {"ports", b.ports}, {"reserved_bytes_per_second", b.reserved}});
    j["links"] = Json::array();
    for (const auto& l : c.links)
      j["links"].push_back({{"address", l.address}, {"width", l.width}, {"gigatransfers_per_second", l.gigatransfers}, {"bytes_per_second", l.capacity()}});
    j["sensors"] = Json::array();
    for (const auto& d : usb.devices)
      if (d.controller == c.id && is_sensor(d))
        j["sensors"].push_back({{"serial", d.serial}, {"port", d.path}, {"bus", d.bus}, {"megabits_per_second", megabits(d.speed)}});
    out.push_back(std::move(j));
  }
  return out;
}

void print(const Checks& checks) {
  std::string group;
  for (const Check& c : checks) {
    if (c.group != group) std::cout << c.group << "\n";
    group = c.group;
    std::cout << fmt::format("  {:<8} {}: {}\n", to_string(c.result), c.name, c.seen);
    if (!c.advice.empty()) std::cout << fmt::format("           -> {}\n", c.advice);
  }
}

void run(const Options& options) {
  say_step("examining this machine");
  const DoctorInputs in = look(options);
  const Checks checks = run_checks(in);
  int errors = 0, warnings = 0;
  for (const Check& c : checks) {
    errors += c.result == CheckResult::error;
    warnings += c.result == CheckResult::warning;
  }
  if (options.json) {
    Json j{{"ok", errors == 0}, {"errors", errors}, {"warnings", warnings}};
    j["checks"] = Json::array();
    for (const Check& c : checks)
      j["checks"].push_back({{"group", c.group}, {"name", c.name}, {"result", to_string(c.result)}, {"seen", c.seen}, {"advice", c.advice}});
    j["usb_controllers"] = topology_json(in.usb);
    std::cout << j.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  } else {
    print(checks);
    std::cout << fmt::format("{} error{}, {} warning{}\n", errors, errors == 1 ? "" : "s", warnings, warnings == 1 ? "" : "s");
  }
  std::cout.flush();
  if (errors > 0) throw VerbFailure(fmt::format("doctor found {} error{}", errors, errors == 1 ? "" : "s"));
}

}  // namespace

void add_doctor_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand(
      "doctor", "Examine this machine: USB controllers, sensors, clock, disk, DDS, buttons and light. Exit status 1 when an error was found");
  verb->add_option("--config", options->config, "Configuration file; without it /etc/boothd/boothd.toml where it exists");
  verb->add_option("--set", options->assignments, "key=value, over the file's; may be given several times")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  verb->add_option("--root", options->root, "Folder that stands for / when /sys, /dev and udev's rules are looked at");
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon
