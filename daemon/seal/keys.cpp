// Keys as text, and the care with which a secret one is made, read and kept.
#include "daemon/seal/keys.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <new>
#include <stdexcept>
#include <utility>

namespace booth::daemon {
namespace {

constexpr std::string_view kPublicWord = "boothd-public-1", kPrivateWord = "boothd-private-1";
constexpr std::size_t kMostText = 4096;

void start_library() {
  static const bool good = ::sodium_init() >= 0;
  if (!good) throw std::runtime_error("libsodium finds no source of random numbers; nothing can be sealed");
}

std::string hexadecimal(const unsigned char* bytes, std::size_t count) {
  std::string out(2 * count + 1, '\0');
  ::sodium_bin2hex(out.data(), out.size(), bytes, count);
  out.pop_back();
  return out;
}

std::string no_key_file(const std::string& name) { return fmt::format("{}: is no key file of boothd; `boothctl key new` makes them", name); }

/// Puts the key's bytes into `out`.
void parse(std::string_view text, std::string_view word, const std::string& name, unsigned char* out) {
  std::string_view found;
  for (std::string_view rest = text; !rest.empty();) {
    std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
    if (line.empty() || line.front() == '#') continue;
    if (!found.empty()) {
      const bool keys = found.starts_with(kPublicWord) || found.starts_with(kPrivateWord);
      throw std::runtime_error(keys ? fmt::format("{}: holds more than one key", name) : no_key_file(name));
    }
    found = line;
  }
  const std::string_view other = word == kPublicWord ? kPrivateWord : kPublicWord;
  if (found.starts_with(other))
    throw std::runtime_error(fmt::format("{}: is the {} half of a key, wanted is the {} one", name, other == kPublicWord ? "public" : "private",
                                         word == kPublicWord ? "public" : "private"));
  const std::string_view digits = found.starts_with(word) && found.size() > word.size() ? found.substr(word.size() + 1) : std::string_view{};
  std::size_t size = 0;
  const bool good = digits.size() == 2 * kKeyBytes && ::sodium_hex2bin(out, kKeyBytes, digits.data(), digits.size(), nullptr, &size, nullptr) == 0;
  if (!good || size != kKeyBytes) throw std::runtime_error(no_key_file(name));
}

struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};

std::string read_text(const std::filesystem::path& file, bool secret) {
  const auto fail = [&](const std::string& why) { throw std::runtime_error(fmt::format("{}: the key cannot be read: {}", file.string(), why)); };
  const Descriptor in{::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  struct stat status {};
  if (in.fd < 0 || ::fstat(in.fd, &status) != 0) fail(std::strerror(errno));
  if (!S_ISREG(status.st_mode)) fail("it is no regular file");
  // Reading by the group is how systemd's credentials look to a unit with a user of its own (an access list shows as group bits).
  if (secret && (status.st_mode & 0027) != 0)
    fail(fmt::format("its mode is {:04o}, so that others can get at a secret; chmod 600 {}", status.st_mode & 07777u, file.string()));
  std::string text(kMostText, '\0');
  const ssize_t size = ::read(in.fd, text.data(), text.size());
  if (size < 0) fail(std::strerror(errno));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

void write_new(const std::filesystem::path& file, mode_t mode, std::string_view text) {
  const auto fail = [&] { throw std::runtime_error(fmt::format("{}: the key cannot be written: {}", file.string(), std::strerror(errno))); };
  const Descriptor out{::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, mode)};
  if (out.fd < 0 && errno == EEXIST)
    throw std::runtime_error(
        fmt::format("{}: File exists: a key is never overwritten, what was sealed to it would be lost; choose another name", file.string()));
  if (out.fd < 0) fail();
  const ssize_t size = ::write(out.fd, text.data(), text.size());
  if (size != static_cast<ssize_t>(text.size()) || ::fchmod(out.fd, mode) != 0 || ::fsync(out.fd) != 0) {
    const int reason = size < 0 || size == static_cast<ssize_t>(text.size()) ? errno : ENOSPC;
    ::unlink(file.c_str());
    errno = reason;
    fail();
  }
}

}  // namespace

SecretBytes::SecretBytes() {
  start_library();
  bytes_ = static_cast<unsigned char*>(::sodium_malloc(kKeyBytes));
  if (!bytes_) throw std::bad_alloc();
}
SecretBytes::~SecretBytes() { ::sodium_free(bytes_); }
SecretBytes::SecretBytes(SecretBytes&& other) noexcept : bytes_(std::exchange(other.bytes_, nullptr)) {}

std::string PublicKey::id() const {
  constexpr std::size_t kIdBytes = 8;
  std::array<unsigned char, crypto_generichash_BYTES> hash{};
  ::crypto_generichash(hash.data(), hash.size(), bytes.data(), bytes.size(), nullptr, 0);
  return hexadecimal(hash.data(), kIdBytes);
}

PrivateKey make_private_key() {
  PrivateKey key;
  ::crypto_box_keypair(key.public_half.bytes.data(), key.secret.data());
  return key;
}

std::string to_text(const PublicKey& key) {
  return fmt::format("# boothd seals sessions and recordings to this key (privacy.seal_to); it can be shown to anybody. Id {}\n{} {}\n", key.id(), kPublicWord,
                     hexadecimal(key.bytes.data(), key.bytes.size()));
}

std::string to_text(const PrivateKey& key) {
  return fmt::format("# Opens what boothd has sealed to key {}: keep it away from the booth, and keep a copy; without it nothing can be read.\n{} {}\n",
                     key.public_half.id(), kPrivateWord, hexadecimal(key.secret.data(), kKeyBytes));
}

PublicKey parse_public_key(std::string_view text, const std::string& name) {
  start_library();
  PublicKey key;
  parse(text, kPublicWord, name, key.bytes.data());
  return key;
}

PrivateKey parse_private_key(std::string_view text, const std::string& name) {
  PrivateKey key;
  parse(text, kPrivateWord, name, key.secret.data());
  if (::crypto_scalarmult_base(key.public_half.bytes.data(), key.secret.data()) != 0) throw std::runtime_error(name + ": is no key");
  return key;
}

PublicKey read_public_key(const std::filesystem::path& file) { return parse_public_key(read_text(file, false), file.string()); }

PrivateKey read_private_key(const std::filesystem::path& file) {
  std::string text = read_text(file, true);
  PrivateKey key = parse_private_key(text, file.string());
  ::sodium_memzero(text.data(), text.size());
  return key;
}

PrivateKey write_new_keys(const std::filesystem::path& base) {
  PrivateKey key = make_private_key();
  std::string text = to_text(key);
  write_new(base.string() + ".private", 0600, text);
  ::sodium_memzero(text.data(), text.size());
  try {
    write_new(base.string() + ".public", 0644, to_text(key.public_half));
  } catch (const std::exception&) {
    ::unlink((base.string() + ".private").c_str());  // half a pair is of no use, and in the way of the next attempt
    throw;
  }
  return key;
}

PrivateKey find_private_key(const std::string& named) {
  if (!named.empty()) return read_private_key(named);
  const char* credentials = std::getenv("CREDENTIALS_DIRECTORY");
  const std::filesystem::path file = std::filesystem::path(credentials ? credentials : "") / "boothd-private-key";
  std::error_code ignored;
  if (credentials && *credentials && std::filesystem::exists(file, ignored)) return read_private_key(file);
  throw std::runtime_error("this is sealed: name the file of its private key with --key FILE (or put it into $CREDENTIALS_DIRECTORY/boothd-private-key)");
}

}  // namespace booth::daemon
