// The file, little-endian on every machine: magic with the layout's version, names, numbers, tables, and an FNV-1a checksum over all of it.
#include "drivers/kinect2/calibration_cache.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

constexpr std::array<char, 8> kMagic{'k', '2', 'c', 'a', 'l', '0', '2', '\n'};
constexpr std::size_t kNameBytes = 64, kNumbers = 9 + 5 + 20;
constexpr std::size_t kBodyBytes = kMagic.size() + 2 * kNameBytes + 8 * kNumbers + 3 * 2 * kPixels;

std::uint64_t checksum(std::span<const std::byte> bytes) {
  std::uint64_t hash = 0xcbf2'9ce4'8422'2325;
  for (const std::byte b : bytes) hash = (hash ^ std::to_integer<std::uint64_t>(b)) * 0x100'0000'01b3;
  return hash;
}

/// Every number of a calibration, in the order of the file.
template <typename C, typename Use>
void for_each_number(C& c, Use use) {
  auto& d = c.depth;
  for (auto* v : {&d.fx, &d.fy, &d.cx, &d.cy, &d.k1, &d.k2, &d.p1, &d.p2, &d.k3}) use(*v);
  auto& k = c.colour;
  for (auto* v : {&k.fc, &k.ccx, &k.ccy, &k.d0, &k.b}) use(*v);
  for (auto& v : k.x) use(v);
  for (auto& v : k.y) use(v);
}

bool is_name(const std::string& s, bool dots) {
  if (s.empty() || s.size() >= kNameBytes) return false;
  for (const char c : s)
    if (!((c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (dots && c == '.'))) return false;
  return true;
}

bool write_all(int fd, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

bool sync_folder(const std::filesystem::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return false;
  const bool good = ::fsync(fd) == 0;
  ::close(fd);
  return good;
}

std::vector<std::byte> to_bytes(const Calibration& calibration) {
  std::vector<std::byte> bytes(kBodyBytes + 8);
  std::memcpy(bytes.data(), kMagic.data(), kMagic.size());
  std::size_t at = kMagic.size();
  for (const std::string* name : {&calibration.serial, &calibration.firmware}) {
    std::memcpy(bytes.data() + at, name->data(), name->size());
    at += kNameBytes;
  }
  for_each_number(calibration, [&](double v) {
    write_u64(bytes, at, std::bit_cast<std::uint64_t>(v));
    at += 8;
  });
  for (const auto& table : calibration.phase.p0)
    for (const std::uint16_t v : table) {
      write_u16(bytes, at, v);
      at += 2;
    }
  write_u64(bytes, kBodyBytes, checksum(std::span<const std::byte>(bytes).first(kBodyBytes)));
  return bytes;
}

}  // namespace

std::filesystem::path CalibrationCache::file_of(const std::string& serial, const std::string& firmware) const {
  return folder_ / (serial + "-" + firmware + ".calibration");
}

std::optional<Calibration> CalibrationCache::read(const std::filesystem::path& file) const {
  std::ifstream in(file, std::ios::binary);
  std::vector<std::byte> bytes(kBodyBytes + 8 + 1);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (in.gcount() != static_cast<std::streamsize>(kBodyBytes + 8)) return std::nullopt;
  const auto body = std::span<const std::byte>(bytes).first(kBodyBytes);
  if (std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) != 0 || read_u64(bytes, kBodyBytes) != checksum(body)) return std::nullopt;
  Calibration out;
  std::size_t at = kMagic.size();
  for (std::string* name : {&out.serial, &out.firmware}) {
    const char* text = reinterpret_cast<const char*>(bytes.data() + at);
    name->assign(text, strnlen(text, kNameBytes));
    at += kNameBytes;
  }
  for_each_number(out, [&](double& v) {
    v = std::bit_cast<double>(read_u64(bytes, at));
    at += 8;
  });
  for (auto& table : out.phase.p0) {
    table.resize(kPixels);
    for (std::uint16_t& v : table) {
      v = read_u16(bytes, at);
      at += 2;
    }
  }
  try {
    check(out.depth);  // what a checksum cannot know: whether the numbers were good when it was made
    check(out.colour);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
  return out;
}

std::optional<Calibration> CalibrationCache::load(const std::string& serial, const std::string& firmware) const {
  if (!is_name(serial, false) || !is_name(firmware, true)) return std::nullopt;
  auto out = read(file_of(serial, firmware));
  if (out && (out->serial != serial || out->firmware != firmware)) return std::nullopt;
  return out;
}

std::optional<Calibration> CalibrationCache::load_latest(const std::string& serial) const {
  if (!is_name(serial, false)) return std::nullopt;
  std::optional<Calibration> latest;
  std::filesystem::file_time_type newest{};
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder_, error), end; !error && at != end; at.increment(error)) {
    const auto& entry = *at;
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(serial + "-") || !name.ends_with(".calibration")) continue;
    std::error_code gone;
    const auto written = entry.last_write_time(gone);
    if (gone || (latest && written <= newest)) continue;
    if (auto found = read(entry.path()); found && found->serial == serial) {
      latest = std::move(found);
      newest = written;
    }
  }
  return latest;
}

bool CalibrationCache::store(const Calibration& calibration) const noexcept try {
  if (!is_name(calibration.serial, false) || !is_name(calibration.firmware, true)) return false;
  for (const auto& table : calibration.phase.p0)
    if (table.size() != kPixels) return false;
  std::filesystem::create_directories(folder_);
  const auto file = file_of(calibration.serial, calibration.firmware);
  const auto scratch = file.string() + ".new";
  const int fd = ::open(scratch.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0640);
  if (fd < 0) return false;
  const bool written = write_all(fd, to_bytes(calibration)) && ::fsync(fd) == 0;
  const bool closed = ::close(fd) == 0;
  if (!written || !closed || ::rename(scratch.c_str(), file.c_str()) != 0) {
    ::unlink(scratch.c_str());
    return false;
  }
  return sync_folder(folder_);
} catch (const std::exception&) {
  return false;
}

}  // namespace booth::drivers::kinect2
