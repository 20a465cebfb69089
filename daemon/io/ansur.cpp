// Every measure is looked up by its column's name and has bounds: a table in other units is refused, not trained on.
#include "daemon/io/ansur.hpp"

#include <map>
#include <string>

#include "daemon/io/table_rows.hpp"

namespace booth::daemon {

std::vector<fit::train::Person> load_ansur(const std::filesystem::path& file, fit::Sex sex) {
  TableRows rows(file, "give the folder that holds ansur2_male_subset.csv and ansur2_female_subset.csv");
  if (!rows.next()) rows.fail("holds no columns");
  std::map<std::string, std::size_t> column;
  for (std::size_t i = 0; i < rows.cells().size(); ++i) column[rows.cells()[i]] = i;

  std::vector<fit::train::Person> people;
  while (rows.next()) {
    const auto& row = rows.cells();
    const auto value = [&](const std::string& name, double scale, double least, double most) {
      const auto found = column.find(name);
      if (found == column.end()) rows.fail("there is no column '" + name + "'");
      if (found->second >= row.size()) rows.fail("ends before column '" + name + "'");
      const auto& cell = row[found->second];
      double number = 0;
      if (!parse_number(cell, number) || !(number * scale >= least && number * scale <= most))
        rows.fail("column '" + name + "' holds '" + cell + "', which is no such measure");
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
  if (people.empty()) rows.fail("holds no person");
  return people;
}

std::vector<int> load_held_out_bodies(const std::filesystem::path& file, fit::Sex sex) {
  TableRows rows(file, "it lists the bodies set aside and must exist before anything is trained");
  std::vector<int> list;
  while (rows.next()) {
    const auto& row = rows.cells();
    if (row[0] == "sex") continue;
    if (row.size() != 2 || (row[0] != "men" && row[0] != "women")) rows.fail("expected 'men,ID' or 'women,ID'");
    const int id = rows.whole(1);
    if (row[0] == fit::to_string(sex)) list.push_back(id);
  }
  return list;
}

}  // namespace booth::daemon
