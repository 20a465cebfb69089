// Reads the measures that training uses from the ANSUR II tables.
#pragma once

#include <filesystem>
#include <vector>

#include "fit/train/person.hpp"

namespace booth::daemon {

/// A comma-separated table with ANSUR II's column names (millimetres, 0.1 kg). Throws std::runtime_error that names file, line and column.
std::vector<fit::train::Person> load_ansur(const std::filesystem::path& file, fit::Sex sex);

/// Subject ids of one sex from held_out_bodies.csv (# comments, then sex,subjectid), in the file's order.
std::vector<int> load_held_out_bodies(const std::filesystem::path& file, fit::Sex sex);

}  // namespace booth::daemon
