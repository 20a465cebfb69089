// Certificates, lists, signed documents and their XML, of any bytes: facts, or one sentence; a document that was changed is never opened.
#include <stdexcept>
#include <string>

#include "daemon/security/certificates.hpp"
#include "daemon/security/rights.hpp"
#include "daemon/security/signed_document.hpp"
#include "daemon/security/utc_time.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::daemon;
using booth::fuzz::Input;
using booth::fuzz::require;

const PemPair& authority() {
  static const PemPair pair = make_authority("fuzz", {0, 4'000'000'000});
  return pair;
}
const PemPair& identity() {
  static const PemPair pair = issue_certificate(authority(), "viewer.wall", {0, 4'000'000'000});
  return pair;
}

template <class F>
void try_to(F action) {
  try {
    action();
  } catch (const std::runtime_error& e) {
    require(e.what()[0] != '\0', "what is wrong is said");
  }
}

void read_pem(const std::string& text) {
  try_to([&] { (void)read_certificate(text); });
  try_to([&] { (void)read_revocations(text, authority().certificate); });
  try_to([&] { (void)pair_objection(text, identity().key); });
  try_to([&] { (void)pair_objection(identity().certificate, text); });
  try_to([&] { (void)issuer_objection(text, authority().certificate); });
  try_to([&] { (void)issuer_objection(identity().certificate, text); });
}

void read_xml(const std::string& text) {
  try_to([&] {
    const PermissionFacts facts = read_permissions(text);
    for (const auto& rule : facts.rules) require(rule.topics.size() + rule.partitions.size() <= text.size(), "rules come from the text");
  });
  try_to([&] { (void)governance_weaknesses(text); });
  if (const auto utc = utc_of(text)) require(utc_of(utc_text(*utc)) == utc, "an instant reads back the same");
  if (const auto who = parse_identity_name(text)) require(identity_name(who->role, who->name) == text, "a name reads back the same");
}

/// One edit of a text that is right.
std::string edited(std::string text, Input& in) {
  const std::size_t at = in.u16() % text.size(), count = in.u8() % 64;
  const auto bytes = in.bytes(in.u8());
  return text.replace(at, std::min(count, text.size() - at), reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

void read_signed(Input& in) {
  static const std::string plain = permissions_xml("viewer.wall", rules_for(Role::viewer, {"lobby"}), {0, 2'000'000'000});
  static const std::string good = sign_document(plain, authority());
  static const std::string opened = open_document(good, authority().certificate);
  try_to([&] { require(open_document(edited(good, in), authority().certificate) == opened, "only what was signed is opened"); });
  read_xml(edited(plain, in));
  read_xml(edited(governance_xml(), in));
  read_pem(edited(identity().certificate, in));
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  const unsigned choice = in.u8() % 4;
  if (choice == 0) {
    read_signed(in);
    return 0;
  }
  const auto rest = in.bytes(size);
  const std::string text(reinterpret_cast<const char*>(rest.data()), rest.size());
  if (choice == 1) read_pem(text);
  if (choice == 2) read_xml(text);
  if (choice == 3) {
    try_to([&] { (void)open_document(text, authority().certificate); });
    try_to([&] { (void)open_document(sign_document("x", authority()), text); });
  }
  return 0;
}
