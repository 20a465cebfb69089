// One JSON object a line, flushed as it is written.
#include "tests/accuracy/report/journal.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

namespace booth::accuracy {
namespace {

using nlohmann::json;

json to_json(const Samples& samples) {
  auto out = json::array();
  for (const Sample& s : samples.rows())
    out.push_back({{"case", s.case_name}, {"method", s.method}, {"metric", s.metric}, {"unit", s.unit}, {"tally", s.tally.to_json()}});
  return out;
}

Samples samples_from(const json& rows) {
  Samples out;
  for (const auto& row : rows)
    out.at(row.at("case").get<std::string>(), row.at("method").get<std::string>(), row.at("metric").get<std::string>(), row.at("unit").get<std::string>()) =
        Tally::from_json(row.at("tally"));
  return out;
}

std::string line_of(const std::string& key, const Finished& f) {
  return json{{"unit", key}, {"seconds", f.seconds}, {"samples", to_json(f.samples)}}.dump() + "\n";
}

}  // namespace

Journal::Journal(const std::filesystem::path& folder, const std::string& name, const std::string& identity) {
  if (folder.empty()) return;
  path_ = folder / (name + ".partial.jsonl");
  const std::string first = json{{"run", identity}}.dump();
  {
    std::ifstream old(path_);
    std::string line;
    if (std::getline(old, line) && line == first) {
      while (std::getline(old, line)) {
        try {
          const json parsed = json::parse(line);
          finished_[parsed.at("unit")] = {samples_from(parsed.at("samples")), parsed.at("seconds")};
        } catch (const std::exception&) {
          break;  // cut off in the middle of a line
        }
      }
    }
  }
  resumed_ = finished_.size();
  // Written anew, so that a damaged end does not stay.
  file_.open(path_, std::ios::trunc);
  write(first + "\n");
  for (const auto& [key, finished] : finished_) write(line_of(key, finished));
}

void Journal::write(const std::string& line) {
  file_ << line << std::flush;
  if (!file_) throw std::runtime_error(fmt::format("{} cannot be written: {}", path_.string(), std::strerror(errno)));
}

const Finished* Journal::find(const std::string& key) const {
  const auto at = finished_.find(key);
  return at == finished_.end() ? nullptr : &at->second;
}

const Finished& Journal::add(const std::string& key, Finished finished) {
  if (!path_.empty()) write(line_of(key, finished));
  return finished_[key] = std::move(finished);
}

void Journal::remove() {
  if (path_.empty()) return;
  file_.close();
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

std::string file_identity(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::uint64_t hash = 0xcbf29ce484222325ull;  // FNV-1a
  std::vector<char> block(1 << 20);
  while (file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    for (std::streamsize i = 0; i < file.gcount(); ++i) hash = (hash ^ static_cast<unsigned char>(block[static_cast<std::size_t>(i)])) * 0x100000001b3ull;
  }
  return fmt::format("{:016x}", hash);
}

}  // namespace booth::accuracy
