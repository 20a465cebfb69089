// boothctl export: any session in any of the formats, one or several, without boothd.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/ctl/find_session.hpp"
#include "daemon/ctl/print_json.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/io/model_file.hpp"
#include "daemon/record/session_export.hpp"
#include "daemon/seal/sealed_file.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string session, out, config, directory, models, key;
  std::vector<std::string> formats;
  bool json = false;
};

const std::map<std::string, std::pair<ExportFormat, const char*>>& formats() {
  static const std::map<std::string, std::pair<ExportFormat, const char*>> table{{"bvh", {ExportFormat::bvh, ".bvh"}},
                                                                                 {"glb", {ExportFormat::glb, ".glb"}},
                                                                                 {"fbx", {ExportFormat::fbx, ".fbx"}},
                                                                                 {"csv", {ExportFormat::csv, ".csv"}},
                                                                                 {"ply", {ExportFormat::ply, ".ply"}}};
  return table;
}

SessionModels read_models(const fs::path& directory) {
  SessionModels models;
  models.men = std::make_shared<const fit::BodyModel>(load_body_model(directory / "men.npz"));
  models.women = std::make_shared<const fit::BodyModel>(load_body_model(directory / "women.npz"));
  return models;
}

void run(const Options& options) {
  const fs::path folder = find_session(options.session, options.directory, options.config);
  const auto seal = is_sealed(folder) ? open_seal(folder, find_private_key(options.key)) : nullptr;
  std::error_code ignored;
  const bool into_folder = options.out.empty() || fs::is_directory(options.out, ignored);
  if (options.formats.size() > 1 && !into_folder)
    throw std::runtime_error("--out " + options.out + " is no folder, and several formats are several files: name a folder that is there, or one format");
  say_step("exporting " + folder.string());
  const bool with_body = std::any_of(options.formats.begin(), options.formats.end(), [](const auto& name) { return name != "csv"; });
  const fs::path directory = find_models(options.models);
  const SessionModels models = with_body ? read_models(directory) : SessionModels{};
  for (const auto& name : options.formats) {
    const auto& [format, extension] = formats().at(name);
    const fs::path out = into_folder ? fs::path(options.out) / (folder.filename().string() + extension) : fs::path(options.out);
    const std::string warning = export_session(folder, format, out, models, seal.get());
    if (!warning.empty()) std::cerr << "warning: " << warning << "\n";
    if (options.json)
      print_json({{"ok", true}, {"file", out.string()}, {"format", name}, {"session", folder.string()}, {"warning", warning}});
    else
      std::cout << out.string() << "\n";
  }
}

}  // namespace

void add_export_verbs(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("export", "Convert a session, complete or interrupted, for other programs");
  verb->add_option("session", options->session, "The session's id or its folder")->required();
  std::vector<std::string> names;
  for (const auto& [name, unused] : formats()) names.push_back(name);
  verb->add_option("--format", options->formats,
                   "bvh, glb, fbx (skeleton and motion; the last two with the body), csv (all frames), ply (the body in its last pose); several as A,B")
      ->required()
      ->delimiter(',')
      ->check(CLI::IsMember(names));
  verb->add_option("--out", options->out, "File, or folder for SESSION.FORMAT; without it SESSION.FORMAT here");
  verb->add_option("--sessions", options->directory, "Folder of the sessions; without it the configuration's session.directory");
  verb->add_option("--config", options->config, "Configuration file that says where sessions are");
  verb->add_option("--key", options->key, "Private key, where the session is sealed; without it $CREDENTIALS_DIRECTORY/boothd-private-key");
  verb->add_option("--models", options->models, "Folder of the model files");
  verb->add_flag("--json", options->json, "One JSON object for each file instead of its path");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon
