// X.509 version 3 with OpenSSL's calls.
#include "daemon/security/certificates.hpp"

#include <openssl/ec.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <stdexcept>

#include "daemon/security/openssl.hpp"

namespace booth::daemon {
namespace {

std::string pem_of(const Key& key) {
  const Bio out = empty_bio();
  if (PEM_write_bio_PKCS8PrivateKey(out.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr) != 1) openssl_failure("writing a key");
  return text_of(out);
}

std::string pem_of(const Certificate& certificate) {
  const Bio out = empty_bio();
  if (PEM_write_bio_X509(out.get(), certificate.get()) != 1) openssl_failure("writing a certificate");
  return text_of(out);
}

void add_extension(X509* to, X509* issuer, int which, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, to, nullptr, nullptr, 0);
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, which, value);
  const bool good = extension != nullptr && X509_add_ext(to, extension, -1) == 1;
  X509_EXTENSION_free(extension);
  if (!good) openssl_failure("adding an extension to a certificate");
}

/// 127 random bits: a serial number that nobody guesses and that never comes twice.
void set_random_serial(X509* certificate) {
  unsigned char bytes[16];
  if (RAND_bytes(bytes, sizeof bytes) != 1) openssl_failure("random numbers");
  bytes[0] = static_cast<unsigned char>((bytes[0] & 0x7F) | 0x40);
  BIGNUM* number = BN_bin2bn(bytes, sizeof bytes, nullptr);
  const bool good = number != nullptr && BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate)) != nullptr;
  BN_free(number);
  if (!good) openssl_failure("numbering a certificate");
}

void set_times(X509* certificate, const Validity& valid) {
  if (!ASN1_TIME_set(X509_getm_notBefore(certificate), valid.from) || !ASN1_TIME_set(X509_getm_notAfter(certificate), valid.until))
    openssl_failure("dating a certificate");
}

/// A certificate of `name` for `key` that lacks issuer, extensions and signature.
Certificate begin_certificate(const std::string& name, const Key& key, const Validity& valid) {
  Certificate out(X509_new());
  if (!out || X509_set_version(out.get(), X509_VERSION_3) != 1) openssl_failure("beginning a certificate");
  set_random_serial(out.get());
  set_times(out.get(), valid);
  if (X509_NAME_add_entry_by_txt(X509_get_subject_name(out.get()), "CN", MBSTRING_UTF8, reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0) != 1 ||
      X509_set_pubkey(out.get(), key.get()) != 1)
    openssl_failure("naming a certificate");
  return out;
}

Key make_key() {
  Key key(EVP_EC_gen("P-256"));
  if (!key) openssl_failure("making a key");
  return key;
}

std::string common_name(X509_NAME* name) {
  const int at = X509_NAME_get_index_by_NID(name, NID_commonName, -1);
  if (at < 0) return "";
  unsigned char* utf8 = nullptr;
  const int size = ASN1_STRING_to_UTF8(&utf8, X509_NAME_ENTRY_get_data(X509_NAME_get_entry(name, at)));
  if (size < 0) return "";
  std::string out(reinterpret_cast<const char*>(utf8), static_cast<std::size_t>(size));
  OPENSSL_free(utf8);
  return out;
}

std::string rfc2253(X509_NAME* name) {
  const Bio out = empty_bio();
  X509_NAME_print_ex(out.get(), name, 0, XN_FLAG_RFC2253);
  return text_of(out);
}

std::string hexadecimal(const ASN1_INTEGER* number) {
  BIGNUM* big = ASN1_INTEGER_to_BN(number, nullptr);
  char* text = big ? BN_bn2hex(big) : nullptr;
  std::string out = text ? text : "";
  OPENSSL_free(text);
  BN_free(big);
  return out;
}

std::int64_t seconds_of(const ASN1_TIME* time) {
  tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) throw std::runtime_error("has a date that cannot be read");
  return static_cast<std::int64_t>(::timegm(&parts));
}

Certificate needed(const std::string& pem) {
  Certificate out = certificate_of(pem);
  if (!out) openssl_failure("is not a certificate (PEM)");
  return out;
}

struct Authority {
  explicit Authority(const PemPair& pem) : certificate(needed(pem.certificate)), key(key_of(pem.key)) {
    if (!key) openssl_failure("the authority's key is not a private key (PEM)");
    if (X509_check_private_key(certificate.get(), key.get()) != 1) openssl_failure("the authority's key is not that of its certificate");
  }
  Certificate certificate;
  Key key;
};

}  // namespace

PemPair make_authority(const std::string& name, const Validity& valid) {
  const Key key = make_key();
  const Certificate out = begin_certificate(name, key, valid);
  if (X509_set_issuer_name(out.get(), X509_get_subject_name(out.get())) != 1) openssl_failure("naming an authority");
  add_extension(out.get(), out.get(), NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  // digitalSignature, because the permissions authority signs documents itself.
  add_extension(out.get(), out.get(), NID_key_usage, "critical,digitalSignature,keyCertSign,cRLSign");
  add_extension(out.get(), out.get(), NID_subject_key_identifier, "hash");
  if (X509_sign(out.get(), key.get(), EVP_sha256()) == 0) openssl_failure("signing an authority");
  return {pem_of(out), pem_of(key)};
}

PemPair issue_certificate(const PemPair& pem, const std::string& name, Validity valid) {
  const Authority authority(pem);
  valid.from = std::max(valid.from, seconds_of(X509_get0_notBefore(authority.certificate.get())));
  valid.until = std::min(valid.until, seconds_of(X509_get0_notAfter(authority.certificate.get())));
  const Key key = make_key();
  const Certificate out = begin_certificate(name, key, valid);
  if (X509_set_issuer_name(out.get(), X509_get_subject_name(authority.certificate.get())) != 1) openssl_failure("naming the issuer");
  add_extension(out.get(), authority.certificate.get(), NID_basic_constraints, "critical,CA:FALSE");
  add_extension(out.get(), authority.certificate.get(), NID_key_usage, "critical,digitalSignature,keyAgreement");
  add_extension(out.get(), authority.certificate.get(), NID_subject_key_identifier, "hash");
  add_extension(out.get(), authority.certificate.get(), NID_authority_key_identifier, "keyid");
  if (X509_sign(out.get(), authority.key.get(), EVP_sha256()) == 0) openssl_failure("signing a certificate");
  return {pem_of(out), pem_of(key)};
}

std::string make_revocations(const PemPair& pem, const std::vector<std::string>& serials, const Validity& valid) {
  const Authority authority(pem);
  const RevocationList out(X509_CRL_new());
  const std::unique_ptr<ASN1_TIME, FreeWith<ASN1_TIME_free>> from(ASN1_TIME_set(nullptr, valid.from)), until(ASN1_TIME_set(nullptr, valid.until));
  if (!out || !from || !until || X509_CRL_set_version(out.get(), X509_CRL_VERSION_2) != 1 ||
      X509_CRL_set_issuer_name(out.get(), X509_get_subject_name(authority.certificate.get())) != 1 || X509_CRL_set1_lastUpdate(out.get(), from.get()) != 1 ||
      X509_CRL_set1_nextUpdate(out.get(), until.get()) != 1)
    openssl_failure("beginning a revocation list");
  for (const std::string& serial : serials) {
    BIGNUM* number = nullptr;
    BN_hex2bn(&number, serial.c_str());
    ASN1_INTEGER* integer = number ? BN_to_ASN1_INTEGER(number, nullptr) : nullptr;
    X509_REVOKED* one = X509_REVOKED_new();
    const bool good = integer != nullptr && one != nullptr && X509_REVOKED_set_serialNumber(one, integer) == 1 &&
                      X509_REVOKED_set_revocationDate(one, from.get()) == 1 && X509_CRL_add0_revoked(out.get(), one) == 1;
    ASN1_INTEGER_free(integer);
    BN_free(number);
    if (!good) openssl_failure("adding a serial number to a revocation list");
  }
  X509_CRL_sort(out.get());
  if (X509_CRL_sign(out.get(), authority.key.get(), EVP_sha256()) == 0) openssl_failure("signing a revocation list");
  const Bio text = empty_bio();
  if (PEM_write_bio_X509_CRL(text.get(), out.get()) != 1) openssl_failure("writing a revocation list");
  return text_of(text);
}

CertificateFacts read_certificate(const std::string& pem) {
  const Certificate certificate = needed(pem);
  CertificateFacts out;
  out.name = common_name(X509_get_subject_name(certificate.get()));
  out.subject = rfc2253(X509_get_subject_name(certificate.get()));
  out.issuer = common_name(X509_get_issuer_name(certificate.get()));
  out.serial = hexadecimal(X509_get0_serialNumber(certificate.get()));
  out.valid = {seconds_of(X509_get0_notBefore(certificate.get())), seconds_of(X509_get0_notAfter(certificate.get()))};
  out.authority = X509_check_ca(certificate.get()) != 0;
  openssl_forget();
  return out;
}

std::vector<std::string> read_revocations(const std::string& pem, const std::string& authority) {
  const RevocationList list = revocations_of(pem);
  if (!list) openssl_failure("is not a revocation list (PEM)");
  const Certificate issuer = needed(authority);
  if (X509_CRL_verify(list.get(), X509_get0_pubkey(issuer.get())) != 1) {
    openssl_forget();
    throw std::runtime_error("was not signed by the identity authority beside it");
  }
  std::vector<std::string> out;
  STACK_OF(X509_REVOKED)* revoked = X509_CRL_get_REVOKED(list.get());
  for (int i = 0; i < sk_X509_REVOKED_num(revoked); ++i) out.push_back(hexadecimal(X509_REVOKED_get0_serialNumber(sk_X509_REVOKED_value(revoked, i))));
  return out;
}

std::string pair_objection(const std::string& certificate_pem, const std::string& key_pem) {
  const Certificate certificate = needed(certificate_pem);
  const Key key = key_of(key_pem);
  openssl_forget();
  if (!key) return "is not a private key (PEM, without a passphrase)";
  const bool good = X509_check_private_key(certificate.get(), key.get()) == 1;
  openssl_forget();
  return good ? "" : "is not the key of the certificate beside it";
}

std::string issuer_objection(const std::string& certificate_pem, const std::string& authority_pem) {
  const Certificate certificate = needed(certificate_pem), authority = needed(authority_pem);
  const bool good =
      X509_check_issued(authority.get(), certificate.get()) == X509_V_OK && X509_verify(certificate.get(), X509_get0_pubkey(authority.get())) == 1;
  openssl_forget();
  return good ? "" : "was not issued by the identity authority beside it";
}

}  // namespace booth::daemon
