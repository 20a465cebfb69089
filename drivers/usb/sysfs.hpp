// Reading a tree that looks like /sys and believes nothing about it: bounded, inside its root, never blocking.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace booth::drivers::usb {

/// Paths given are relative to the root ("sys/bus/usb") unless they came from resolve(). Thread-safe; nothing throws for what is found.
class Sysfs {
 public:
  explicit Sysfs(std::filesystem::path root);

  const std::filesystem::path& root() const { return root_; }
  std::filesystem::path at(const std::filesystem::path& relative) const { return relative.is_absolute() ? relative : root_ / relative; }

  /// The folder that a chain of links ends at; nothing when it does not exist, runs in a circle, or leaves the root's `sys`.
  std::optional<std::filesystem::path> resolve(const std::filesystem::path& folder) const;
  /// An attribute: the first 127 bytes without trailing blanks, control characters replaced by '?'. Nothing when it is missing, unreadable or no plain file.
  std::optional<std::string> text(const std::filesystem::path& file) const;
  /// The whole of the text as a whole number; nothing when it is anything else.
  std::optional<int> number(const std::filesystem::path& file, int base = 10) const;
  /// The first `most` bytes.
  std::vector<std::byte> bytes(const std::filesystem::path& file, std::size_t most) const;
  /// The last part of what a link points to ("driver" -> "xhci_hcd"); empty when it is no link.
  std::string link_name(const std::filesystem::path& link) const;
  /// Names in a folder, sorted, at most 4096.
  std::vector<std::string> entries(const std::filesystem::path& folder) const;
  /// Whether there is such an attribute, without reading it: some take the device's lock when they are read.
  bool is_attribute(const std::filesystem::path& file) const;
  /// Whether this process may write an attribute; not whether the kernel will like what is written.
  bool writable(const std::filesystem::path& file) const;

 private:
  std::filesystem::path root_;
};

}  // namespace booth::drivers::usb
