// Interfaces by name and by address, as this machine has them: loopback is everywhere.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace booth::daemon
