// Owners of OpenSSL's objects, and its complaints as text.
#pragma once

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>

#include <memory>
#include <string>

namespace booth::daemon {

template <auto Free>
struct FreeWith {
  template <class T>
  void operator()(T* object) const {
    Free(object);
  }
};

using Bio = std::unique_ptr<BIO, FreeWith<BIO_free_all>>;
using Key = std::unique_ptr<EVP_PKEY, FreeWith<EVP_PKEY_free>>;
using Certificate = std::unique_ptr<X509, FreeWith<X509_free>>;
using RevocationList = std::unique_ptr<X509_CRL, FreeWith<X509_CRL_free>>;
using SignedData = std::unique_ptr<PKCS7, FreeWith<PKCS7_free>>;

/// Throws std::runtime_error "WHAT: the library's first reason", and forgets the library's reasons.
[[noreturn]] void openssl_failure(const std::string& what);

/// Forgets what the library complained of, where a failure is an answer.
void openssl_forget();

/// The text in memory, to be read. `text` outlives it.
Bio bio_of(const std::string& text);
Bio empty_bio();
std::string text_of(const Bio& bio);

/// First certificate, key or list of a PEM text; null when it has none that can be read (and openssl_failure() tells why).
Certificate certificate_of(const std::string& pem);
Key key_of(const std::string& pem);
RevocationList revocations_of(const std::string& pem);

}  // namespace booth::daemon
