// File by file, each whole or not there.
#include "daemon/record/decrypt.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "daemon/io/atomic_file.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/seal/sealed_file.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> sealed_names(const fs::path& folder) {
  std::vector<std::string> out;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(kSealedEnding) && entry.is_regular_file()) out.push_back(name.substr(0, name.size() - std::strlen(kSealedEnding)));
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Empty when the file is whole and written.
std::string decrypt_file(const fs::path& folder, const std::string& name, const Seal& seal, const fs::path& out) {
  SealedReader in(folder, name, seal);
  AtomicFile file(out / name, 0600);
  for (std::string chunk; in.next(chunk);) file.write(chunk);
  if (in.end() == SealEnd::complete) file.commit();
  return in.complaint();
}

void list_files(const fs::path& folder, std::vector<std::string>& files) {
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path().filename().string());
  std::sort(files.begin(), files.end());
}

}  // namespace

Decrypted decrypt_session(const fs::path& folder, const PrivateKey& key, const fs::path& out, const std::function<SessionModels()>& models) {
  const auto seal = open_seal(folder, key);
  const std::vector<std::string> names = sealed_names(folder);
  if (names.empty()) throw std::runtime_error(fmt::format("{}: holds nothing that is sealed but its key", folder.string()));
  if (::mkdir(out.c_str(), 0700) != 0)
    throw std::runtime_error(fmt::format("{}: cannot be made: {}; name another folder with --out", out.string(), std::strerror(errno)));
  Decrypted done;
  if (std::find(names.begin(), names.end(), kSealedFrameLogName) != names.end()) {
    std::string complaint;
    finish_sealed_log(folder, *seal, models(), out, complaint);
    if (!complaint.empty()) done.complaints.push_back(complaint);
  } else {
    for (const std::string& name : names)
      if (std::string complaint = decrypt_file(folder, name, *seal, out); !complaint.empty()) done.complaints.push_back(std::move(complaint));
  }
  list_files(out, done.files);
  return done;
}

}  // namespace booth::daemon
