// .npz archives: what we write we read, what NumPy writes we read, and what is broken is refused with a sentence that names file and key.
#include "daemon/io/npz.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

namespace booth::daemon {
namespace {

std::string sample() {
  NpzWriter w;
  const std::vector<double> numbers{1.5, -2.25, 0, 1e-3, 65504, -0.5};
  w.add("half", NpzType::f2, {2, 3}, numbers);
  w.add("single", NpzType::f4, {3, 2}, numbers);
  w.add("double", NpzType::f8, {6}, numbers);
  const std::vector<double> whole{0, 1, 2, 255};
  w.add("int", NpzType::i4, {4}, whole);
  w.add("byte", NpzType::u1, {2, 2}, whole);
  w.add("long", NpzType::i8, {4}, whole);
  w.add_texts("names", {"root", "lhip", ""});
  w.add_texts("version", {"men-1"}, true);
  const double scalar = 7;
  w.add("scalar", NpzType::i4, {}, std::span(&scalar, 1));
  return w.archive();
}

std::string error_of(const std::string& bytes) {
  try {
    const NpzReader reader(bytes, "file.npz");
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

TEST(Npz, WhatIsWrittenIsRead) {
  const NpzReader r(sample(), "file.npz");
  EXPECT_EQ(r.keys().size(), 9u);
  EXPECT_EQ(r.numbers("double", {6}), (std::vector<double>{1.5, -2.25, 0, 1e-3, 65504, -0.5}));
  EXPECT_NEAR(r.numbers("half", {2, 3})[3], 1e-3, 1e-6);
  EXPECT_EQ(r.numbers("single", {0, 2})[1], -2.25);
  EXPECT_EQ(r.integers("int", {4}, 0, 255), (std::vector<int>{0, 1, 2, 255}));
  EXPECT_EQ(r.integers("byte", {2, 2}, 0, 255), (std::vector<int>{0, 1, 2, 255}));
  EXPECT_EQ(r.integers("long", {4}, 0, 255), (std::vector<int>{0, 1, 2, 255}));
  EXPECT_EQ(r.texts("names"), (std::vector<std::string>{"root", "lhip", ""}));
  EXPECT_EQ(r.text("version"), "men-1");
  EXPECT_EQ(r.integers("scalar", {}, 0, 10)[0], 7);
}

TEST(Npz, TheSameContentsGiveTheSameBytes) { EXPECT_EQ(sample(), sample()); }

TEST(Npz, HalfPrecisionRoundsToNearestEvenAndCoversTheRange) {
  for (std::uint32_t bits = 0; bits < 0x10000; ++bits) {
    const float value = float_from_half(static_cast<std::uint16_t>(bits));
    if (std::isnan(value)) continue;
    EXPECT_EQ(half_from_float(value), bits) << value;
  }
  EXPECT_EQ(float_from_half(half_from_float(2049.0f)), 2048.0f);  // halfway: to even
  EXPECT_EQ(float_from_half(half_from_float(2051.0f)), 2052.0f);
  EXPECT_TRUE(std::isinf(float_from_half(half_from_float(65520.0f))));
  EXPECT_EQ(float_from_half(half_from_float(65519.0f)), 65504.0f);
  EXPECT_TRUE(std::isnan(float_from_half(half_from_float(std::numeric_limits<float>::quiet_NaN()))));
}

TEST(Npz, ErrorsNameFileAndKey) {
  const NpzReader r(sample(), "file.npz");
  const auto says = [&](auto&& work, const std::string& part) {
    try {
      work();
      ADD_FAILURE() << "expected an error about " << part;
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string(e.what()).find("file.npz"), std::string::npos) << e.what();
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  };
  says([&] { r.array("nothing"); }, "key 'nothing' is missing");
  says([&] { r.numbers("single", {2, 3}); }, "key 'single' has shape (3, 2), expected (2, 3)");
  says([&] { r.numbers("names", {3}); }, "is text");
  says([&] { r.integers("int", {4}, 0, 100); }, "255");
  says([&] { r.integers("double", {6}, -10, 100000); }, "whole numbers");
  says([&] { r.text("names"); }, "holds 3 texts");
}

TEST(Npz, ValuesThatAreNotFiniteAreRefused) {
  NpzWriter w;
  const std::vector<double> bad{0, std::numeric_limits<double>::quiet_NaN()};
  w.add("a", NpzType::f4, {2}, bad);
  const NpzReader r(w.archive(), "file.npz");
  EXPECT_THROW(r.numbers("a", {2}), std::runtime_error);
}

TEST(Npz, EveryTruncationIsRefused) {
  const std::string whole = sample();
  for (std::size_t n = 0; n < whole.size(); ++n) EXPECT_NE(error_of(whole.substr(0, n)), "") << n;
}

TEST(Npz, EverySingleDamagedByteIsRefusedOrHarmless) {
  // A changed byte may hit padding or a time stamp; what must not happen is a crash or a value that the checksum would have caught.
  const std::string whole = sample();
  const NpzReader good(whole, "file.npz");
  for (std::size_t i = 0; i < whole.size(); ++i)
    for (int flip : {0x01, 0x80, 0xff}) {
      std::string bytes = whole;
      bytes[i] = static_cast<char>(bytes[i] ^ flip);
      try {
        const NpzReader r(bytes, "file.npz");
        for (const auto& key : r.keys()) {
          if (good.has(key) && r.array(key).type != NpzType::text) {
            EXPECT_EQ(r.array(key).bytes, good.array(key).bytes) << i;
          }
        }
      } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("file.npz"), std::string::npos);
      }
    }
}

/// A stored (not deflated) archive with one member, as numpy.savez writes it; `npy` is the member's contents and `size` what the directory states.
std::string stored(const std::string& npy, std::uint32_t stated) {
  const auto u16 = [](std::uint16_t v) { return std::string(reinterpret_cast<const char*>(&v), 2); };
  const auto u32 = [](std::uint32_t v) { return std::string(reinterpret_cast<const char*>(&v), 4); };
  std::uint32_t crc = 0xffffffff;
  for (const char c : npy) {
    crc ^= static_cast<unsigned char>(c);
    for (int k = 0; k < 8; ++k) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0);
  }
  crc = ~crc;
  const std::string name = "a.npy";
  const std::string sizes = u32(crc) + u32(stated) + u32(stated) + u16(5) + u16(0);
  const std::string head = u16(20) + u16(0) + u16(0) + u32(0x210000);
  const std::string local = u32(0x04034b50) + head + sizes + name + npy;
  const std::string central = u32(0x02014b50) + u16(20) + head + sizes + u16(0) + u16(0) + u16(0) + u32(0) + u32(0) + name;
  return local + central + u32(0x06054b50) + u32(0) + u16(1) + u16(1) + u32(static_cast<std::uint32_t>(central.size())) +
         u32(static_cast<std::uint32_t>(local.size())) + u16(0);
}

std::string npy(const std::string& header, const std::string& data) {
  const auto size = static_cast<std::uint16_t>(header.size());
  return std::string("\x93NUMPY\x01\x00", 8) + std::string(reinterpret_cast<const char*>(&size), 2) + header + data;
}

TEST(Npz, ReadsStoredMembers) {
  const float values[] = {1, 2, 3};
  const std::string member = npy("{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }\n", std::string(reinterpret_cast<const char*>(values), 12));
  const NpzReader r(stored(member, static_cast<std::uint32_t>(member.size())), "file.npz");
  EXPECT_EQ(r.numbers("a", {3}), (std::vector<double>{1, 2, 3}));
}

TEST(Npz, HostileHeadersAreRefused) {
  const std::string data(16, '\0');
  for (const char* header :
       {"{'descr': '<f4', 'fortran_order': False, 'shape': (5,), }", "{'descr': '<f4', 'fortran_order': True, 'shape': (4,), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (18446744073709551615, 18446744073709551615), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (4294967296, 4294967296), }", "{'descr': '>f4', 'fortran_order': False, 'shape': (4,), }",
        "{'descr': '|O', 'fortran_order': False, 'shape': (2,), }", "{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (4,), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (-4,), }", "{'descr': '<f4', 'fortran_order': False, 'shape': 4 }",
        "{'descr': '<U99999999999', 'fortran_order': False, 'shape': (4,), }", "{}", ""}) {
    const std::string member = npy(header, data);
    EXPECT_NE(error_of(stored(member, static_cast<std::uint32_t>(member.size()))).find("key 'a'"), std::string::npos) << header;
  }
}

TEST(Npz, TextsAreCountedOverTheWholeArchive) {
  // In a packed file an empty text takes next to nothing, in memory 32 bytes.
  NpzWriter w;
  const std::vector<std::string> many(600'000);
  w.add_texts("a", many);
  EXPECT_EQ(error_of(w.archive()), "");
  w.add_texts("b", many);
  EXPECT_NE(error_of(w.archive()).find("texts"), std::string::npos);
}

TEST(Npz, TextsOfNoWidthAreNoList) {
  for (const char* type : {"<U0", "|S0"}) {
    const std::string begin = "{'descr': '" + std::string(type) + "', 'fortran_order': False, 'shape': ";
    const std::string many = npy(begin + "(2,), }", ""), one = npy(begin + "(), }", "");
    EXPECT_NE(error_of(stored(many, static_cast<std::uint32_t>(many.size()))).find("texts of no letters"), std::string::npos);
    EXPECT_EQ(error_of(stored(one, static_cast<std::uint32_t>(one.size()))), "");
  }
}

TEST(Npz, ImpossibleSizesAreRefusedBeforeMemoryIsTaken) {
  const std::string member = npy("{'descr': '<f4', 'fortran_order': False, 'shape': (4,), }", std::string(16, '\0'));
  EXPECT_NE(error_of(stored(member, 0xfffffff0u)), "");
}

}  // namespace
}  // namespace booth::daemon
