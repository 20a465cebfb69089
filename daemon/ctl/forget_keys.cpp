// Known names only: a folder in a configuration may be any folder.
#include "daemon/ctl/forget_keys.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "daemon/security/credentials.hpp"
#include "daemon/security/fleet_folder.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

void add_file(const fs::path& path, std::vector<fs::path>& out) {
  std::error_code error;
  const auto status = fs::symlink_status(path, error);
  if (!error && (fs::is_regular_file(status) || fs::is_symlink(status))) out.push_back(path);
}

void add_credentials(const fs::path& folder, const std::string& prefix, std::vector<fs::path>& out) {
  if (folder.empty()) return;
  for (const char* name : {kIdentityAuthorityFile, kCertificateFile, kKeyFile, kPermissionsAuthorityFile, kGovernanceFile, kPermissionsFile, kRevocationsFile})
    add_file(folder / (prefix + name), out);
}

void add_fleet(const fs::path& folder, std::vector<fs::path>& out) {
  if (folder.empty()) return;
  add_credentials(folder, "", out);
  for (const char* name : {kIdentityAuthorityKeyFile, kPermissionsAuthorityKeyFile, "governance.xml"}) add_file(folder / name, out);
  std::error_code error;
  for (fs::directory_iterator it(folder / kIssuedFolder, error), end; !error && it != end; it.increment(error))
    if (it->is_directory(error) && !it->is_symlink(error)) add_credentials(it->path(), "", out);  // boothd may write here, root follows no link of its
}

void add_calibration(const fs::path& file, std::vector<fs::path>& out) {
  if (file.empty()) return;
  add_file(file, out);
  const std::string stem = file.stem().string() + ".before-";
  std::error_code error;
  for (fs::directory_iterator it(file.has_parent_path() ? file.parent_path() : fs::path("."), error), end; !error && it != end; it.increment(error))
    if (const std::string name = it->path().filename().string(); name.starts_with(stem) && name.ends_with(".toml")) add_file(it->path(), out);
}

}  // namespace

std::vector<fs::path> key_files(const Config& config, const fs::path& file) {
  std::vector<fs::path> out;
  add_calibration(config.cameras.kinect2.calibration, out);
  add_credentials(config.dds.credentials, "", out);
  add_credentials(file.parent_path() / "credentials", "", out);
  add_fleet(config.dds.self_issued, out);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

void forget(const fs::path& path) {
  std::error_code error;
  if (!fs::remove(path, error) && error) throw std::runtime_error(fmt::format("{} cannot be deleted: {}", path.string(), error.message()));
}

std::string forget_empty_fleet(const Config& config) {
  const fs::path fleet = config.dds.self_issued;
  std::error_code error;
  if (fleet.empty() || !fs::is_directory(fleet, error)) return "";
  // fs::remove() deletes a folder only when nothing is in it.
  std::vector<fs::path> folders;
  for (fs::directory_iterator it(fleet / kIssuedFolder, error), end; !error && it != end; it.increment(error))
    if (it->is_directory(error) && !it->is_symlink(error)) folders.push_back(it->path());
  folders.push_back(fleet / kIssuedFolder);
  for (const auto& folder : folders) {
    error.clear();
    (void)fs::remove(folder, error);
  }
  error.clear();
  if (fs::is_empty(fleet, error) && !error) return "";
  return fmt::format("{} holds other files, and boothd makes credentials of its own only in an empty folder: move them away", fleet.string());
}

}  // namespace booth::daemon
