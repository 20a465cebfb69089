// boothctl decrypt and key: what the holder of the private key does, on whatever machine.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>

#include "daemon/ctl/find_session.hpp"
#include "daemon/ctl/print_json.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/drivers_factory.recorder.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/io/model_file.hpp"
#include "daemon/record/decrypt.hpp"
#include "daemon/seal/sealed_file.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostKeyFile = 4096;

struct Options {
  std::string what, out, config, directory, models, key;
  bool json = false;
};

struct KeyOptions {
  std::string name;
  bool json = false;
};

SessionModels load_models(const std::string& named) {
  const fs::path directory = find_models(named);
  return {std::make_shared<const fit::BodyModel>(load_body_model(directory / "men.npz")),
          std::make_shared<const fit::BodyModel>(load_body_model(directory / "women.npz"))};
}

/// Makes a bag; complaints are said, and the bag holds what came before the damage.
std::vector<std::string> decrypt_recording(const fs::path& folder, const PrivateKey& key, const fs::path& out) {
  const auto seal = open_seal(folder, key);
  SealedReader in(folder, kSealedRecordingName, *seal);
  std::vector<std::string> complaints;
  const std::string torn = unpack_recording([&](std::string& piece) { return in.next(piece); }, (folder / kSealedRecordingName).string() + kSealedEnding, out);
  if (!in.complaint().empty()) complaints.push_back(in.complaint());
  if (!torn.empty() && complaints.empty()) complaints.push_back(torn);
  if (!complaints.empty()) std::ofstream(out / "interrupted.txt") << complaints.front() << "\n";
  return complaints;
}

void decrypt(const Options& options) {
  const fs::path folder = find_session(options.what, options.directory, options.config);
  if (!is_sealed(folder)) throw VerbFailure(fmt::format("{}: is not sealed; it can be read as it is", folder.string()));
  const PrivateKey key = find_private_key(options.key);
  const fs::path out = options.out.empty() ? fs::path(folder.filename().string() + "-open") : fs::path(options.out);
  std::vector<std::string> complaints;
  say_step("opening " + folder.string());
  if (is_sealed_recording(folder))
    complaints = decrypt_recording(folder, key, out);
  else
    complaints = decrypt_session(folder, key, out, [&] { return load_models(options.models); }).complaints;
  if (options.json)
    print_json({{"ok", complaints.empty()}, {"folder", out.string()}, {"complaints", complaints}});
  else
    std::cout << out.string() << "\n";
  if (complaints.empty()) return;
  for (std::size_t i = 0; i + 1 < complaints.size(); ++i) std::cerr << "boothctl: " << complaints[i] << "\n";
  throw VerbFailure(complaints.back());
}

void new_key(const KeyOptions& options) {
  const std::string& base = options.name;
  const PrivateKey key = write_new_keys(base);
  if (options.json) return print_json({{"ok", true}, {"key", key.public_half.id()}, {"private", base + ".private"}, {"public", base + ".public"}});
  std::cout << fmt::format("key {}\n{}.private  opens; keep it away from the booth, and keep a copy\n{}.public   goes to the booth; privacy.seal_to names it\n",
                           key.public_half.id(), base, base);
}

void show_key(const KeyOptions& options) {
  const std::string& file = options.name;
  std::error_code ignored;
  if (fs::is_directory(file, ignored)) {
    const std::string to = Seal::recipient_of(read_file_bytes(fs::path(file) / kSealKeyName, kMostKeyFile));
    if (to.empty()) throw VerbFailure(fmt::format("{}/{}: is no key of a sealed folder, or it is damaged", file, kSealKeyName));
    if (options.json) return print_json({{"ok", true}, {"folder", file}, {"sealed_to", to}});
    std::cout << fmt::format("{}  sealed to key {}\n", file, to);
    return;
  }
  const std::string text = read_file_bytes(file, kMostKeyFile);
  const bool secret = text.find("\nboothd-private-1 ") != std::string::npos || text.starts_with("boothd-private-1 ");
  const char* half = secret ? "private" : "public";
  const std::string id = secret ? read_private_key(file).public_half.id() : parse_public_key(text, file).id();
  if (options.json) return print_json({{"ok", true}, {"file", file}, {"half", half}, {"key", id}});
  std::cout << fmt::format("{}  {} half of key {}\n", file, half, id);
}

}  // namespace

void add_decrypt_verbs(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("decrypt", "Open a sealed session or recording with its private key");
  verb->add_option("what", options->what, "The session's id, or the folder of a session or recording")->required();
  verb->add_option("--out", options->out, "Folder to make; without it NAME-open here");
  verb->add_option("--key", options->key, "Private key; without it $CREDENTIALS_DIRECTORY/boothd-private-key");
  verb->add_option("--sessions", options->directory, "Folder of the sessions; without it the configuration's session.directory");
  verb->add_option("--config", options->config, "Configuration file that says where sessions are");
  verb->add_option("--models", options->models, "Folder of the model files, with which interrupted sessions are finished");
  verb->add_flag("--json", options->json, "One JSON object instead of the path");
  verb->callback([options] { decrypt(*options); });

  CLI::App* key = app.add_subcommand("key", "Keys to which sessions and recordings are sealed");
  key->require_subcommand(1);
  auto asked = std::make_shared<KeyOptions>();
  CLI::App* make = key->add_subcommand("new", "Make a pair: NAME.private opens, NAME.public is for the booth");
  make->add_option("name", asked->name, "Path without ending")->required();
  make->add_flag("--json", asked->json, "One JSON object");
  make->callback([asked] { new_key(*asked); });
  CLI::App* show = key->add_subcommand("show", "Say which key a file holds, or a folder is sealed to");
  show->add_option("file", asked->name, "A key file or a sealed folder")->required();
  show->add_flag("--json", asked->json, "One JSON object");
  show->callback([asked] { show_key(*asked); });
}

}  // namespace booth::daemon
