// A booth to be maltreated: boothd in a folder of its own, and a book of what it has acknowledged.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "tests/faults/unit.hpp"

namespace booth::tests {

/// What boothd has said that it has; whoever asked may rely on it, whatever happens afterwards.
class Ledger {
 public:
  /// The session's end was acknowledged: none of its files may ever change.
  void complete(const std::filesystem::path& folder);
  /// The session ran, with so many frames published, when it was struck.
  void struck(const std::filesystem::path& folder, std::uint64_t frames);
  /// What is not as it was acknowledged, one sentence each. A session that was struck becomes one whose files may not change.
  std::vector<std::string> check();
  std::size_t sessions() const { return files_.size(); }
  std::uint64_t interrupted() const { return interrupted_; }

 private:
  using Files = std::map<std::string, std::size_t>;  ///< name and hash
  static Files look(const std::filesystem::path& folder);
  std::map<std::filesystem::path, Files> files_;
  std::map<std::filesystem::path, std::uint64_t> struck_;
  std::uint64_t interrupted_ = 0;
};

class Booth {
 public:
  /// Two simulated cameras and a person; `settings` are further key=value. `models`: empty, the build's own.
  Booth(std::filesystem::path folder, std::vector<std::string> settings = {}, UnitRules rules = {});

  Unit& unit() { return unit_; }
  /// The answer, or nothing where boothd does not give one.
  std::optional<nlohmann::json> ask(const std::string& request, std::chrono::milliseconds limit = std::chrono::seconds(5)) const;
  std::string state() const;
  bool becomes(const std::string& state, std::chrono::seconds limit) const;
  /// Answers, and each of its cameras runs.
  bool whole() const;
  /// The folder of the session that runs, empty where none does.
  std::filesystem::path session() const;
  /// A short session from start to files, put into the ledger; false with a sentence in `why`.
  bool visit(std::chrono::milliseconds length, std::string& why);
  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path sessions() const { return folder_ / "sessions"; }

  Ledger ledger;

 private:
  const std::filesystem::path folder_;
  Unit unit_;
};

/// Program and arguments of boothd as Booth starts it.
std::vector<std::string> booth_command(const std::filesystem::path& folder, const std::vector<std::string>& settings);

}  // namespace booth::tests
