// A session is interrupted at every single system call that touches its files, and each of them is made to fail in turn: what is left is always whole.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "daemon/record/session_log.hpp"
#include "daemon/record/session_reader.hpp"
#include "daemon/seal/sealed_file.hpp"
#include "tests/daemon/record/session_samples.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using tests::read_text;
using tests::sample_frames;
using tests::sample_info;
using tests::sample_models;

constexpr std::uint64_t kFrames = 12;

#if defined(__x86_64__)  // the calls of a traced child, whose numbers and registers are x86's
/// A whole session in a child process, sealed where there is a key to seal it to. Returns 0 when it says that all is well.
int run_session(const fs::path& directory, const PublicKey* seal_to) {
  try {
    SessionInfo info = sample_info();
    const auto seal = seal_to ? Seal::fresh(*seal_to) : nullptr;
    const fs::path folder = create_session_folder(directory, info, seal.get());
    SessionLog log;
    log.open(folder, seal.get());
    for (const auto& f : sample_frames(kFrames)) log.append(f);
    log.close();
    info.result = log.problem().empty() ? "complete" : "interrupted";  // as the controller does
    finish_session(folder, info, read_session_log(folder, seal.get()), sample_models(), nullptr, seal.get());
    return log.problem().empty() ? 0 : 2;
  } catch (const std::exception&) {
    return 1;  // live only, with an alarm
  }
}

bool touches_files(unsigned long long call) {
  static const std::set<unsigned long long> calls{SYS_write,    SYS_openat, SYS_fsync,  SYS_fdatasync, SYS_rename, SYS_unlink,
                                                  SYS_unlinkat, SYS_mkdir,  SYS_fchmod, SYS_close,     SYS_rmdir,  SYS_renameat};
  return calls.contains(call);
}

struct Outcome {
  int calls = 0;     ///< that touch files
  bool hit = false;  ///< the one that was asked for came
  int status = -1;   ///< of the child; -1: it was killed
};

/// Lets the child run to its `at`-th system call that touches files (counted over all its threads), and there kills it (error 0) or makes the call fail.
Outcome run_traced(const fs::path& directory, int at, int error, const PublicKey* seal_to) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
    ::raise(SIGSTOP);
    ::_exit(run_session(directory, seal_to));
  }
  Outcome out;
  if (child < 0) return out;  // and never kill(-1), which means everybody
  int status = 0;
  ::waitpid(child, &status, 0);
  if (!WIFSTOPPED(status) || ::ptrace(PTRACE_SETOPTIONS, child, nullptr, PTRACE_O_TRACESYSGOOD | PTRACE_O_TRACECLONE | PTRACE_O_EXITKILL) != 0) {
    ::kill(child, SIGKILL);
    ::waitpid(child, &status, 0);
    return out;
  }
  ::ptrace(PTRACE_SYSCALL, child, nullptr, nullptr);
  std::map<pid_t, bool> inside;  // a thread between the entry and the exit of a call
  pid_t failing = 0;
  while (true) {
    const pid_t thread = ::waitpid(-1, &status, __WALL);
    if (thread < 0) return out;
    if (WIFEXITED(status) || WIFSIGNALED(status)) {
      if (thread != child) continue;
      if (WIFEXITED(status)) out.status = WEXITSTATUS(status);
      return out;
    }
    int pass_on = 0;
    if (WIFSTOPPED(status) && WSTOPSIG(status) == (SIGTRAP | 0x80)) {
      user_regs_struct registers{};
      ::ptrace(PTRACE_GETREGS, thread, nullptr, &registers);
      bool& in = inside[thread];
      in = !in;
      if (in && touches_files(registers.orig_rax) && out.calls++ == at) {
        out.hit = true;
        if (error == 0) {
          ::kill(child, SIGKILL);
          continue;
        }
        // No call of that number: the kernel does nothing, and the answer is put in at the exit.
        registers.orig_rax = static_cast<unsigned long long>(-1);
        ::ptrace(PTRACE_SETREGS, thread, nullptr, &registers);
        failing = thread;
      } else if (!in && failing == thread) {
        registers.rax = static_cast<unsigned long long>(-error);
        ::ptrace(PTRACE_SETREGS, thread, nullptr, &registers);
        failing = 0;
      }
    } else if (WIFSTOPPED(status) && WSTOPSIG(status) != SIGTRAP && WSTOPSIG(status) != SIGSTOP) {
      pass_on = WSTOPSIG(status);
    }
    ::ptrace(PTRACE_SYSCALL, thread, nullptr, pass_on);
  }
}

/// After the next start: every session is complete or marked interrupted, and no file is half.
void expect_whole(const fs::path& directory, const std::string& where, const PrivateKey* key) {
  close_interrupted_sessions(directory, sample_models());
  for (const auto& entry : fs::directory_iterator(directory)) {
    const fs::path folder = entry.path();
    ASSERT_FALSE(folder.filename().string().starts_with(".")) << where << ": " << folder << " was left";
    const auto j = nlohmann::json::parse(read_text(folder / "session.json"), nullptr, false);
    ASSERT_TRUE(j.is_object()) << where;
    EXPECT_TRUE(j["result"] == "complete" || j["result"] == "interrupted") << where << ": " << j["result"];
    for (const auto& file : fs::directory_iterator(folder))
      EXPECT_EQ(file.path().filename().string().find(".part"), std::string::npos) << where << ": " << file.path() << " was left";
    const auto seal = key ? open_seal(folder, *key) : nullptr;
    const SessionContents session = read_session(folder, seal.get());
    EXPECT_LE(session.frames.size(), kFrames) << where;
    if (j["result"] == "complete") {
      EXPECT_EQ(session.frames.size(), kFrames) << where;
      for (const char* name : {"skeleton.csv", "skeleton.bvh", "body.glb", "body.ply", "measurements.json"})
        EXPECT_TRUE(fs::exists(folder / (key ? std::string(name) + kSealedEnding : std::string(name)))) << where << name;
    }
    EXPECT_EQ(j["frames"], session.frames.size()) << where;
  }
}

/// Plain and sealed.
struct PowerCut : ::testing::TestWithParam<bool> {
  void SetUp() override {
    (void)sample_models();  // before the fork
    const tests::TemporaryFolder folder;
    const Outcome whole = run(folder.path, 1'000'000, 0);
    if (whole.calls == 0) GTEST_SKIP() << "skipped: a process may not trace its children here";
    ASSERT_EQ(whole.status, 0);
    calls = whole.calls;
    ASSERT_GT(calls, 40) << "the session's files are not written by the calls that this test knows";
  }
  Outcome run(const fs::path& directory, int at, int error) const { return run_traced(directory, at, error, GetParam() ? &key.public_half : nullptr); }
  void expect_whole_after(const fs::path& directory, const std::string& where) const { expect_whole(directory, where, GetParam() ? &key : nullptr); }
  const PrivateKey key = make_private_key();
  int calls = 0;
};
INSTANTIATE_TEST_SUITE_P(Session, PowerCut, ::testing::Bool(), [](const auto& i) { return std::string(i.param ? "Sealed" : "Plain"); });

TEST_P(PowerCut, AtEveryCall) {
  int interrupted = 0;
  for (int at = 0; at < calls + 3; ++at) {
    const tests::TemporaryFolder folder;
    const Outcome outcome = run(folder.path, at, 0);
    expect_whole_after(folder.path, "killed at call " + std::to_string(at));
    interrupted += outcome.hit;
    if (HasFailure()) return;
  }
  EXPECT_GE(interrupted, calls - 3) << "threads may make a few calls more or less";
}

TEST_P(PowerCut, EveryCallFails) {
  int failures = 0;
  for (const int error : {ENOSPC, EROFS})
    for (int at = 0; at < calls; at += error == ENOSPC ? 1 : 3) {
      const tests::TemporaryFolder folder;
      const Outcome outcome = run(folder.path, at, error);
      EXPECT_NE(outcome.status, -1) << "call " << at << " with error " << error << " ended the process";
      failures += outcome.status > 0;
      expect_whole_after(folder.path, "call " + std::to_string(at) + " failed with " + std::to_string(error));
      if (HasFailure()) return;
    }
  EXPECT_GT(failures, 20) << "who is not told of failures cannot raise an alarm";
}
#endif

TEST(FullDisk, CostsTheSessionAndNotTheDaemonAndPasses) {
  const tests::TemporaryFolder folder;
  if (::mount("booth-test", folder.path.c_str(), "tmpfs", 0, "size=96k") != 0) GTEST_SKIP() << "skipped: no file system can be mounted here (root is needed)";
  {
    std::ofstream(folder.path / "filler") << std::string(60'000, 'x');
    SessionInfo info = sample_info();
    const fs::path session = create_session_folder(folder.path, info);
    SessionLog log;
    log.open(session);
    for (const auto& f : sample_frames(100)) log.append(f);
    log.close();
    EXPECT_THAT(log.problem(), HasSubstr("cannot be written"));
    EXPECT_GT(log.lost(), 0u);
    info.result = "complete";
    EXPECT_THROW(finish_session(session, info, read_session_log(session), sample_models(), nullptr), std::runtime_error);
    EXPECT_EQ(nlohmann::json::parse(read_text(session / "session.json"))["result"], "running") << "what was there before is still whole";
    // Room again, and the next start saves what there is.
    fs::remove(folder.path / "filler");
    EXPECT_EQ(::mount("booth-test", folder.path.c_str(), "tmpfs", MS_REMOUNT, "size=8m"), 0);
    const auto said = close_interrupted_sessions(folder.path, sample_models());
    EXPECT_EQ(said.size(), 1u);
    EXPECT_EQ(nlohmann::json::parse(read_text(session / "session.json"))["result"], "interrupted");
    EXPECT_GT(read_session(session).frames.size(), 0u);
  }
  ::umount2(folder.path.c_str(), MNT_DETACH);
}

}  // namespace
}  // namespace booth::daemon
