// One row of the table of distances at a time is enough.
#include "daemon/config/near_word.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

namespace booth::daemon {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t above = row[j + 1];
      row[j + 1] = std::min({above + 1, row[j] + 1, diagonal + (a[i] == b[j] ? 0u : 1u)});
      diagonal = above;
    }
  }
  return row.back();
}

std::size_t misspelling_limit(std::string_view word) { return std::max<std::size_t>(2, word.size() / 3); }

}  // namespace booth::daemon
