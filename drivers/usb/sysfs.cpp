// Plain POSIX reads: no streams, no following of a last link, no waiting.
#include "drivers/usb/sysfs.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>

namespace booth::drivers::usb {
namespace {

constexpr std::size_t kLongestText = 127, kMostEntries = 4096;

/// A plain file, or -1. A FIFO or a device planted in its place neither blocks nor is read.
int open_plain(const std::filesystem::path& file, int flags) {
  const int fd = ::open(file.c_str(), flags | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY);
  if (fd < 0) return -1;
  struct stat s {};
  if (::fstat(fd, &s) == 0 && S_ISREG(s.st_mode)) return fd;
  ::close(fd);
  return -1;
}

}  // namespace

Sysfs::Sysfs(std::filesystem::path root) {
  std::error_code error;
  root_ = std::filesystem::canonical(root, error);
  if (error) root_ = std::move(root);
}

std::optional<std::filesystem::path> Sysfs::resolve(const std::filesystem::path& folder) const {
  std::error_code error;
  auto real = std::filesystem::canonical(at(folder), error);
  if (error || !std::filesystem::is_directory(real, error)) return std::nullopt;
  const auto home = root_ / "sys";
  const auto [end, ignored] = std::mismatch(home.begin(), home.end(), real.begin(), real.end());
  if (end != home.end()) return std::nullopt;
  return real;
}

std::vector<std::byte> Sysfs::bytes(const std::filesystem::path& file, std::size_t most) const {
  std::vector<std::byte> out(most);
  const int fd = open_plain(at(file), O_RDONLY);
  std::size_t size = 0;
  while (fd >= 0 && size < most) {
    const ssize_t n = ::read(fd, out.data() + size, most - size);
    if (n <= 0) break;
    size += static_cast<std::size_t>(n);
  }
  if (fd >= 0) ::close(fd);
  out.resize(size);
  return out;
}

std::optional<std::string> Sysfs::text(const std::filesystem::path& file) const {
  const int fd = open_plain(at(file), O_RDONLY);
  if (fd < 0) return std::nullopt;
  char buffer[kLongestText];
  const ssize_t n = ::read(fd, buffer, sizeof buffer);
  ::close(fd);
  if (n < 0) return std::nullopt;
  std::string out(buffer, static_cast<std::size_t>(n));
  while (!out.empty() && (out.back() == '\n' || out.back() == ' ' || out.back() == '\0')) out.pop_back();
  out.erase(0, out.find_first_not_of(' '));  // the kernel pads some numbers
  for (char& c : out)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  return out;
}

std::optional<int> Sysfs::number(const std::filesystem::path& file, int base) const {
  const auto found = text(file);
  if (!found) return std::nullopt;
  std::string_view digits = *found;
  if (base == 16 && digits.starts_with("0x")) digits.remove_prefix(2);
  int value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, base);
  if (error != std::errc() || end != digits.data() + digits.size() || value < 0) return std::nullopt;
  return value;
}

std::string Sysfs::link_name(const std::filesystem::path& link) const {
  std::error_code error;
  const auto target = std::filesystem::read_symlink(at(link), error);
  if (error) return "";
  std::string out = target.filename().string().substr(0, kLongestText);
  for (char& c : out)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  return out;
}

std::vector<std::string> Sysfs::entries(const std::filesystem::path& folder) const {
  std::vector<std::string> out;
  std::error_code error;
  for (std::filesystem::directory_iterator it(at(folder), error), end; !error && it != end && out.size() < kMostEntries; it.increment(error))
    out.push_back(it->path().filename().string());
  std::sort(out.begin(), out.end());
  return out;
}

bool Sysfs::is_attribute(const std::filesystem::path& file) const {
  std::error_code error;
  return std::filesystem::is_regular_file(std::filesystem::symlink_status(at(file), error));
}

bool Sysfs::writable(const std::filesystem::path& file) const { return ::access(at(file).c_str(), W_OK) == 0; }

}  // namespace booth::drivers::usb
