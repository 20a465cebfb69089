// PKCS #7 inside MIME.
#include "daemon/security/signed_document.hpp"

#include <openssl/pem.h>
#include <openssl/x509_vfy.h>

#include <stdexcept>

#include "daemon/security/openssl.hpp"

namespace booth::daemon {

std::string sign_document(const std::string& text, const PemPair& pem) {
  const Certificate certificate = certificate_of(pem.certificate);
  const Key key = key_of(pem.key);
  if (!certificate || !key) openssl_failure("the authority's certificate or key cannot be read");
  constexpr int kFlags = PKCS7_DETACHED | PKCS7_TEXT | PKCS7_STREAM;
  const Bio in = bio_of(text), out = empty_bio();
  const SignedData data(PKCS7_sign(certificate.get(), key.get(), nullptr, in.get(), kFlags));
  if (!data || SMIME_write_PKCS7(out.get(), data.get(), in.get(), kFlags) != 1) openssl_failure("signing a document");
  return text_of(out);
}

std::string open_document(const std::string& document, const std::string& authority) {
  const Certificate certificate = certificate_of(authority);
  if (!certificate) openssl_failure("the authority is not a certificate (PEM)");
  BIO* content = nullptr;
  const SignedData data(SMIME_read_PKCS7(bio_of(document).get(), &content));
  const Bio clear(content);
  if (!data || !clear) openssl_failure("is not a signed document (S/MIME with a detached signature)");
  const std::unique_ptr<X509_STORE, FreeWith<X509_STORE_free>> store(X509_STORE_new());
  STACK_OF(X509)* signers = sk_X509_new_null();
  if (!store || !signers || sk_X509_push(signers, certificate.get()) <= 0) {
    sk_X509_free(signers);
    openssl_failure("no memory for OpenSSL");
  }
  // As the plugins do: the signer is the authority itself and no certificate that the document brings along.
  const Bio out = empty_bio();
  const int good = PKCS7_verify(data.get(), signers, store.get(), clear.get(), out.get(), PKCS7_TEXT | PKCS7_NOVERIFY | PKCS7_NOINTERN);
  sk_X509_free(signers);
  openssl_forget();
  if (good != 1) throw std::runtime_error("was not signed by the permissions authority beside it, or was changed afterwards");
  return text_of(out);
}

}  // namespace booth::daemon
