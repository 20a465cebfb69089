// Files that were written by boothd, perhaps another one than this, and may have been touched by anybody since.
#include "daemon/record/session_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/io/csv_file.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/record/session_info.hpp"
#include "daemon/record/session_json.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/seal/sealed_file.hpp"
#include "hal/file_version.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::uint64_t kMostCsv = std::uint64_t{2} << 30;

/// Takes cells off the front of a line.
class Cells {
 public:
  Cells(std::string_view line, const std::string& place) : rest_(line), place_(place) {}
  std::string_view text() {
    if (ended_) wrong("has too few columns");
    const auto comma = rest_.find(',');
    const std::string_view cell = rest_.substr(0, comma);
    ended_ = comma == std::string_view::npos;
    rest_ = ended_ ? std::string_view{} : rest_.substr(comma + 1);
    ++column_;
    return cell;
  }
  template <class T>
  T number() {
    const std::string_view cell = text();
    T value{};
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    bool good = error == std::errc() && end == cell.data() + cell.size();
    if constexpr (std::is_floating_point_v<T>) good = good && std::isfinite(value);
    if (!good) wrong(fmt::format("has no number in column {}", column_));
    return value;
  }
  void expect_end() const {
    if (!ended_) wrong("has too many columns");
  }
  [[noreturn]] void wrong(const std::string& what) const { throw std::runtime_error(place_ + " " + what); }

 private:
  std::string_view rest_;
  const std::string& place_;
  bool ended_ = false;
  int column_ = 0;
};

void take_body(const Json& j, const fs::path& file, std::vector<FrameRecord>& frames) {
  if (!j.contains("beta")) return;  // nobody was ever seen
  const Json& beta = j["beta"];
  const std::string sex = j.value("sex", std::string());
  if ((sex != "men" && sex != "women") || !beta.is_array() || beta.size() > kRecordShape)
    throw std::runtime_error(fmt::format("{}: sex and beta do not describe a body", file.string()));
  std::array<double, kRecordShape> values{};
  for (std::size_t i = 0; i < beta.size(); ++i) {
    if (!beta[i].is_number() || !(std::abs(beta[i].get<double>()) < 100))
      throw std::runtime_error(fmt::format("{}: beta[{}] is no number of a body", file.string(), i));
    values[i] = beta[i].get<double>();
  }
  for (FrameRecord& f : frames) {
    f.sex = sex == "men" ? RecordSex::men : RecordSex::women;
    f.shape_count = static_cast<std::uint8_t>(beta.size());
    f.beta = values;
  }
}

}  // namespace

std::vector<FrameRecord> parse_skeleton_csv(std::string_view text, const std::string& name) {
  std::string header = skeleton_csv_header();
  header.pop_back();
  const auto first_line = text.substr(0, text.find('\n'));
  const bool further = first_line.starts_with(header + ',');
  if (first_line != header && !further) throw std::runtime_error(name + ": is no skeleton.csv that boothd has written (its first line differs)");
  text.remove_prefix(std::min(text.size(), first_line.size() + 1));
  std::vector<FrameRecord> out;
  for (std::size_t line_number = 2; !text.empty(); ++line_number) {
    const auto end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty()) continue;
    const std::string place = fmt::format("{}: line {}", name, line_number);
    Cells cells(line, place);
    FrameRecord& f = out.emplace_back();
    f.sequence = out.size() - 1;
    const double time = cells.number<double>();
    if (!(time >= 0 && time < 1e7)) cells.wrong("has a time that cannot be");
    f.captured_ns = 1 + std::llround(1e9 * time);
    if (out.size() > 1 && f.captured_ns < out[out.size() - 2].captured_ns) cells.wrong("goes back in time");
    f.captured_utc_ns = cells.number<std::int64_t>();
    const std::string_view state = cells.text();
    if (state != "lost" && state != "estimated" && state != "tracked") cells.wrong("has a state that is none of lost, estimated, tracked");
    f.person = state == "lost" ? PersonState::lost : state == "estimated" ? PersonState::estimated : PersonState::tracked;
    f.residual = cells.number<float>();
    for (double& q : f.q) q = static_cast<double>(cells.number<float>());
    for (auto& joint : f.joints)
      for (double& x : joint) x = static_cast<double>(cells.number<float>());
    if (!further) cells.expect_end();
  }
  return out;
}

SessionContents read_session(const fs::path& folder, const Seal* seal) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) throw std::runtime_error(fmt::format("{}: there is no such session", folder.string()));
  if (!is_sealed(folder))
    seal = nullptr;
  else if (!seal)
    throw std::runtime_error(sealed_sentence(folder));
  const auto name_of = [&](const char* name) { return folder / (seal ? std::string(name) + kSealedEnding : std::string(name)); };
  const auto bytes_of = [&](const char* name, std::uint64_t most) {
    return seal ? read_sealed_file(folder, name, *seal, most) : read_file_bytes(folder / name, most);
  };
  const bool log = fs::exists(seal ? name_of(kSealedFrameLogName) : folder / kFrameLogName, ignored);
  // A sealed session in work, or interrupted, has only its outline.
  const bool outline = seal && (log || !fs::exists(name_of("session.json"), ignored));
  const fs::path file = outline ? folder / "session.json" : name_of("session.json");
  const Json j = parse_session_json(outline ? read_file_bytes(file, kMostSessionJson) : bytes_of("session.json", kMostSessionJson));
  if (!j.is_object() || !j.contains("result") || !j["result"].is_string())
    throw std::runtime_error(fmt::format("{}: is no session.json of boothd", file.string()));
  const Json format = j.value("format", Json(1));
  if (!format.is_number_integer()) throw std::runtime_error(fmt::format("{}: its format is no number", file.string()));
  const auto verdict = hal::judge_file_version(format.get<std::int64_t>(), kSessionFormat);
  const std::string complaint = fmt::format("{}: {}", file.string(), hal::file_version_complaint(format.get<std::int64_t>(), kSessionFormat));
  if (verdict == hal::FileVersion::unreadable) throw std::runtime_error(complaint);
  SessionContents out;
  if (verdict == hal::FileVersion::newer) out.warning = complaint;
  out.id = folder.filename().string();
  out.result = j["result"].get<std::string>();
  if (outline && out.result == "complete") throw std::runtime_error(fmt::format("{}: is missing", name_of("session.json").string()));
  if (log) {
    out.frames = read_session_log(folder, seal);
    return out;
  }
  const fs::path csv = name_of("skeleton.csv");
  if (!fs::exists(csv, ignored)) return out;  // a session without a frame
  out.frames = parse_skeleton_csv(bytes_of("skeleton.csv", kMostCsv), csv.string());
  if (j.value("sex", Json("")).is_string()) take_body(j, file, out.frames);
  return out;
}

}  // namespace booth::daemon
