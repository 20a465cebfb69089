// Only the table's first six columns are used, so that commas in descriptions do no harm.
#include "daemon/io/mocap_folder.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "daemon/io/npz.hpp"
#include "daemon/io/table_rows.hpp"
#include "fit/body/skeleton.hpp"

namespace booth::daemon {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what) { throw std::runtime_error(file.string() + ": " + what); }

struct Rule {
  std::string kind, id;
  MotionUse use;
};

std::vector<Rule> read_rules(const std::filesystem::path& file) {
  TableRows rows(file, "it lists the motions set aside and must exist before anything is trained");
  std::vector<Rule> rules;
  while (rows.next()) {
    const auto& row = rows.cells();
    if (row[0] == "kind") continue;
    const bool kind = row[0] == "subject" || row[0] == "trial" || row[0] == "class";
    if (row.size() < 3 || !kind || (row[2] != "held_out" && row[2] != "excluded")) rows.fail("expected 'subject|trial|class,ID,held_out|excluded,note'");
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
  if (array.type == NpzType::text || array.shape.size() != 2 || array.shape[1] != fit::kDofs) fail(file, "is not an array of shape (frames, 36)");
  out.q.resize(fit::kDofs, static_cast<Eigen::Index>(array.shape[0]));
  for (std::size_t i = 0; i < array.size(); ++i) out.q.data()[i] = static_cast<float>(array.number(i));
  if (!out.q.allFinite()) fail(file, "holds a value that is not finite");

  TableRows rows(table, "give the folder that holds train/q.npy and train/clips.csv");
  constexpr std::array kColumns = {"clip", "cmu_trial", "subject", "cls", "start", "frames"};
  if (!rows.next() || rows.cells().size() < kColumns.size() || !std::equal(kColumns.begin(), kColumns.end(), rows.cells().begin()))
    rows.fail("expected the columns clip,cmu_trial,subject,cls,start,frames");
  while (rows.next()) {
    const auto& row = rows.cells();
    if (row.size() < kColumns.size()) rows.fail("ends early");
    MotionClip clip{row[0], row[1], row[2], row[3], rows.whole(4), rows.whole(5), MotionUse::training};
    if (clip.start < 0 || clip.frames < 1 || clip.start > out.q.cols() - clip.frames) rows.fail("names frames that q.npy does not have");
    for (const auto& rule : rules)
      if ((rule.kind == "subject" && rule.id == clip.subject) || (rule.kind == "trial" && rule.id == clip.trial) ||
          (rule.kind == "class" && rule.id == clip.motion_class))
        clip.use = rule.use;
    out.clips.push_back(std::move(clip));
  }
  return out;
}

}  // namespace booth::daemon
