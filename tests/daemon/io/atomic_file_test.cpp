// A file is whole or not there.
#include "daemon/io/atomic_file.hpp"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include "daemon/io/file_bytes.hpp"
#include "tests/daemon/io/scratch_folder.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using tests::message_of;
using tests::ScratchFolder;

TEST(AtomicFile, AppearsOnlyWhenCommitted) {
  ScratchFolder folder;
  const auto path = folder / "a.txt";
  AtomicFile file(path);
  file.write("half");
  file.flush();
  EXPECT_FALSE(std::filesystem::exists(path));
  file.write(" and half");
  file.commit();
  EXPECT_EQ(ScratchFolder::get(path), "half and half");
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(AtomicFile, AbandonedLeavesTheOldContentsAndNothingElse) {
  ScratchFolder folder;
  const auto path = folder.put("a.txt", "old");
  {
    AtomicFile file(path);
    file.write("new");
  }
  EXPECT_EQ(ScratchFolder::get(path), "old");
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(AtomicFile, KeepsEveryByteAcrossTheBuffersEdge) {
  ScratchFolder folder;
  std::string contents(200'000, 'x');
  for (std::size_t i = 0; i < contents.size(); ++i) contents[i] = static_cast<char>(i * 31 % 251);
  AtomicFile file(folder / "big");
  for (std::size_t at = 0, n = 1; at < contents.size(); at += n, n = n * 3 % 9973 + 1) file.write(std::string_view(contents).substr(at, n));
  file.commit();
  EXPECT_TRUE(ScratchFolder::get(folder / "big") == contents);
}

TEST(AtomicFile, HasTheModeAskedFor) {
  ScratchFolder folder;
  write_file_atomically(folder / "secret", "x", 0600);
  EXPECT_EQ(std::filesystem::status(folder / "secret").permissions(), std::filesystem::perms(0600));
}

TEST(AtomicFile, NamesThePathAndTheReason) {
  ScratchFolder folder;
  const std::string text = message_of([&] { write_file_atomically(folder / "no" / "a.txt", "x"); });
  EXPECT_THAT(text, HasSubstr((folder / "no" / "a.txt").string()));
  EXPECT_THAT(text, HasSubstr("No such file or directory"));
}

TEST(AtomicFile, RefusesAFolderThatCannotBeWritten) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  ScratchFolder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  EXPECT_THAT(message_of([&] { write_file_atomically(folder / "a.txt", "x"); }), HasSubstr("Permission denied"));
}

/// In a process of its own: exit status 0 when the write failed as it should and left nothing behind.
[[noreturn]] void write_beyond_the_limit(const ScratchFolder& folder) {
  const rlimit limit = {1000, 1000};
  ::signal(SIGXFSZ, SIG_IGN);
  ::setrlimit(RLIMIT_FSIZE, &limit);
  const std::string text = message_of([&] { write_file_atomically(folder / "a.txt", std::string(5000, 'x')); });
  const bool said = text.find("cannot write") != std::string::npos && text.find("File too large") != std::string::npos;
  std::_Exit(said && folder.entries() == 0 ? 0 : 1);
}

// A full disk is hard to come by in a test; the kernel's limit on file size fails the same system call.
TEST(AtomicFile, SaysWhenAWriteFailsAndRemovesWhatItBegan) {
  ScratchFolder folder;
  EXPECT_EXIT(write_beyond_the_limit(folder), ::testing::ExitedWithCode(0), "");
}

TEST(FileBytes, ReadsAllOrSaysWhy) {
  ScratchFolder folder;
  EXPECT_EQ(read_file_bytes(folder.put("a", std::string("x\0y", 3)), 10), std::string("x\0y", 3));
  EXPECT_THAT(message_of([&] { read_file_bytes(folder.put("b", "12345"), 4); }), HasSubstr("at most 4"));
  EXPECT_THAT(message_of([&] { read_file_bytes(folder.path(), 4); }), HasSubstr("it is a folder"));
  EXPECT_THAT(message_of([&] { read_file_bytes(folder / "none", 4); }), HasSubstr("No such file"));
  EXPECT_THAT(message_of([&] { read_file_bytes("/dev/zero", 4); }), HasSubstr("not a regular file"));
}

}  // namespace
}  // namespace booth::daemon
