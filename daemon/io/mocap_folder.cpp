// The table is plain comma-separated text; only its first seven columns are used, so that commas in descriptions do no harm.
#include "daemon/io/mocap_folder.hpp"

#include <charconv>
#include <fstream>
#include <stdexcept>

#include "daemon/io/npz.hpp"
#include "fit/body/skeleton.hpp"

namespace booth::daemon {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, int line, const std::string& what) {
  throw std::runtime_error(file.string() + (line > 0 ? ":" + std::to_string(line) : "") + ": " + what);
}

std::vector<std::string> cells(std::string line) {
  if (!line.empty() && line.back() == '\r') line.pop_back();
  std::vector<std::string> list{""};
  for (char c : line) {
    if (c == ',')
      list.emplace_back();
    else
      list.back() += c;
  }
  return list;
}

int whole(const std::filesystem::path& file, int line, const std::string& text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) fail(file, line, "'" + text + "' is not a whole number");
  return value;
}

struct Rule {
  std::string kind, id;
  MotionUse use;
};

std::vector<Rule> read_rules(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) fail(file, 0, "cannot be read; it lists the motions set aside and must exist before anything is trained");
  std::vector<Rule> rules;
  std::string text;
  for (int line = 1; std::getline(in, text); ++line) {
    if (text.empty() || text.front() == '#' || text.starts_with("kind,")) continue;
    const auto row = cells(text);
    const bool kind = row[0] == "subject" || row[0] == "trial" || row[0] == "class";
    if (row.size() < 3 || !kind || (row[2] != "held_out" && row[2] != "excluded")) fail(file, line, "expected 'subject|trial|class,ID,held_out|excluded,note'");
    rules.push_back({row[0], row[1], row[2] == "held_out" ? MotionUse::held_out : MotionUse::excluded});
  }
  return rules;
}

}  // namespace

MotionFolder load_motion_folder(const std::filesystem::path& folder, const std::filesystem::path& held_out) {
  const auto rules = read_rules(held_out);
  const auto file = folder / "train" / "q.npy", table = folder / "train" / "clips.csv";
  MotionFolder out;
  const NpzArray array = read_npy(file);
  if (array.type == NpzType::text || array.shape.size() != 2 || array.shape[1] != fit::kDofs) fail(file, 0, "is not an array of shape (frames, 36)");
  out.q.resize(fit::kDofs, static_cast<Eigen::Index>(array.shape[0]));
  for (std::size_t i = 0; i < array.size(); ++i) out.q.data()[i] = static_cast<float>(array.number(i));
  if (!out.q.allFinite()) fail(file, 0, "holds a value that is not finite");

  std::ifstream in(table);
  if (!in) fail(table, 0, "cannot be read; give the folder that holds train/q.npy and train/clips.csv");
  std::string text;
  std::getline(in, text);
  if (!text.starts_with("clip,cmu_trial,subject,cls,start,frames")) fail(table, 1, "expected the columns clip,cmu_trial,subject,cls,start,frames");
  for (int line = 2; std::getline(in, text); ++line) {
    const auto row = cells(text);
    if (row.size() < 6) fail(table, line, "ends early");
    MotionClip clip{row[0], row[1], row[2], row[3], whole(table, line, row[4]), whole(table, line, row[5]), MotionUse::training};
    if (clip.start < 0 || clip.frames < 1 || clip.start > out.q.cols() - clip.frames) fail(table, line, "names frames that q.npy does not have");
    for (const auto& rule : rules)
      if ((rule.kind == "subject" && rule.id == clip.subject) || (rule.kind == "trial" && rule.id == clip.trial) ||
          (rule.kind == "class" && rule.id == clip.motion_class))
        clip.use = rule.use;
    out.clips.push_back(std::move(clip));
  }
  return out;
}

}  // namespace booth::daemon
