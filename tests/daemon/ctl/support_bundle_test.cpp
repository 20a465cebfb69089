// That a support bundle is an archive, and that nothing of a session gets into it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "daemon/ctl/support_bundle.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(SupportBundle, NamesOfSessionsAreLeftOut) {
  EXPECT_EQ(without_session_names("session 20261128T101500Z-7f3a begins in /s/20261128T101500Z-7f3a/x"),
            "session (name left out) begins in /s/(name left out)/x");
  EXPECT_EQ(without_session_names("20261128T101500Z"), "(name left out)");
  EXPECT_EQ(without_session_names("/r/20261128T101500Z-snapshot_2.part"), "/r/(name left out).part");
  for (const char* text : {"", "2026-11-28T10:15:00Z", "20261128T10150Z", "20261128T101500", "0x12345678T"}) EXPECT_EQ(without_session_names(text), text);
  EXPECT_EQ(without_session_names("a\x1b[31m\xff\n"), "a?[31m?\n");
}

TEST(SupportBundle, WhatTheConfigurationNamesIsLeftOutOfSentences) {
  const std::vector<std::string> values{"/etc/boothd/keys/whose.public", "/etc/boothd/keys", "192.0.2.7", ""};
  EXPECT_EQ(without_values("/etc/boothd/keys/whose.public: cannot be read; 192.0.2.7:7410, /etc/boothd/keys/x", values),
            "(left out): cannot be read; (left out):7410, (left out)/x");
  EXPECT_EQ(without_values("192.0.2.77 and 1192.0.2.7", values), "192.0.2.77 and 1192.0.2.7") << "another's";
  EXPECT_EQ(without_values("a", {"a", "(left out)"}), "(left out)");
}

TEST(SupportBundle, AddressesAreLeftOut) {
  EXPECT_EQ(without_addresses("DDS: udp/192.0.2.7:7410 unreachable, 10.1.2.3."), "DDS: udp/(address left out):7410 unreachable, (address left out).");
  for (const char* text : {"", "1.2.3", "6.1.0-28-amd64", "1.2.3.4.5", "port 2-1.4.3.2", "256.1.1.1", "1.2.3.4x", "1..2.3", "1.2.3."})
    EXPECT_EQ(without_addresses(text), text);
  EXPECT_EQ(without_addresses("from 2001:db8::7 to [fe80::1%eth0]:7410, ::ffff:192.0.2.7: refused."),
            "from (address left out) to [(address left out)%eth0]:7410, (address left out): refused.");
  for (const char* text : {"2026-11-28T10:15:00Z 10:15:00", "aa:bb:cc:dd:ee:ff", "::", "a:b", "booth::daemon", "usb 2-1.4: new", "0000:00:14.0"})
    EXPECT_EQ(without_addresses(text), text);
}

TEST(SupportBundle, OfTheStatusOnlyTheListedKeys) {
  const std::string text = status_for_report(StatusJson::parse(R"({"ok":true,"state":"tracking","alarm":"session 20261128T101500Z-7f3a could not be saved",
    "session":"secret-1","session_folder":"/secret-2","person":"secret-3","residual":0.123456,"coverage":0.123456,"others":123456,"remark":"secret-4",
    "last_session":{"id":"secret-5"},"body_known":true,"something_new":"secret-6","cameras":[{"name":"front-left","serial":"0123"}],
    "recorder":{"seconds_held":3,"recording":{"path":"/secret-7"},"snapshot":{"path":"/secret-8"}}})"));
  EXPECT_THAT(text, HasSubstr("front-left"));
  EXPECT_THAT(text, HasSubstr("seconds_held"));
  EXPECT_THAT(text, HasSubstr("session (name left out) could not be saved"));
  EXPECT_THAT(text, Not(HasSubstr("secret")));
  EXPECT_THAT(text, Not(HasSubstr("123456")));
  for (const char* odd : {"null", "[]", "3"}) EXPECT_EQ(status_for_report(StatusJson::parse(odd)), "boothd does not answer\n");
}

TEST(SupportBundle, IsAnArchiveOfWholeBlocks) {
  const std::string archive = bundle_archive({{"a.txt", "first", "hello"}, {"b.txt", "second", std::string(512, 'x')}, {"c.txt", "empty", ""}}, 1'790'000'000);
  EXPECT_EQ(archive.size() % 512, 0u);
  std::set<std::string> names;
  std::size_t at = 0;
  while (at < archive.size() && archive[at] != '\0') {
    const std::string name = archive.c_str() + at;
    EXPECT_EQ(archive.substr(at + 257, 5), "ustar");
    names.insert(name);
    const std::size_t size = std::stoul(archive.substr(at + 124, 11), nullptr, 8);
    if (name == "boothd-report/a.txt") {
      EXPECT_EQ(archive.substr(at + 512, size), "hello");
    }
    if (name == "boothd-report/CONTENTS.txt") {
      EXPECT_THAT(archive.substr(at + 512, size), HasSubstr("second"));
    }
    at += 512 + (size + 511) / 512 * 512;
  }
  EXPECT_EQ(names, (std::set<std::string>{"boothd-report/CONTENTS.txt", "boothd-report/a.txt", "boothd-report/b.txt", "boothd-report/c.txt"}));
  EXPECT_EQ(archive.substr(at), std::string(1024, '\0'));
  EXPECT_THROW(bundle_archive({{std::string(81, 'n'), "", ""}}, 0), std::invalid_argument);
}

}  // namespace
}  // namespace booth::daemon
