// What may reach toml++ and what is refused before, with its place; and the checksum of a calibration.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "drivers/recording/calibration_checksum.hpp"
#include "drivers/recording/toml_document.hpp"

namespace booth::drivers {
namespace {

using ::testing::HasSubstr;

// Each is valid TOML 1.0, and what a careless walk would stumble over.
const std::vector<std::string> kValid{
    "",
    "\n\r\n \t\n",
    "# only a comment",
    "# a comment with \xC3\xA4\xE2\x82\xAC\n",
    "\xEF\xBB\xBFkey = 1\n",
    "key = \"value\" # comment",
    "bare-key_1 = 1\n1234 = 2\n\"quoted \xC3\xA4\" = 3\n'literal \xD0\x9D' = 4\n\"\" = 5",
    "a.b . \"c.d\".'e' = 1",
    "3.14159 = 'pi'",
    "s = \"tab\\t quote\\\" backslash\\\\ \\u00E4 \\U0001F600\"",
    "s = 'C:\\path\\'",
    "s = \"\"",
    "s = ''",
    "s = \"\"\"\"\"\"",
    "s = \"\"\"\nlong \xC3\xA4\nwith \"two\" and \"\" quotes\"\"\"\"\"",
    "s = \"\"\"a \\\n\n   b\\\r\n  c\"\"\"",
    "s = '''\nno \\ escapes ''here''\n\xD0\x9D'''''",
    "i = +1_000\nh = 0xDEAD_beef\no = 0o755\nb = 0b1101\nf = -3.1e-2\ng = 6.022_1e23\nn = nan\nm = -inf",
    "d = 1979-05-27\nt = 07:32:00.5\ndt = 1979-05-27T07:32:00Z\nds = 1979-05-27 07:32:00-08:00 # and more\nafter = true",
    "d = [1979-05-27 07:32:00, 1979-05-27 ]",
    "a = []\nb = [ ]\nc = [1,2,]\nd = [ # first\n  [ # nested\n 1, 2 ],\n  [\n  \"\xC3\xA4\" ] ]",
    "i = {}\nj = { a = 1, b.c = \"x\", d = [ { e = {} } ] }",
    "[table]\n[a.b.\"c\"]\n[ d . e ] # with blanks\n[[list]]\nx = 1\n[[ list ]]\n[list.sub]",
    "key = 1\r\n[t]\r\n# c\r\nother = 2\r\n",
};

TEST(TomlDocument, WhatIsTomlIsParsed) {
  for (const auto& text : kValid) {
    const auto fault = hal::find_toml_fault(text);
    EXPECT_FALSE(fault) << text << "\n" << (fault ? fault->what : "");
    EXPECT_NO_THROW((void)parse_toml(text)) << text;
  }
}

struct Wrong {
  std::string text;
  std::size_t line, column;
  std::string says;
};

// The first ones make toml++ 3.3 reach what it holds for unreachable, or fail its own assertions.
const std::vector<Wrong> kWrong{
    {"fit.th\xD0\x9D = 1", 1, 7, "beyond ASCII"},
    {"a = 1\n\xC2\xA1", 2, 1, "beyond ASCII"},
    {"a =\xC2\xA0"
     "1",
     1, 4, "beyond ASCII"},
    {"a = 1\xD2\x99", 1, 6, "beyond ASCII"},
    {"a = 1 \xE2\xB1\x9E", 1, 7, "beyond ASCII"},
    {"a = 1 \xEF\xAC\xA6", 1, 7, "beyond ASCII"},
    {"a = [\xC2\x85]", 1, 6, "beyond ASCII"},
    {"a = true\xC3\xA4", 1, 9, "beyond ASCII"},
    {"[t\xC3\xA4]", 1, 3, "beyond ASCII"},
    {"a = 1\"\xC3\xA4\"", 1, 6, "the end of the line"},
    {"a = 1[\"\xC3\xA4\"]", 1, 6, "the end of the line"},
    {"a = 1=\"\xC3\xA4\"", 1, 6, "the end of the line"},
    {"a = [1'\xC3\xA4']", 1, 7, "']' is expected"},
    {"a = 1979-05-27 \"\xC3\xA4\"", 1, 16, "the end of the line"},
    {"a = \"\"\"\\\xC3\xA4\"\"\"", 1, 9, "behind a backslash"},
    {"a = \"\"\"\n\xC3\xA4 \\\n  \xC3\xA4\"\"\"", 3, 3, "write it as \\u"},
    {"\n[#t]", 2, 2, "a key is expected"},
    {"[[#t]]", 1, 3, "a key is expected"},
    {"[[[t]]]", 1, 3, "a key is expected"},
    {"[ \n]", 1, 3, "a key is expected"},
    {"a = [}", 1, 6, "a value is expected"},
    {"a = [1 }", 1, 8, "']' is expected"},
    // The rest only has the wrong shape.
    {"a", 1, 2, "'=' is expected, and the text ends"},
    {"a.", 1, 3, "a key is expected"},
    {"a = ", 1, 5, "a value is expected"},
    {"a = \"x", 1, 7, "a string has no end"},
    {"a = \"x\nb\"", 1, 7, "a string has no end"},
    {"a = \"x\\", 1, 8, "a string has no end"},
    {"a = \"\"\"x\"\"", 1, 11, "three quotes close it"},
    {"\"\"\"a\"\"\" = 1", 1, 1, "a key must stand on one line"},
    {"a = 1 b = 2", 1, 7, "the end of the line"},
    {"a = [1 2]", 1, 8, "']' is expected"},
    {"a = { b = 1, }", 1, 14, "a key is expected"},
    {"a = { b = 1\n}", 1, 12, "'}' is expected"},
    {"[t", 1, 3, "']' is expected"},
    {"[[t]", 1, 5, "']' is expected"},
    {"[t] x", 1, 5, "the end of the line"},
    {"a = @", 1, 5, "a value is expected"},
    {std::string("a = 1\0", 6), 1, 6, "the end of the line"},
};

TEST(TomlDocument, WhatIsNoneIsRefusedWithItsPlace) {
  for (const auto& [text, line, column, says] : kWrong) {
    const auto fault = hal::find_toml_fault(text);
    ASSERT_TRUE(fault) << text;
    EXPECT_EQ(std::pair(fault->line, fault->column), std::pair(line, column)) << text;
    EXPECT_THAT(fault->what, HasSubstr(says)) << text;
    try {
      (void)parse_toml(text, "x.toml");
      FAIL() << text;
    } catch (const toml::parse_error& e) {
      EXPECT_EQ(e.source().begin.line, line) << text;
      EXPECT_THAT(std::string(e.description()), HasSubstr(says)) << text;
    }
  }
}

TEST(TomlDocument, DepthIsBounded) {
  const auto nested = [](int depth) { return "a = " + std::string(static_cast<std::size_t>(depth), '[') + std::string(static_cast<std::size_t>(depth), ']'); };
  EXPECT_NO_THROW((void)parse_toml(nested(100)));
  EXPECT_THAT(hal::find_toml_fault(nested(101))->what, HasSubstr("at most 100"));
  EXPECT_TRUE(hal::find_toml_fault(std::string(1 << 20, '[')));
  EXPECT_TRUE(hal::find_toml_fault("a = " + std::string(1 << 20, '[')));
}

/// With sanitizers and assertions (presets asan and dev) this is what shows that nothing slips through.
TEST(TomlDocument, AnyTextEndsInATableOrASentence) {
  int parsed = 0, refused = 0;
  const auto look = [&](const std::string& text) {
    try {
      (void)parse_toml(text);
      ++parsed;
    } catch (const toml::parse_error& e) {
      EXPECT_FALSE(e.description().empty());
      ++refused;
    }
  };
  for (const std::string& text : kValid)
    for (std::size_t at = 0; at <= text.size(); ++at)
      for (const char* put : {"", "\"", "'", "[", "]", "{", "}", "#", "=", ",", ".", "\\", "\n", " ", "1", "_", "t", "-", "\xC3\xA4", "\xE3\x80\x81", "\xFF"}) {
        look(text.substr(0, at) + put + text.substr(at));
        if (at < text.size()) look(text.substr(0, at) + put + text.substr(at + 1));
      }
  EXPECT_GT(parsed, 1000);
  EXPECT_GT(refused, 1000);
}

TEST(Checksum, IsTheCrcOfItsName) {
  EXPECT_EQ(crc64("123456789"), 0x995DC9BBDF1939FAu);
  EXPECT_EQ(crc64(""), 0u);
}

TEST(Checksum, StandsBehindTheVersionAndLeavesTheRestAlone) {
  const std::string text = "# what it is\nversion = 1\n\n[calibration]\nversion = 7\n";
  const std::string out = with_checksum(text);
  EXPECT_THAT(out, HasSubstr("version = 1\nchecksum = \"crc64:"));
  EXPECT_EQ(with_checksum(out), out);
  EXPECT_EQ(check_checksum(out), ChecksumVerdict::right);
  EXPECT_EQ(check_checksum(with_checksum("[t]\n")), ChecksumVerdict::right);
  EXPECT_EQ(check_checksum(with_checksum("version = 1")), ChecksumVerdict::right);
  std::string other = out;
  other[2] = 'W';
  EXPECT_EQ(check_checksum(other), ChecksumVerdict::wrong);
  EXPECT_EQ(check_checksum(with_checksum(other)), ChecksumVerdict::right);
  EXPECT_EQ(check_checksum("checksum = 1\n"), ChecksumVerdict::broken);
  EXPECT_EQ(check_checksum(" " + out.substr(out.find("checksum"))), ChecksumVerdict::broken);
}

}  // namespace
}  // namespace booth::drivers
