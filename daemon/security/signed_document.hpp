// Documents that an authority has signed, in the form that DDS Security 1.1 (9.4.1.2, 9.4.1.3) asks for: S/MIME, clear text with a detached signature.
#pragma once

#include <string>

#include "daemon/security/certificates.hpp"

namespace booth::daemon {

/// Throws std::runtime_error with OpenSSL's reason.
std::string sign_document(const std::string& text, const PemPair& authority);

/// The text, when `authority` (a certificate, PEM) itself has signed it and nobody has changed it since; otherwise throws std::runtime_error. Line ends are
/// those of mail (CR LF) where the signer made them so.
std::string open_document(const std::string& document, const std::string& authority);

}  // namespace booth::daemon
