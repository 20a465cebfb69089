// Two numbers in a small file: the last time that was believed, and since when another one is doubted.
#include "daemon/record/clock_belief.hpp"

#include <fmt/format.h>

#include <exception>
#include <fstream>

#include "daemon/io/atomic_file.hpp"

namespace booth::daemon {
namespace {

constexpr std::int64_t kDay = 86'400'000'000'000;
constexpr const char* kName = ".clock";

struct Seen {
  std::int64_t believed = 0, doubted_since = 0;  ///< 0: none
};

Seen read(const std::filesystem::path& directory) {
  Seen out;
  std::ifstream in(directory / kName);
  // What is not two numbers that a clock can show is as good as nothing.
  if (!(in >> out.believed >> out.doubted_since) || out.believed < 0 || out.doubted_since < 0) return {};
  return out;
}

}  // namespace

bool clock_believed(const std::filesystem::path& directory, std::int64_t now) {
  const Seen before = read(directory);
  Seen after{now, 0};
  // Differences of unsigned numbers: a damaged file must not overflow.
  const auto later = [&](std::int64_t than, std::int64_t days) {
    return now > than && static_cast<std::uint64_t>(now - than) > static_cast<std::uint64_t>(days * kDay);
  };
  bool believed = true;
  if (before.believed != 0 && later(before.believed, kClockLeapDays)) {
    const bool doubted_before = before.doubted_since != 0 && now >= before.doubted_since && !later(before.doubted_since, kClockLeapDays);
    believed = doubted_before && later(before.doubted_since, kClockDoubtDays);
    if (!believed) after = {before.believed, doubted_before ? before.doubted_since : now};
  }
  try {
    std::error_code error;
    if (std::filesystem::is_directory(directory, error))
      write_file_atomically(directory / kName, fmt::format("{} {}\n", after.believed, after.doubted_since), 0600);
  } catch (const std::exception&) {  // a full disk; the next look will do
  }
  return believed;
}

}  // namespace booth::daemon
