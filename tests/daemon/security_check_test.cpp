// What doctor says of the credentials on DDS: each trouble by its name, with its remedy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/health/checks.hpp"
#include "tests/daemon/security/test_fleet.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;

struct SecurityCheck : ::testing::Test {
  SecurityCheck() {
    in.config.booth.id = "lobby";
    in.config.dds.security = "on";
    in.config.dds.self_issued = (fleet.folder.path / "own").string();
    in.root = fleet.folder.path / "root";
  }
  Check only(const Checks& checks) const {
    EXPECT_EQ(checks.size(), 1u);
    return checks.empty() ? Check{} : checks.front();
  }
  Check examined() const { return only(check_security(in)); }

  tests::TestFleet fleet;
  DoctorInputs in;
};

TEST_F(SecurityCheck, SaysWhoseCredentialsAndUntilWhen) {
  in.config.dds.credentials = fleet.booth("lobby");
  const Check check = examined();
  EXPECT_EQ(check.result, CheckResult::ok) << check.seen;
  EXPECT_THAT(check.seen, HasSubstr("booth.lobby, until 20"));
}

TEST_F(SecurityCheck, HasNothingToLookAtWhereSecurityIsOff) {
  in.config.dds.security = "off";
  EXPECT_EQ(examined().result, CheckResult::skipped);
  in.config.dds.security = "on";
  in.config.dds.enabled = false;
  EXPECT_EQ(examined().result, CheckResult::skipped);
}

TEST_F(SecurityCheck, FindsCredentialsOfAnotherBooth) {
  in.config.dds.credentials = fleet.booth("hall");
  const Check check = examined();
  EXPECT_EQ(check.result, CheckResult::error);
  EXPECT_THAT(check.seen, HasSubstr("booth.hall"));
  EXPECT_FALSE(check.advice.empty());
}

TEST_F(SecurityCheck, FindsAFolderWithoutThem) {
  in.config.dds.credentials = (fleet.folder.path / "nowhere").string();
  EXPECT_EQ(examined().result, CheckResult::error);
}

TEST_F(SecurityCheck, FindsAKeyThatOthersCanRead) {
  in.config.dds.credentials = fleet.booth("lobby");
  ASSERT_EQ(::chmod((in.config.dds.credentials + "/key.pem").c_str(), 0644), 0);
  const Check check = examined();
  EXPECT_EQ(check.result, CheckResult::error);
  EXPECT_THAT(check.seen, HasSubstr("chmod 600"));
}

TEST_F(SecurityCheck, ComplainsInTimeBeforeTheyExpireAndAfterwards) {
  const auto issued = [&](const std::string& name, std::int64_t days) {
    return issue(fleet.path, {.role = Role::booth, .name = name, .booths = {}, .days = days}, fleet.now - tests::TestFleet::kAge).string();
  };
  in.config.dds.credentials = issued("lobby", 40);  // made twenty days ago
  EXPECT_EQ(examined().result, CheckResult::warning);
  EXPECT_THAT(examined().advice, HasSubstr("--renew"));
  in.config.booth.id = "hall";
  in.config.dds.credentials = issued("hall", 10);
  EXPECT_EQ(examined().result, CheckResult::error);
  EXPECT_THAT(examined().seen, HasSubstr("expired"));
}

TEST_F(SecurityCheck, WithoutAnyBoothdMakesItsOwn) {
  EXPECT_EQ(examined().result, CheckResult::ok);
  EXPECT_THAT(examined().seen, HasSubstr("makes its own"));
}

TEST_F(SecurityCheck, CredentialsThatNobodyDeliversAreFound) {
  const std::filesystem::path place = in.root / "etc/boothd/credentials";
  std::filesystem::create_directories(place.parent_path());
  std::filesystem::copy(fleet.booth("lobby"), place);
  const Checks without = check_security(in);
  ASSERT_EQ(without.size(), 2u);
  EXPECT_EQ(without.front().result, CheckResult::ok) << without.front().seen;
  EXPECT_EQ(without.back().result, CheckResult::error);
  EXPECT_THAT(without.back().advice, HasSubstr("dds-security.conf"));

  std::filesystem::create_directories(in.root / "etc/systemd/system/boothd.service.d");
  std::filesystem::copy(BOOTH_SOURCE_DIR "/systemd/boothd.service.d/dds-security.conf", in.root / "etc/systemd/system/boothd.service.d/dds-security.conf");
  EXPECT_EQ(examined().result, CheckResult::ok) << "the installed example is what is looked for";
}

TEST_F(SecurityCheck, WhatThisUserMayNotReadIsNoFault) {
  if (::geteuid() == 0) GTEST_SKIP() << "skipped: root may read everything";
  in.config.dds.credentials = fleet.booth("lobby");
  ASSERT_EQ(::chmod((in.config.dds.credentials + "/key.pem").c_str(), 0000), 0);
  EXPECT_EQ(examined().result, CheckResult::skipped);
}

}  // namespace
}  // namespace booth::daemon
