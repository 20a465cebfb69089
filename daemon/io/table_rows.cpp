// A whole file in memory: what cannot be read to its end is an error, and never a shorter table.
#include "daemon/io/table_rows.hpp"

#include <stdexcept>

#include "daemon/io/file_bytes.hpp"

namespace booth::daemon {
namespace {

constexpr std::uint64_t kMostBytes = 64ull << 20;

std::string read(const std::filesystem::path& file, std::string_view without) {
  try {
    return read_file_bytes(file, kMostBytes);
  } catch (const std::runtime_error& e) {
    throw std::runtime_error(std::string(e.what()) + "; " + std::string(without));
  }
}

}  // namespace

TableRows::TableRows(std::filesystem::path file, std::string_view without) : file_(std::move(file)), text_(read(file_, without)), lines_(text_) {}

bool TableRows::next() {
  do {
    if (!lines_.next_line()) return false;
  } while (lines_.line().empty() || lines_.line().front() == '#');
  cells_.assign(1, "");
  for (char c : lines_.line()) {
    if (c == ',')
      cells_.emplace_back();
    else
      cells_.back() += c;
  }
  return true;
}

int TableRows::whole(std::size_t cell) const {
  int value = 0;
  if (!parse_number(cells_.at(cell), value)) fail("'" + cells_[cell] + "' is not a whole number");
  return value;
}

void TableRows::fail(const std::string& what) const {
  const std::string line = lines_.line_number() > 0 ? ":" + std::to_string(lines_.line_number()) : "";
  throw std::runtime_error(file_.string() + line + ": " + what);
}

}  // namespace booth::daemon
