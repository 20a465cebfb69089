// Keys and sealed streams: what is closed comes back whole for the right key, and nothing that was changed, cut or exchanged comes back at all.
#include "daemon/seal/seal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>

#include <cstdlib>

#include "daemon/io/atomic_file.hpp"
#include "daemon/seal/sealed_file.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/support/complaint.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using tests::complaint;
using tests::read_text;
using tests::TemporaryFolder;

SealDecoder::Source source_of(const std::string& bytes) {
  return [bytes, at = std::size_t{0}](char* to, std::size_t count) mutable {
    const std::size_t n = std::min(count, bytes.size() - at);
    std::copy_n(bytes.data() + at, n, to);
    at += n;
    return n;
  };
}

struct Read {
  std::vector<std::string> chunks;
  SealEnd end{};
};

Read read_all(const Seal& seal, const std::string& name, const std::string& bytes) {
  SealDecoder decoder(seal, name, source_of(bytes));
  Read out;
  for (std::string chunk; decoder.next(chunk);) out.chunks.push_back(chunk);
  out.end = decoder.end();
  return out;
}

const std::vector<std::string> kChunks{"one", "", std::string(kSealChunk, 'x'), "the last"};

std::string seal_chunks(const Seal& seal, const std::string& name, const std::vector<std::string>& chunks) {
  SealEncoder encoder(seal, name);
  std::string out;
  for (std::size_t i = 0; i < chunks.size(); ++i) encoder.append(chunks[i], i + 1 == chunks.size(), out);
  return out;
}

struct SealTest : ::testing::Test {
  const PrivateKey key = make_private_key();
  const std::shared_ptr<const Seal> seal = Seal::fresh(key.public_half);
};

TEST_F(SealTest, ComesBackChunkByChunk) {
  const std::string bytes = seal_chunks(*seal, "a", kChunks);
  EXPECT_EQ(bytes.find("the last"), std::string::npos);
  const Read read = read_all(*seal, "a", bytes);
  EXPECT_EQ(read.chunks, kChunks);
  EXPECT_EQ(read.end, SealEnd::complete);
  EXPECT_EQ(sealed_plain_bytes(source_of(bytes)), 3 + kSealChunk + 8);
}

TEST_F(SealTest, TheSamePrivateKeyOpensIt) {
  const auto again = Seal::open(seal->key_file(), key, "seal.key");
  EXPECT_EQ(read_all(*again, "a", seal_chunks(*seal, "a", kChunks)).chunks, kChunks);
  EXPECT_EQ(Seal::recipient_of(seal->key_file()), key.public_half.id());
}

TEST_F(SealTest, AnotherKeyIsToldSo) {
  const PrivateKey other = make_private_key();
  const std::string said = complaint([&] { Seal::open(seal->key_file(), other, "x/seal.key"); });
  EXPECT_THAT(said, HasSubstr("x/seal.key: is sealed to key " + key.public_half.id()));
  EXPECT_THAT(said, HasSubstr(other.public_half.id()));
}

TEST_F(SealTest, AKeyFileThatWasTouchedOpensNothing) {
  const std::string good = seal->key_file();
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 1);
    EXPECT_NE(complaint([&] { Seal::open(bad, key, "k"); }), "") << "byte " << i;
    EXPECT_NE(complaint([&] { Seal::open(good.substr(0, i), key, "k"); }), "") << "cut at " << i;
  }
}

TEST_F(SealTest, EveryCutIsNoticedAndWhatCameBeforeIsWhole) {
  const std::vector<std::string> chunks{"first", "second", "third"};
  const std::string bytes = seal_chunks(*seal, "a", chunks);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const Read read = read_all(*seal, "a", bytes.substr(0, size));
    EXPECT_EQ(read.end, SealEnd::cut) << size;
    ASSERT_LE(read.chunks.size(), 3u) << size;
    for (std::size_t i = 0; i < read.chunks.size(); ++i) EXPECT_EQ(read.chunks[i], chunks[i]);
  }
  // What a power cut leaves behind the last block that was written.
  const Read zeros = read_all(*seal, "a", bytes.substr(0, bytes.size() - 4 - 17 - 5) + std::string(4096, '\0'));
  EXPECT_EQ(zeros.end, SealEnd::cut);
  EXPECT_EQ(zeros.chunks.size(), 2u);
}

TEST_F(SealTest, EveryChangedByteIsNoticed) {
  const std::vector<std::string> chunks{"first", "second", "third"};
  const std::string bytes = seal_chunks(*seal, "a", chunks);
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    std::string bad = bytes;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    const Read read = read_all(*seal, "a", bad);
    EXPECT_NE(read.end, SealEnd::complete) << at;
    for (std::size_t i = 0; i < read.chunks.size(); ++i) EXPECT_EQ(read.chunks[i], chunks[i]) << at;
  }
  EXPECT_EQ(read_all(*seal, "a", bytes + "x").end, SealEnd::damaged) << "something behind the end";
}

TEST_F(SealTest, ChunksAndFilesCannotTakeEachOthersPlace) {
  const std::vector<std::string> chunks{"11111", "22222", "33333"};
  const std::string bytes = seal_chunks(*seal, "a", chunks);
  const std::size_t chunk = 4 + 17 + 5, begin = bytes.size() - 3 * chunk;
  const std::string head = bytes.substr(0, begin), one = bytes.substr(begin, chunk), two = bytes.substr(begin + chunk, chunk),
                    three = bytes.substr(begin + 2 * chunk);
  for (const std::string& order : {two + one + three, one + one + two + three, one + three, three})
    EXPECT_EQ(read_all(*seal, "a", head + order).end, SealEnd::damaged);
  EXPECT_EQ(read_all(*seal, "b", bytes).end, SealEnd::damaged) << "renamed";
  EXPECT_EQ(read_all(*Seal::fresh(key.public_half), "a", bytes).end, SealEnd::damaged) << "of another folder";
  EXPECT_EQ(read_all(*seal, "a", seal_chunks(*seal, "a", chunks).substr(0, begin) + one + two + three).end, SealEnd::damaged) << "of an earlier writing";
}

TEST_F(SealTest, FilesAreWrittenWholeAndPrivate) {
  const TemporaryFolder folder;
  const std::string text(3 * kSealChunk + 17, 'q');
  write_file_atomically({folder.path / "t.csv", seal.get()}, text);
  EXPECT_FALSE(std::filesystem::exists(folder.path / "t.csv"));
  struct stat status {};
  ASSERT_EQ(::stat((folder.path / "t.csv.sealed").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  EXPECT_EQ(read_sealed_file(folder.path, "t.csv", *seal, text.size()), text);
  EXPECT_THAT(complaint([&] { read_sealed_file(folder.path, "t.csv", *seal, 100); }), HasSubstr("more than 100 bytes"));
  write_file_atomically({folder.path / "empty", seal.get()}, "");
  EXPECT_EQ(read_sealed_file(folder.path, "empty", *seal, 0), "");
  std::filesystem::resize_file(folder.path / "t.csv.sealed", 190000);
  EXPECT_THAT(complaint([&] { read_sealed_file(folder.path, "t.csv", *seal, text.size()); }), HasSubstr("ends before its end"));
  folder.write("t.csv.sealed", "nonsense");
  EXPECT_THAT(complaint([&] { read_sealed_file(folder.path, "t.csv", *seal, text.size()); }), HasSubstr("was changed at byte 0"));
}

TEST_F(SealTest, AGrowingFileIsReadableUpToItsLastFlush) {
  const TemporaryFolder folder;
  const auto file = seal_files(key.public_half)(folder.path, "log");
  const std::string text(100'000, 'z');
  file->append(std::as_bytes(std::span(text)));
  file->flush();
  file->append(std::as_bytes(std::span(text)));
  const auto opened = open_seal(folder.path, key);
  SealedReader reader(folder.path, "log", *opened);
  std::size_t sum = 0;
  for (std::string chunk; reader.next(chunk);) sum += chunk.size();
  EXPECT_GE(sum, text.size());
  EXPECT_EQ(reader.end(), SealEnd::cut);
  file->close();
  EXPECT_EQ(read_sealed_file(folder.path, "log", *opened, 1 << 20).size(), 2 * text.size());
  EXPECT_NE(complaint([&] { seal_files(key.public_half)(folder.path, "log"); }), "") << "never over something that is there";
}

TEST_F(SealTest, AFullDiskLeavesWhatWasWhole) {
  const TemporaryFolder folder;
  if (::mount("booth-test", folder.path.c_str(), "tmpfs", 0, "size=400k") != 0) GTEST_SKIP() << "skipped: no file system can be mounted here (root is needed)";
  {
    const auto file = seal_files(key.public_half)(folder.path, "t");
    const std::string text(10'000, 'z');
    std::string said;
    for (int i = 0; i < 100 && said.empty(); ++i) said = complaint([&] { file->append(std::as_bytes(std::span(text))); });
    EXPECT_THAT(said, HasSubstr("check the disk's space"));
    EXPECT_THAT(complaint([&] { file->flush(); }), HasSubstr("nothing more goes into it"));
    file->close();
    const auto opened = open_seal(folder.path, key);
    SealedReader reader(folder.path, "t", *opened);
    std::size_t sum = 0;
    for (std::string chunk; reader.next(chunk);) sum += chunk.size();
    EXPECT_GE(sum, 4 * kSealChunk);
    EXPECT_EQ(reader.end(), SealEnd::cut);
    EXPECT_EQ(file->bytes(), std::filesystem::file_size(folder.path / "t.sealed")) << "no half chunk";
  }
  ::umount2(folder.path.c_str(), MNT_DETACH);
}

TEST(SealKeys, AsTextAndBack) {
  const PrivateKey key = make_private_key();
  EXPECT_EQ(parse_public_key(to_text(key.public_half), "p").bytes, key.public_half.bytes);
  EXPECT_EQ(parse_private_key(to_text(key), "p").public_half.bytes, key.public_half.bytes);
  EXPECT_THAT(complaint([&] { parse_public_key(to_text(key), "p"); }), HasSubstr("p: is the private half of a key, wanted is the public one"));
  EXPECT_THAT(complaint([&] { parse_private_key(to_text(key.public_half), "p"); }), HasSubstr("wanted is the private one"));
  const std::string good = to_text(key.public_half);
  for (const std::string& bad : {std::string(), std::string("boothd-public-1"), std::string("boothd-public-1 12"), good.substr(0, good.size() - 3), good + good,
                                 std::string(4000, 'f'), std::string("boothd-public-1 ") + std::string(64, 'g')})
    EXPECT_THAT(complaint([&] { parse_public_key(bad, "p"); }), HasSubstr("p: ")) << bad.substr(0, 40);
}

TEST(SealKeys, ASecretIsMadeAndReadWithCare) {
  const TemporaryFolder folder;
  const std::string base = (folder.path / "booth").string();
  const PrivateKey key = write_new_keys(base);
  struct stat status {};
  ::stat((base + ".private").c_str(), &status);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  EXPECT_EQ(read_private_key(base + ".private").public_half.bytes, key.public_half.bytes);
  EXPECT_EQ(read_public_key(base + ".public").bytes, key.public_half.bytes);
  EXPECT_THAT(complaint([&] { write_new_keys(base); }), HasSubstr("File exists"));
  EXPECT_EQ(read_private_key(base + ".private").public_half.bytes, key.public_half.bytes) << "the old one is untouched";
  ::chmod((base + ".private").c_str(), 0644);
  EXPECT_THAT(complaint([&] { read_private_key(base + ".private"); }), HasSubstr("chmod 600"));
  EXPECT_THAT(complaint([&] { read_private_key(folder.path); }), HasSubstr("no regular file"));
  EXPECT_THAT(complaint([&] { read_public_key(folder.path / "none"); }), HasSubstr("No such file"));
}

TEST(SealKeys, TheCredentialStoreIsLookedIntoLast) {
  const TemporaryFolder folder;
  const PrivateKey key = write_new_keys((folder.path / "k").string());
  ::unsetenv("CREDENTIALS_DIRECTORY");
  EXPECT_THAT(complaint([] { find_private_key(""); }), HasSubstr("--key FILE"));
  std::filesystem::create_directory(folder.path / "store");
  std::filesystem::rename(folder.path / "k.private", folder.path / "store" / "boothd-private-key");
  ::setenv("CREDENTIALS_DIRECTORY", (folder.path / "store").c_str(), 1);
  EXPECT_EQ(find_private_key("").public_half.id(), key.public_half.id());
  ::unsetenv("CREDENTIALS_DIRECTORY");
}

TEST(SealKeys, ABadPointIsRefusedBeforeAnythingIsWritten) {
  PublicKey zero;  // of small order: a secret shared with it is no secret
  EXPECT_THAT(complaint([&] { Seal::fresh(zero); }), HasSubstr("no point of the curve"));
}

}  // namespace
}  // namespace booth::daemon
