// Lists of what is let through, never of what is held back: a key that is new tomorrow stays at home.
#include "daemon/ctl/support_bundle.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>
#include <string_view>

namespace booth::daemon {
namespace {

constexpr const char* kStatusKeys[] = {"software",
                                       "state",
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
constexpr std::string_view kLeftOut = "(left out)";
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

bool in_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-'; }

/// Length of a dotted IPv4 address at the beginning, or 0.
std::size_t address_length(std::string_view text) {
  std::size_t n = 0;
  for (int part = 0; part < 4; ++part) {
    if (part > 0 && (n >= text.size() || text[n++] != '.')) return 0;
    std::size_t digits = 0;
    int value = 0;
    for (; n < text.size() && digits < 4 && text[n] >= '0' && text[n] <= '9'; ++n, ++digits) value = 10 * value + (text[n] - '0');
    if (digits == 0 || value > 255) return 0;
  }
  const bool goes_on = n < text.size() && (in_word(text[n]) || (text[n] == '.' && n + 1 < text.size() && in_word(text[n + 1])));
  return goes_on ? 0 : n;
}

/// Length of an IPv6 address at the beginning, or 0. Times (10:15:00) and hardware addresses (six pairs) are none.
std::size_t long_address_length(std::string_view text) {
  const std::size_t n = std::min(text.size(), text.find_first_not_of("0123456789abcdefABCDEF:."));
  std::string token(text.substr(0, n));
  while (!token.empty() && (token.back() == '.' || (token.back() == ':' && !token.ends_with("::")))) token.pop_back();  // of the sentence
  in6_addr address{};
  const bool is_one = std::count(token.begin(), token.end(), ':') > 1 &&
                      std::any_of(token.begin(), token.end(), [](unsigned char c) { return std::isxdigit(c) != 0; }) &&
                      ::inet_pton(AF_INET6, token.c_str(), &address) == 1;
  return is_one && (n == text.size() || !in_word(text[n])) ? token.size() : 0;
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

std::string without_values(const std::string& text, const std::vector<std::string>& values) {
  std::string out = text;
  for (const auto& value : values)
    for (std::size_t at = 0; !value.empty() && (at = out.find(value, at)) != std::string::npos;) {
      const std::size_t end = at + value.size();
      const bool whole = (at == 0 || !in_word(value.front()) || !in_word(out[at - 1])) && (end == out.size() || !in_word(value.back()) || !in_word(out[end]));
      if (whole) out.replace(at, value.size(), kLeftOut);
      at += whole ? kLeftOut.size() : 1;
    }
  return out;
}

std::string without_addresses(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const bool begins = i == 0 || !(in_word(text[i - 1]) || text[i - 1] == '.');
    const bool begins_long = begins && (i == 0 || text[i - 1] != ':');
    const std::string_view rest = std::string_view(text).substr(i);
    if (const std::size_t n = std::max(begins ? address_length(rest) : 0, begins_long ? long_address_length(rest) : 0); n > 0) {
      out += "(address left out)";
      i += n;
    } else {
      out += text[i++];
    }
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
