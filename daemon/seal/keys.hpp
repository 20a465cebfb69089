// The two halves of the key that files are sealed with: the booth has the public one and can only close, whoever holds the private one can open.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace booth::daemon {

inline constexpr std::size_t kKeyBytes = 32;

/// 32 secret bytes in memory that is locked, kept out of core dumps and wiped when it goes. Immutable once filled. Throws std::bad_alloc.
class SecretBytes {
 public:
  SecretBytes();
  ~SecretBytes();
  SecretBytes(SecretBytes&& other) noexcept;
  SecretBytes(const SecretBytes&) = delete;
  unsigned char* data() { return bytes_; }
  const unsigned char* data() const { return bytes_; }

 private:
  unsigned char* bytes_ = nullptr;
};

/// An X25519 point. Its id names it in files and sentences: the first 8 bytes of its BLAKE2b hash in hexadecimal.
struct PublicKey {
  std::array<unsigned char, kKeyBytes> bytes{};
  std::string id() const;
};

struct PrivateKey {
  SecretBytes secret;
  PublicKey public_half;
};

PrivateKey make_private_key();

/// The key files are text: lines that begin with # are comments, one other line holds "boothd-public-1 HEX" or "boothd-private-1 HEX". The text of a private
/// key is a secret. `name` is for the errors, which are std::runtime_error.
std::string to_text(const PublicKey& key);
std::string to_text(const PrivateKey& key);
PublicKey parse_public_key(std::string_view text, const std::string& name);
PrivateKey parse_private_key(std::string_view text, const std::string& name);

/// Throw std::runtime_error naming the file and the remedy; a private key that everybody may read, or others than its owner may write, is refused.
PublicKey read_public_key(const std::filesystem::path& file);
PrivateKey read_private_key(const std::filesystem::path& file);

/// BASE.private (mode 0600) and BASE.public; neither is ever written over an existing file. Throws std::runtime_error.
PrivateKey write_new_keys(const std::filesystem::path& base);

/// `named` where it is not empty, else $CREDENTIALS_DIRECTORY/boothd-private-key where systemd or somebody else has put one. Throws std::runtime_error that
/// says how to name one.
PrivateKey find_private_key(const std::string& named);

}  // namespace booth::daemon
