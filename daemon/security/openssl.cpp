// Thin: everything that OpenSSL's calls need around them, once.
#include "daemon/security/openssl.hpp"

#include <openssl/err.h>
#include <openssl/pem.h>

#include <stdexcept>

namespace booth::daemon {

void openssl_failure(const std::string& what) {
  const unsigned long code = ERR_peek_error();
  const char* reason = code != 0 ? ERR_reason_error_string(code) : nullptr;
  ERR_clear_error();
  throw std::runtime_error(what + (reason ? std::string(": ") + reason : ""));
}

void openssl_forget() { ERR_clear_error(); }

Bio bio_of(const std::string& text) {
  Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  if (!bio) openssl_failure("no memory for OpenSSL");
  return bio;
}

Bio empty_bio() {
  Bio bio(BIO_new(BIO_s_mem()));
  if (!bio) openssl_failure("no memory for OpenSSL");
  return bio;
}

std::string text_of(const Bio& bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &data);
  return size > 0 ? std::string(data, static_cast<std::size_t>(size)) : std::string();
}

namespace {
/// Keys under a passphrase would make the library ask on the terminal of a daemon.
int no_passphrase(char*, int, int, void*) { return -1; }
}  // namespace

Certificate certificate_of(const std::string& pem) { return Certificate(PEM_read_bio_X509(bio_of(pem).get(), nullptr, no_passphrase, nullptr)); }

Key key_of(const std::string& pem) { return Key(PEM_read_bio_PrivateKey(bio_of(pem).get(), nullptr, no_passphrase, nullptr)); }

RevocationList revocations_of(const std::string& pem) { return RevocationList(PEM_read_bio_X509_CRL(bio_of(pem).get(), nullptr, no_passphrase, nullptr)); }

}  // namespace booth::daemon
