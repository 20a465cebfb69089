// Keys and certificates of a fleet: making authorities, issuing identities, and reading what somebody else has made.
#pragma once

#include <string>
#include <vector>

#include "daemon/security/utc_time.hpp"

namespace booth::daemon {

/// A certificate and its private key, as PEM.
struct PemPair {
  std::string certificate, key;
};

/// What a certificate says. Texts come from a file and may hold anything that X.509 allows.
struct CertificateFacts {
  std::string name;     ///< common name of its subject
  std::string subject;  ///< whole, as RFC 2253 writes it
  std::string issuer;   ///< common name
  std::string serial;   ///< hexadecimal
  Validity valid;
  bool authority = false;
};

/// Keys are ECDSA on P-256, the elliptic kind that DDS Security 1.1 (9.3.2.1) asks every vendor to know. All throw std::runtime_error with OpenSSL's reason.

/// An authority that signs itself: may issue certificates and sign documents.
PemPair make_authority(const std::string& name, const Validity& valid);

/// An identity with that common name. `valid` is cut to the authority's own.
PemPair issue_certificate(const PemPair& authority, const std::string& name, Validity valid);

/// A list (PEM) of serial numbers, hexadecimal, that this authority takes back; `valid.until` is when a newer list is due.
std::string make_revocations(const PemPair& authority, const std::vector<std::string>& serials, const Validity& valid);

/// Throws std::runtime_error where the text is no certificate.
CertificateFacts read_certificate(const std::string& pem);

/// Serial numbers of a list, hexadecimal. Throws std::runtime_error where the text is no list or `authority` has not signed it.
std::vector<std::string> read_revocations(const std::string& pem, const std::string& authority);

/// Empty, or why the two do not belong together ("is not the key of this certificate").
std::string pair_objection(const std::string& certificate, const std::string& key);
/// Empty, or why `certificate` was not issued by `authority`. Dates are not looked at.
std::string issuer_objection(const std::string& certificate, const std::string& authority);

}  // namespace booth::daemon
