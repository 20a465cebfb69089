// Comma-separated text without quotes is all that these tables need.
#include "daemon/io/ansur.hpp"

#include <charconv>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>

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

}  // namespace

std::vector<fit::train::Person> load_ansur(const std::filesystem::path& file, fit::Sex sex) {
  std::ifstream in(file);
  if (!in) fail(file, 0, "cannot be read; give the folder that holds ansur2_male_subset.csv and ansur2_female_subset.csv");
  std::string text;
  std::getline(in, text);
  std::map<std::string, std::size_t> column;
  const auto names = cells(text);
  for (std::size_t i = 0; i < names.size(); ++i) column[names[i]] = i;

  std::vector<fit::train::Person> people;
  for (int line = 2; std::getline(in, text); ++line) {
    const auto row = cells(text);
    const auto value = [&](const std::string& name, double scale, double least, double most) {
      const auto found = column.find(name);
      if (found == column.end()) fail(file, 1, "has no column '" + name + "'");
      if (found->second >= row.size()) fail(file, line, "ends before column '" + name + "'");
      const auto& cell = row[found->second];
      double number = 0;
      const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), number);
      if (error != std::errc() || end != cell.data() + cell.size() || !(number * scale >= least && number * scale <= most))
        fail(file, line, "column '" + name + "' holds '" + cell + "', which is no such measure");
      return number * scale;
    };
    const auto length = [&](const std::string& name) { return value(name, 1e-3, 0.05, 3); };
    fit::train::Person p;
    p.sex = sex;
    p.subject = static_cast<int>(value("subjectid", 1, 0, 1e9));
    p.age = value("age", 1, 0, 120);
    p.stature = length("stature");
    p.mass = value("weightkg", 0.1, 20, 300);
    p.chest = length("chestcircumference");
    p.waist = length("waistcircumference");
    p.buttock = length("buttockcircumference");
    p.thigh = length("thighcircumference");
    p.calf = length("calfcircumference");
    p.trochanterion = length("trochanterionheight");
    p.arm = length("acromionradialelength") + length("radialestylionlength");
    people.push_back(p);
  }
  if (people.empty()) fail(file, 0, "holds no person");
  return people;
}

std::vector<int> load_held_out_bodies(const std::filesystem::path& file, fit::Sex sex) {
  std::ifstream in(file);
  if (!in) fail(file, 0, "cannot be read; it lists the bodies set aside and must exist before anything is trained");
  std::vector<int> list;
  std::string text;
  for (int line = 1; std::getline(in, text); ++line) {
    if (text.empty() || text.front() == '#' || text.starts_with("sex,")) continue;
    const auto row = cells(text);
    int id = 0;
    if (row.size() != 2 || (row[0] != "men" && row[0] != "women") ||
        std::from_chars(row[1].data(), row[1].data() + row[1].size(), id).ptr != row[1].data() + row[1].size())
      fail(file, line, "expected 'men,ID' or 'women,ID'");
    if (row[0] == fit::to_string(sex)) list.push_back(id);
  }
  return list;
}

}  // namespace booth::daemon
