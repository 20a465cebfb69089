// boothctl security: the fleet's authorities, and what each participant proves itself with.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "daemon/config/load.hpp"
#include "daemon/ctl/network_options.hpp"
#include "daemon/ctl/print_json.hpp"
#include "daemon/ctl/security_report.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/security/fleet_folder.hpp"

namespace booth::daemon {
namespace {

/// What the library refuses becomes the verb's failure.
template <class F>
auto trying(F work) {
  try {
    return work();
  } catch (const std::exception& e) {
    throw VerbFailure(std::string("security: ") + e.what());
  }
}

void add_init(CLI::App& security) {
  struct Options {
    std::string folder, fleet = "booths";
    std::int64_t days = kAuthorityDays;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* verb = security.add_subcommand("init", "Make a fleet: an authority for identities, one for permissions, and the rules of the domain");
  verb->add_option("folder", options->folder, "A new folder; keep it off the booths")->required();
  verb->add_option("--fleet", options->fleet, "Name in the authorities' certificates")->capture_default_str();
  verb->add_option("--days", options->days, "How long the authorities serve")->capture_default_str();
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] {
    trying([&] { make_fleet(options->folder, options->fleet, options->days, utc_seconds()); });
    if (options->json)
      print_json({{"folder", options->folder}, {"fleet", options->fleet}, {"days", options->days}});
    else
      std::cout << fmt::format(
          "{} is the fleet \"{}\". Its two *_ca.key.pem are the fleet: keep a copy where nobody finds it, and the folder off the booths.\n", options->folder,
          options->fleet);
  });
}

void add_issue(CLI::App& security) {
  struct Options {
    std::string folder, role;
    IssueOrder order;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* verb = security.add_subcommand("issue", "Issue credentials to a booth, a viewer (hears) or a console (hears and commands)");
  verb->add_option("folder", options->folder, "The fleet's folder")->required();
  verb->add_option("role", options->role, "booth, viewer or console")->required()->check(CLI::IsMember({"booth", "viewer", "console"}));
  verb->add_option("name", options->order.name, "Of a booth its booth.id; of others any name")->required();
  verb->add_option("--booths", options->order.booths, "Booths that a viewer or console may hear (and command), or '*'")->delimiter(',');
  verb->add_option("--days", options->order.days, "How long they serve")->capture_default_str();
  verb->add_flag("--renew", options->order.renew, "Replace what was issued under this name");
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] {
    const auto place = trying([&] {
      options->order.role = role_of(options->role).value_or(Role::viewer);
      return issue(options->folder, options->order, utc_seconds());
    });
    const auto until = trying([&] { return read_credentials(place).first_to_expire().valid.until; });
    if (options->json)
      print_json({{"folder", place.string()}, {"name", identity_name(options->order.role, options->order.name)}, {"until", utc_text(until)}});
    else
      std::cout << fmt::format("{}  until {}\n", place.string(), utc_day(until));
  });
}

void add_revoke(CLI::App& security) {
  struct Options {
    std::string folder;
    std::vector<std::string> serials;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* verb =
      security.add_subcommand("revoke", "Take certificates back before they expire: adds them to crl.pem, which every participant has to be given");
  verb->add_option("folder", options->folder, "The fleet's folder")->required();
  verb->add_option("serial", options->serials, "Serial numbers, as `boothctl security show` prints them")->required()->check([](const std::string& text) {
    const bool good = !text.empty() && text.size() <= 40 && text.find_first_not_of("0123456789ABCDEFabcdef") == std::string::npos;
    return good ? std::string() : text + " is not a serial number (hexadecimal)";
  });
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] {
    trying([&] { revoke(options->folder, options->serials, utc_seconds()); });
    if (options->json) return print_json({{"ok", true}, {"file", fmt::format("{}/{}", options->folder, kRevocationsFile)}, {"revoked", options->serials}});
    std::cout << fmt::format("{}/{} is to be copied beside each participant's cert.pem; restart who was running\n", options->folder, kRevocationsFile);
  });
}

void add_show(CLI::App& security) {
  struct Options {
    std::string folder;
    NetworkOptions network;
    std::int64_t days = 30;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* verb = security.add_subcommand("show", "Who may do what, until when, and what to look after. Exit status 1 when there is something");
  verb->add_option("folder", options->folder, "A fleet's folder or a participant's; without it those that boothd would use (keys dds.*)");
  add_network_options(*verb, options->network);
  verb->add_option("--days", options->days, "Warn of what expires within so many days")->check(CLI::Range(0, 36500))->capture_default_str();
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] {
    const std::int64_t now = utc_seconds();
    const auto report = trying([&] {
      const std::string folder = options->folder.empty() ? credentials_folder(options->network) : options->folder;
      return look_at_credentials(folder, now, options->days);
    });
    std::cout << (options->json ? security_json(report, now) : security_text(report, now)) << std::flush;
    if (const int n = security_complaints(report); n > 0) throw VerbFailure(fmt::format("security: {} thing{} to look after", n, n == 1 ? "" : "s"));
  });
}

}  // namespace

void add_security_verb(CLI::App& app) {
  CLI::App* security = app.add_subcommand("security", "Credentials for DDS Security: make a fleet, issue, revoke, show");
  security->require_subcommand(1);
  add_init(*security);
  add_issue(*security);
  add_revoke(*security);
  add_show(*security);
}

}  // namespace booth::daemon
