// Credentials as files: what is written, what is refused, and whether the sentence names the file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <random>

#include "daemon/security/provision.hpp"
#include "tests/daemon/security/test_fleet.hpp"
#include "tests/support/complaint.hpp"

namespace booth::daemon {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using tests::complaint;
using tests::Craft;
using tests::read_text;
using tests::TestFleet;

constexpr const char* kFiles[] = {kIdentityAuthorityFile, kCertificateFile, kKeyFile, kPermissionsAuthorityFile, kGovernanceFile, kPermissionsFile};

int mode_of(const std::filesystem::path& path) {
  struct stat file {};
  return ::stat(path.c_str(), &file) == 0 ? static_cast<int>(file.st_mode & 07777) : -1;
}

/// Overwrites a file of somebody's folder, whatever its mode.
void put(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
  ::chmod(path.c_str(), 0600);
}

TEST(SecurityFleet, IsForItsOwnerOnly) {
  const TestFleet fleet;
  const std::filesystem::path booth = fleet.booth("lobby");
  EXPECT_EQ(mode_of(fleet.path), 0700);
  EXPECT_EQ(mode_of(fleet.path / kIdentityAuthorityKeyFile), 0600);
  EXPECT_EQ(mode_of(fleet.path / kPermissionsAuthorityKeyFile), 0600);
  EXPECT_EQ(mode_of(booth), 0700);
  EXPECT_EQ(mode_of(booth / kKeyFile), 0600);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(fleet.path))
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr(".part"))) << "temporary files are gone";
  EXPECT_FALSE(std::filesystem::exists(booth / kIdentityAuthorityKeyFile)) << "an authority's key never leaves the fleet's folder";
}

TEST(SecurityFleet, OverwritesNothing) {
  const TestFleet fleet;
  const std::string before = read_text(fleet.path / kIdentityAuthorityKeyFile);
  EXPECT_THAT(complaint([&] { make_fleet(fleet.path, "again", 10, fleet.now); }), HasSubstr("a fleet is never overwritten"));
  EXPECT_EQ(read_text(fleet.path / kIdentityAuthorityKeyFile), before);
  const std::string booth = fleet.booth("lobby"), key = read_text(booth + "/key.pem");
  EXPECT_THAT(complaint([&] { fleet.booth("lobby"); }), AllOf(HasSubstr(booth), HasSubstr("--renew")));
  EXPECT_EQ(read_text(booth + "/key.pem"), key);
}

TEST(SecurityFleet, RenewsUnderTheSameName) {
  const TestFleet fleet;
  const std::string booth = fleet.booth("lobby");
  const Credentials before = read_credentials(booth);
  issue(fleet.path, {.role = Role::booth, .name = "lobby", .booths = {}, .days = 50, .renew = true}, fleet.now);
  const Credentials after = read_credentials(booth);
  EXPECT_NE(after.certificate.serial, before.certificate.serial);
  EXPECT_EQ(after.certificate.name, "booth.lobby");
  EXPECT_EQ(after.certificate.valid.until, fleet.now + 50 * kSecondsOfDay);
  int folders = 0;
  for (const auto& entry : std::filesystem::directory_iterator(fleet.path / kIssuedFolder)) folders += entry.is_directory();
  EXPECT_EQ(folders, 1) << "the old key lies nowhere";
}

TEST(SecurityFleet, RefusesOrdersThatMakeNoSense) {
  const TestFleet fleet;
  const auto order = [&](Role role, const std::string& name, std::vector<std::string> booths, std::int64_t days = 10) {
    return complaint([&] { issue(fleet.path, {.role = role, .name = name, .booths = std::move(booths), .days = days}, fleet.now); });
  };
  EXPECT_THAT(order(Role::viewer, "wall", {}), HasSubstr("needs the booths"));
  EXPECT_THAT(order(Role::viewer, "../x", {"*"}), HasSubstr("is no name"));
  EXPECT_THAT(order(Role::viewer, "wall", {"<a/>"}), HasSubstr("is no name"));
  EXPECT_THAT(order(Role::booth, "", {}), HasSubstr("is no name"));
  EXPECT_THAT(order(Role::booth, "lobby", {}, 0), HasSubstr("days of validity"));
  EXPECT_THAT(complaint([&] { issue(fleet.folder.path, {.role = Role::booth, .name = "lobby", .booths = {}}, fleet.now); }),
              HasSubstr("boothctl security init"));
  EXPECT_THAT(complaint([&] { issue(fleet.path, {.role = Role::booth, .name = "lobby", .booths = {}}, fleet.now + 4000 * kSecondsOfDay); }),
              HasSubstr("the authorities"));
  EXPECT_TRUE(std::filesystem::is_empty(fleet.path / kIssuedFolder));
}

TEST(SecurityFleet, NobodyOutlivesTheAuthorities) {
  const TestFleet fleet;
  const auto place = issue(fleet.path, {.role = Role::booth, .name = "old", .booths = {}, .days = 36000}, fleet.now);
  const Credentials credentials = read_credentials(place);
  const std::int64_t end = read_certificate(credentials.identity->identity_ca).valid.until;
  for (const auto& part : credentials.parts) EXPECT_LE(part.valid.until, end) << part.what;
}

TEST(SecurityRights, AreTheLeast) {
  for (const auto& rule : rules_for(Role::viewer, {"*"})) EXPECT_FALSE(rule.publish) << "a viewer says nothing";
  for (const auto& rule : rules_for(Role::viewer, {"lobby"})) EXPECT_THAT(rule.partitions, ElementsAre("lobby"));
  for (const auto& rule : rules_for(Role::booth, {"lobby"})) {
    if (rule.publish) {
      EXPECT_THAT(rule.topics, Not(Contains(HasSubstr("command"))));
    } else {
      EXPECT_THAT(rule.topics, Each(HasSubstr("booth/command"))) << "a booth hears commands and nothing else";
    }
  }
  for (const auto& rule : rules_for(Role::console, {"lobby", "hall"})) {
    const std::string only = rule.publish ? "booth/command" : "booth/";
    EXPECT_THAT(rule.topics, Each(HasSubstr(only)));
  }
}

TEST(SecurityRights, AreReadBackAsTheyWereWritten) {
  const Validity valid{1'800'000'000, 1'900'000'000};
  const PermissionFacts facts = read_permissions(permissions_xml("console.desk", rules_for(Role::console, {"lobby", "hall"}), valid));
  EXPECT_EQ(facts.subject, "CN=console.desk");
  EXPECT_EQ(facts.valid.from, valid.from);
  EXPECT_EQ(facts.valid.until, valid.until);
  EXPECT_TRUE(facts.denies_the_rest);
  ASSERT_EQ(facts.rules.size(), 2u);
  EXPECT_TRUE(facts.rules[0].publish);
  EXPECT_THAT(facts.rules[0].topics, ElementsAre("booth/command*"));
  EXPECT_THAT(facts.rules[0].partitions, ElementsAre("lobby", "hall"));
  EXPECT_THAT(governance_weaknesses(governance_xml()), IsEmpty());
}

TEST(SecurityRights, AWeakerGovernanceIsFoundOut) {
  std::string xml = governance_xml();
  const auto change = [&](const std::string& from, const std::string& to) { xml.replace(xml.find(from), from.size(), to); };
  change("<allow_unauthenticated_participants>false", "<allow_unauthenticated_participants>true");
  change("<metadata_protection_kind>ENCRYPT_WITH_ORIGIN_AUTHENTICATION", "<metadata_protection_kind>NONE");
  EXPECT_EQ(governance_weaknesses(xml).size(), 2u);
}

TEST(SecurityDocument, IsRefusedWhenChanged) {
  const TestFleet fleet;
  const PemPair authority = fleet.permissions();
  const std::string document = sign_document("<dds>abc</dds>\n", authority);
  EXPECT_THAT(open_document(document, authority.certificate), HasSubstr("<dds>abc</dds>"));
  std::string changed = document;
  changed.replace(changed.find("abc"), 3, "abd");
  EXPECT_THAT(complaint([&] { open_document(changed, authority.certificate); }), HasSubstr("was changed afterwards"));
  EXPECT_THAT(complaint([&] { open_document(document, fleet.identities().certificate); }), HasSubstr("was not signed by"));
  for (const char* nonsense : {"", "MIME-Version: 1.0\n\n", "<dds/>"})
    EXPECT_THAT(complaint([&] { open_document(nonsense, authority.certificate); }), HasSubstr("is not a signed document")) << nonsense;
}

TEST(SecurityCredentials, AMissingFileIsNamed) {
  for (const char* file : kFiles) {
    const TestFleet fleet;
    const std::filesystem::path place = fleet.booth("lobby");
    std::filesystem::remove(place / file);
    EXPECT_THAT(complaint([&] { read_credentials(place); }), HasSubstr((place / file).string()));
  }
}

TEST(SecurityCredentials, EachFileIsCheckedAgainstItsNeighbours) {
  const TestFleet fleet, stranger;
  const std::filesystem::path place = fleet.booth("lobby"), other = stranger.booth("lobby"), hall = fleet.booth("hall");
  const auto with = [&](const char* file, const std::filesystem::path& from) {
    const std::string old = read_text(place / file);
    put(place / file, read_text(from / file));
    const std::string out = complaint([&] { read_credentials(place); });
    put(place / file, old);
    return out;
  };
  EXPECT_THAT(with(kKeyFile, other), AllOf(HasSubstr("key.pem"), HasSubstr("is not the key of the certificate")));
  EXPECT_THAT(with(kIdentityAuthorityFile, other), AllOf(HasSubstr("/cert.pem"), HasSubstr("was not issued by")));
  EXPECT_THAT(with(kPermissionsFile, other), AllOf(HasSubstr("permissions.p7s"), HasSubstr("was not signed by")));
  EXPECT_THAT(with(kPermissionsFile, hall), AllOf(HasSubstr("permissions.p7s"), HasSubstr("is for CN=booth.hall")));
  EXPECT_THAT(with(kGovernanceFile, other), AllOf(HasSubstr("governance.p7s"), HasSubstr("was not signed by")));
  put(place / kIdentityAuthorityFile, read_text(place / kCertificateFile));
  EXPECT_THAT(complaint([&] { read_credentials(place); }), HasSubstr("is not the certificate of an authority"));
}

TEST(SecurityCredentials, AKeyThatOthersCanReadIsRefused) {
  const TestFleet fleet;
  const std::filesystem::path place = fleet.booth("lobby");
  ::chmod((place / kKeyFile).c_str(), 0640);
  EXPECT_THAT(complaint([&] { read_credentials(place); }), AllOf(HasSubstr("key.pem"), HasSubstr("chmod 600")));
}

TEST(SecurityCredentials, DatesAreAnswersAndNotCrashes) {
  const TestFleet fleet;
  const Credentials credentials = read_credentials(fleet.booth("lobby"));
  const std::int64_t until = credentials.first_to_expire().valid.until;
  EXPECT_EQ(complaint([&] { check_dates(credentials, until); }), "");
  EXPECT_THAT(complaint([&] { check_dates(credentials, until + 1); }), AllOf(HasSubstr("expired at"), HasSubstr("cert.pem")));
  for (const std::int64_t leapt : {std::int64_t{0}, until + 20 * 365 * kSecondsOfDay}) {
    try {
      check_dates(credentials, leapt);
      FAIL() << leapt << " was accepted";
    } catch (const CredentialError& e) {
      EXPECT_TRUE(e.may_pass) << "a clock that is set later mends it";
      EXPECT_THAT(e.what(), HasSubstr(leapt == 0 ? "set the clock" : "and this machine's clock says"));
    }
  }
  EXPECT_EQ(expiry_problem(credentials, until - 31 * kSecondsOfDay, 30), "");
  EXPECT_THAT(expiry_problem(credentials, until - 12 * kSecondsOfDay - 5, 30), HasSubstr("expires in 12 days"));
  EXPECT_THAT(expiry_problem(credentials, until + 5, 30), HasSubstr("expired on"));
  EXPECT_LE(expiry_problem(credentials, until + 5, 30).size(), 160u) << "it has to fit into a status";
}

TEST(SecurityCredentials, ARevokedCertificateIsRefused) {
  const TestFleet fleet;
  const std::filesystem::path place = fleet.booth("lobby");
  revoke(fleet.path, {read_credentials(place).certificate.serial}, fleet.now);
  EXPECT_EQ(complaint([&] { read_credentials(place); }), "") << "without the list it does not know";
  put(place / kRevocationsFile, read_text(fleet.path / kRevocationsFile));
  EXPECT_THAT(complaint([&] { read_credentials(place); }), HasSubstr("has been revoked"));
  EXPECT_EQ(complaint([&] { read_credentials(fleet.booth("hall")); }), "") << "who is issued later gets the list and is not on it";
  const TestFleet stranger;
  revoke(stranger.path, {"01"}, fleet.now);
  put(place / kRevocationsFile, read_text(stranger.path / kRevocationsFile));
  EXPECT_THAT(complaint([&] { read_credentials(place); }), HasSubstr("crl.pem: was not signed by"));
}

TEST(SecurityCredentials, WhateverIsInTheFilesTheAnswerIsASentence) {
  const TestFleet fleet;
  const std::filesystem::path place = fleet.booth("lobby");
  std::mt19937 random(7);
  int refused = 0;
  for (const char* file : kFiles) {
    const std::string good = read_text(place / file);
    std::vector<std::string> bad{"", std::string(1000, '\0'), good.substr(0, good.size() / 2), good + good, std::string((1 << 20) + 1, 'x')};
    for (int i = 0; i < 60; ++i) {
      std::string one = good;
      for (int k = 0; k < 3; ++k) one[random() % one.size()] = static_cast<char>(random());
      bad.push_back(one);
    }
    for (const auto& text : bad) {
      put(place / file, text);
      try {
        read_credentials(place);
      } catch (const CredentialError& e) {
        ++refused;
        EXPECT_THAT(e.what(), HasSubstr(place.string())) << "names a file";
      }
    }
    put(place / file, good);
  }
  EXPECT_GT(refused, 300);
  EXPECT_EQ(complaint([&] { read_credentials(place); }), "");
}

struct Provision : ::testing::Test {
  TestFleet fleet;
  CredentialQuery query{
      .role = Role::booth, .name = "lobby", .folder = {}, .delivered = {}, .self_issued = fleet.folder.path / "state" / "security", .may_issue = true};
  Provision() { std::filesystem::create_directories(fleet.folder.path / "state"); }
};

TEST_F(Provision, ABoothThatWasGivenNoneMakesItsOwnOnce) {
  const Credentials first = obtain_credentials(query, fleet.now), again = obtain_credentials(query, fleet.now);
  EXPECT_TRUE(first.self_issued);
  EXPECT_EQ(first.certificate.serial, again.certificate.serial);
  EXPECT_THAT(credentials_line(first), HasSubstr("self-issued, booth.lobby"));
  CredentialQuery local = query;
  local.may_issue = false;
  local.name = "";
  for (const Role role : {Role::viewer, Role::console}) {
    local.role = role;
    EXPECT_EQ(obtain_credentials(local, fleet.now).certificate.name, identity_name(role, "local"));
  }
  query.name = "renamed";
  EXPECT_EQ(obtain_credentials(query, fleet.now).certificate.name, "booth.renamed") << "of the same fleet";
}

TEST_F(Provision, SelfIssuedCredentialsAreRenewedInTime) {
  const Credentials first = obtain_credentials(query, fleet.now);
  const std::int64_t later = first.first_to_expire().valid.until - 10 * kSecondsOfDay;
  const Credentials renewed = obtain_credentials(query, later);
  EXPECT_NE(renewed.certificate.serial, first.certificate.serial);
  EXPECT_EQ(renewed.certificate.issuer, first.certificate.issuer);
  EXPECT_GT(renewed.first_to_expire().valid.until, later + 300 * kSecondsOfDay);
}

TEST_F(Provision, AClockThatLeaptAheadAndCameBackLeavesABoothThatStarts) {
  const Credentials first = obtain_credentials(query, fleet.now);
  const std::int64_t ahead = first.first_to_expire().valid.until + 100 * kSecondsOfDay;
  EXPECT_GT(obtain_credentials(query, ahead).certificate.valid.from, fleet.now + kSecondsOfDay) << "renewed, as far as it knew in time";
  const Credentials back = obtain_credentials(query, fleet.now + kSecondsOfDay);
  EXPECT_LE(back.certificate.valid.from, fleet.now + kSecondsOfDay);
  EXPECT_EQ(back.certificate.issuer, first.certificate.issuer);
}

TEST_F(Provision, WhatCannotBeRenewedServesOn) {
  const Credentials first = obtain_credentials(query, fleet.now);
  // Files must not grow, which needs no full disk.
  ::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit none{10, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &none);
  std::string warnings, complaint_of_new;
  bool may_pass = false;
  try {
    for (const auto& w : obtain_credentials(query, first.first_to_expire().valid.until - 10 * kSecondsOfDay).warnings) warnings += w;
    query.self_issued = fleet.folder.path / "state" / "other";
    obtain_credentials(query, fleet.now);
  } catch (const CredentialError& e) {
    complaint_of_new = e.what();
    may_pass = e.may_pass;
  }
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_THAT(warnings, HasSubstr("cannot be renewed"));
  EXPECT_THAT(complaint_of_new, HasSubstr("none can be made"));
  EXPECT_TRUE(may_pass) << "there may be room later";
}

TEST_F(Provision, NothingIsMadeWhileTheClockIsWrong) {
  try {
    obtain_credentials(query, 1000);
    FAIL() << "dated 1970";
  } catch (const CredentialError& e) {
    EXPECT_TRUE(e.may_pass);
  }
  EXPECT_FALSE(std::filesystem::exists(query.self_issued));
}

TEST_F(Provision, NamedBeforeDeliveredBeforeSelfIssued) {
  const std::filesystem::path issued = fleet.booth("lobby"), delivered = fleet.folder.path / "delivered";
  std::filesystem::create_directories(delivered);
  EXPECT_TRUE(obtain_credentials(query, fleet.now).self_issued);
  query.delivered = delivered;
  EXPECT_TRUE(obtain_credentials(query, fleet.now).self_issued) << "systemd delivered other things";
  for (const char* file : kFiles) put(delivered / (std::string(kSystemdPrefix) + file), read_text(issued / file));
  ::chmod((delivered / "boothd.key.pem").c_str(), 0440);  // what systemd's copies look like
  EXPECT_FALSE(obtain_credentials(query, fleet.now).self_issued);
  std::filesystem::remove(delivered / "boothd.cert.pem");
  EXPECT_THAT(complaint([&] { obtain_credentials(query, fleet.now); }), HasSubstr("boothd.cert.pem")) << "half of them is a mistake, not a reason for others";
  query.folder = fleet.folder.path / "nowhere";
  EXPECT_THAT(complaint([&] { obtain_credentials(query, fleet.now); }), HasSubstr("nowhere/identity_ca.cert.pem"));
  query.folder = issued;
  EXPECT_EQ(obtain_credentials(query, fleet.now).certificate.name, "booth.lobby");
}

TEST_F(Provision, AnotherBoothsCredentialsAreRefused) {
  query.folder = fleet.booth("hall");
  EXPECT_THAT(complaint([&] { obtain_credentials(query, fleet.now); }), HasSubstr("is the certificate of booth.hall, and booth.lobby is needed"));
  query.folder = fleet.console("desk", {"*"});
  EXPECT_THAT(complaint([&] { obtain_credentials(query, fleet.now); }), HasSubstr("console.desk"));
}

TEST_F(Provision, WithoutCredentialsAClientIsToldWhatToDo) {
  query.role = Role::viewer;
  query.may_issue = false;
  EXPECT_THAT(complaint([&] { obtain_credentials(query, fleet.now); }), AllOf(HasSubstr("viewer.local"), HasSubstr("--credentials")));
}

}  // namespace
}  // namespace booth::daemon
