// Interfaces by name and by address, as this machine has them: loopback is everywhere.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "daemon/dds/network_there.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;

TEST(NetworkThere, ByNameAndByAddress) {
  EXPECT_TRUE(NetworkThere("lo").there());
  EXPECT_TRUE(NetworkThere("127.0.0.1").there());
  EXPECT_FALSE(NetworkThere("nosuch0").there());
  EXPECT_FALSE(NetworkThere("127.0.0.99").there());
  EXPECT_TRUE(NetworkThere("fe80::1").there()) << "of IPv6 nothing is known here";
  EXPECT_THAT(NetworkThere("nosuch0").sentence(), HasSubstr("no interface nosuch0"));
}

/// As root, or as who is root in a user namespace of his own.
bool own_network() {
  const uid_t user = ::getuid();
  if (::unshare(CLONE_NEWNET) == 0) return true;
  if (::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return false;
  return bool(std::ofstream("/proc/self/uid_map") << "0 " << user << " 1" << std::flush);
}

/// In the child of a fork: a network with one interface that is up, has an address, and whose other end is down. False where there can be none.
bool cable_to_nowhere() {
  return own_network() &&
         std::system(
             "{ ip link add cable9 type veth peer name nowhere9 && ip address add 192.0.2.9/24 dev cable9 && ip link set cable9 up; } >/dev/null 2>&1") == 0;
}

TEST(NetworkThere, WithoutANameOnlyWhatHasACarrier) {
  enum { as_expected, by_name_missed, without_a_name_found, not_possible };
  const pid_t child = ::fork();
  if (child == 0) {
    if (!cable_to_nowhere()) std::_Exit(not_possible);
    if (!NetworkThere("cable9").there() || !NetworkThere("192.0.2.9").there()) std::_Exit(by_name_missed);
    std::_Exit(NetworkThere("").there() ? without_a_name_found : as_expected);
  }
  ASSERT_GT(child, 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == not_possible) GTEST_SKIP() << "skipped: this kernel, or a missing program ip, allows no network of its own here";
  EXPECT_EQ(WEXITSTATUS(status), as_expected);
}

}  // namespace
}  // namespace booth::daemon
