// Lists of what is let through, never of what is held back: a key that is new tomorrow stays at home.
#include "daemon/ctl/support_bundle.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>
#include <string_view>

namespace booth::daemon {
namespace {

constexpr const char* kStatusKeys[] = {"state",
                                       "degraded",
                                       "paused",
                                       "emergency_latched",
                                       "panel",
                                       "alarm",
                                       "cameras",
                                       "groups",
                                       "groups_small",
                                       "groups_dropped",
                                       "frames",
                                       "frames_unmatched",
                                       "fps",
                                       "latency_ms",
                                       "stage_ms",
                                       "backend",
                                       "dds_failures",
                                       "dds_problem",
                                       "dds_security",
                                       "cameras_minimum",
                                       "credential_problem"};
constexpr const char* kRecorderKeys[] = {"depth_allowed", "seconds_held", "bytes_held", "bytes_capacity", "dropped"};

/// Length of a name such as 20261128T101500Z or 20261128T101500Z-7f3a at the beginning, or 0.
std::size_t name_length(std::string_view text) {
  constexpr std::string_view kForm = "00000000T000000Z";
  if (text.size() < kForm.size()) return 0;
  for (std::size_t i = 0; i < kForm.size(); ++i)
    if (kForm[i] == '0' ? text[i] < '0' || text[i] > '9' : text[i] != kForm[i]) return 0;
  std::size_t n = kForm.size();
  if (n < text.size() && text[n] == '-')
    for (++n; n < text.size() && (std::isalnum(static_cast<unsigned char>(text[n])) || text[n] == '-' || text[n] == '_'); ++n) {
    }
  return n;
}

void put(std::string& header, std::size_t at, std::string_view text) { header.replace(at, text.size(), text); }

/// POSIX.1-1988 ustar: a header of 512 bytes, then the file in blocks of 512.
void append_file(std::string& archive, const std::string& name, const std::string& bytes, std::int64_t utc_seconds) {
  std::string header(512, '\0');
  put(header, 0, name);
  put(header, 100, "0000600");
  put(header, 108, "0000000");
  put(header, 116, "0000000");
  put(header, 124, fmt::format("{:011o}", bytes.size()));
  put(header, 136, fmt::format("{:011o}", std::max<std::int64_t>(0, utc_seconds)));
  put(header, 148, "        ");  // the checksum is taken with blanks in its own place
  put(header, 156, "0");
  put(header, 257,
      std::string_view("ustar\0"
                       "00",
                       8));
  unsigned sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  put(header, 148, fmt::format("{:06o}", sum) + std::string("\0 ", 2));
  archive += header + bytes;
  archive.append((512 - bytes.size() % 512) % 512, '\0');
}

}  // namespace

std::string without_session_names(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    if (const std::size_t n = name_length(std::string_view(text).substr(i)); n > 0) {
      out += "(name left out)";
      i += n;
      continue;
    }
    const auto c = static_cast<unsigned char>(text[i++]);
    out += c >= 0x80 || (c < 0x20 && c != '\n' && c != '\t') || c == 0x7f ? '?' : static_cast<char>(c);
  }
  return out;
}

std::string status_for_report(const StatusJson& status) {
  StatusJson out = StatusJson::object();
  if (!status.is_object()) return "boothd does not answer\n";
  for (const char* key : kStatusKeys)
    if (status.contains(key)) out[key] = status[key];
  const StatusJson recorder = part_of(status, "recorder");
  for (const char* key : kRecorderKeys)
    if (recorder.is_object() && recorder.contains(key)) out["recorder"][key] = recorder[key];
  return without_session_names(out.dump(2, ' ', true, StatusJson::error_handler_t::replace)) + "\n";
}

std::string bundle_archive(const std::vector<BundleFile>& files, std::int64_t utc_seconds) {
  const std::string folder = "boothd-report/";
  std::string contents = "What is in this archive. No depth, no skeletons, no bodies, no names of sessions or recordings.\n\n";
  for (const BundleFile& f : files) contents += fmt::format("{:<24} {}\n", f.name, f.what);
  std::string archive;
  append_file(archive, folder + "CONTENTS.txt", contents, utc_seconds);
  for (const BundleFile& f : files) {
    if (f.name.empty() || f.name.size() > 80)
      throw std::invalid_argument("support bundle: the name " + f.name + " is empty or longer than 80 bytes; shorten it");
    append_file(archive, folder + f.name, f.bytes, utc_seconds);
  }
  archive.append(1024, '\0');
  return archive;
}

}  // namespace booth::daemon
