// Authorities for one run.
#include "tests/bench/dds/bench_identity.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <stdexcept>

#include "daemon/io/atomic_file.hpp"
#include "daemon/security/rights.hpp"
#include "daemon/security/signed_document.hpp"

namespace booth::bench {

BenchIdentity::BenchIdentity() {
  std::string name = (std::filesystem::temp_directory_path() / "booth-bench-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder for the credentials");
  folder_ = name;
  const std::int64_t now = daemon::utc_seconds();
  const daemon::Validity valid{now - 3600, now + daemon::kSecondsOfDay};
  const daemon::PemPair authority = daemon::make_authority("bench", valid), pair = daemon::issue_certificate(authority, "bench", valid);
  const std::vector<daemon::TopicRule> everything{{true, {"*"}, {"*"}}, {false, {"*"}, {"*"}}, {true, {"*"}, {}}, {false, {"*"}, {}}};
  identity = std::make_shared<const daemon::DdsIdentity>(
      daemon::DdsIdentity{.identity_ca = authority.certificate,
                          .certificate = pair.certificate,
                          .private_key = pair.key,
                          .permissions_ca = authority.certificate,
                          .governance = daemon::sign_document(daemon::governance_xml(), authority),
                          .permissions = daemon::sign_document(daemon::permissions_xml("bench", everything, valid), authority)});
  daemon::write_file_atomically(folder_ / "ca", identity->identity_ca, 0600);
  daemon::write_file_atomically(folder_ / "cert", identity->certificate, 0600);
  daemon::write_file_atomically(folder_ / "key", identity->private_key, 0600);
  daemon::write_file_atomically(folder_ / "governance", identity->governance, 0600);
  daemon::write_file_atomically(folder_ / "permissions", identity->permissions, 0600);
}

BenchIdentity::~BenchIdentity() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::string BenchIdentity::secured(const std::string& configuration) const {
  const auto library = [](const char* path, const char* name) {
    return fmt::format("<Library path=\"{}\" initFunction=\"init_{}\" finalizeFunction=\"finalize_{}\"/>", path, name, name);
  };
  const auto file = [&](const char* element, const char* name) { return fmt::format("<{0}>file:{1}</{0}>", element, (folder_ / name).string()); };
  const std::string security = "<Security><Authentication>" + library("dds_security_auth", "authentication") + file("IdentityCA", "ca") +
                               file("IdentityCertificate", "cert") + file("PrivateKey", "key") + "</Authentication><Cryptographic>" +
                               library("dds_security_crypto", "crypto") + "</Cryptographic><AccessControl>" + library("dds_security_ac", "access_control") +
                               file("PermissionsCA", "ca") + file("Governance", "governance") + file("Permissions", "permissions") +
                               "</AccessControl></Security>";
  std::string out = configuration;
  out.insert(out.find("</Domain>"), security);
  return out;
}

}  // namespace booth::bench
