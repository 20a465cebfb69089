// libsodium's sealed boxes and secret streams, and the few bytes of framing around them.
#include "daemon/seal/seal.hpp"

#include <fmt/format.h>
#include <sodium.h>

#include <array>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace booth::daemon {
namespace {

constexpr std::string_view kKeyMagic = "boothky1", kFileMagic = "boothsl1";
constexpr std::size_t kIdDigits = 16;
constexpr std::size_t kKeyFileBytes = kKeyMagic.size() + kIdDigits + crypto_box_SEALBYTES + kKeyBytes;
constexpr std::size_t kOverhead = crypto_secretstream_xchacha20poly1305_ABYTES, kHeader = crypto_secretstream_xchacha20poly1305_HEADERBYTES;
static_assert(kKeyBytes == crypto_secretstream_xchacha20poly1305_KEYBYTES && kKeyBytes == crypto_box_PUBLICKEYBYTES);

unsigned char* raw(char* p) { return reinterpret_cast<unsigned char*>(p); }
const unsigned char* raw(const char* p) { return reinterpret_cast<const unsigned char*>(p); }

std::size_t size_at(const char* p) {
  std::size_t out = 0;
  for (std::size_t i = 0; i < 4; ++i) out |= std::size_t{raw(p)[i]} << (8 * i);
  return out;
}

bool possible_size(std::size_t sealed) { return sealed >= kOverhead && sealed <= kSealChunk + kOverhead; }

}  // namespace

Seal::Seal(SecretBytes key, std::string key_file, std::string recipient)
    : key_(std::move(key)), key_file_(std::move(key_file)), recipient_(std::move(recipient)) {}

std::shared_ptr<const Seal> Seal::fresh(const PublicKey& to) {
  SecretBytes key;
  ::randombytes_buf(key.data(), kKeyBytes);
  std::string file = std::string(kKeyMagic) + to.id();
  const std::size_t box = file.size();
  file.resize(kKeyFileBytes);
  if (::crypto_box_seal(raw(file.data() + box), key.data(), kKeyBytes, to.bytes.data()) != 0)
    throw std::runtime_error(fmt::format("nothing can be sealed to key {}: it is no point of the curve; make a new one with `boothctl key new`", to.id()));
  return std::shared_ptr<const Seal>(new Seal(std::move(key), std::move(file), to.id()));
}

std::string Seal::recipient_of(std::string_view key_file) {
  if (key_file.size() != kKeyFileBytes || !key_file.starts_with(kKeyMagic)) return {};
  const std::string_view id = key_file.substr(kKeyMagic.size(), kIdDigits);
  return id.find_first_not_of("0123456789abcdef") == std::string_view::npos ? std::string(id) : std::string();
}

std::shared_ptr<const Seal> Seal::open(std::string_view key_file, const PrivateKey& key, const std::string& name) {
  const std::string to = recipient_of(key_file);
  if (to.empty()) throw std::runtime_error(fmt::format("{}: is no {} of boothd, or it is damaged; without it the folder cannot be read", name, kSealKeyName));
  if (to != key.public_half.id())
    throw std::runtime_error(fmt::format("{}: is sealed to key {}, and this is the private half of key {}", name, to, key.public_half.id()));
  SecretBytes content;
  const char* box = key_file.data() + kKeyMagic.size() + kIdDigits;
  if (::crypto_box_seal_open(content.data(), raw(box), crypto_box_SEALBYTES + kKeyBytes, key.public_half.bytes.data(), key.secret.data()) != 0)
    throw std::runtime_error(fmt::format("{}: is damaged or was changed; without it the folder cannot be read", name));
  return std::shared_ptr<const Seal>(new Seal(std::move(content), std::string(key_file), to));
}

SecretBytes Seal::key_of(std::string_view name) const {
  SecretBytes out;
  const std::string purpose = "boothd sealed file 1: " + std::string(name);
  ::crypto_generichash(out.data(), kKeyBytes, raw(purpose.data()), purpose.size(), key_.data(), kKeyBytes);
  return out;
}

struct SealEncoder::State {
  crypto_secretstream_xchacha20poly1305_state stream{};
  std::array<unsigned char, kHeader> header{};
  bool begun = false;
  ~State() { ::sodium_memzero(&stream, sizeof stream); }
};

SealEncoder::SealEncoder(const Seal& seal, std::string_view name) : state_(std::make_unique<State>()) {
  const SecretBytes key = seal.key_of(name);
  ::crypto_secretstream_xchacha20poly1305_init_push(&state_->stream, state_->header.data(), key.data());
}
SealEncoder::~SealEncoder() = default;

void SealEncoder::append(std::string_view plain, bool last, std::string& out) {
  if (!state_->begun) {
    out += kFileMagic;
    out.append(reinterpret_cast<const char*>(state_->header.data()), kHeader);
    state_->begun = true;
  }
  const std::size_t sealed = plain.size() + kOverhead, at = out.size();
  out.resize(at + 4 + sealed);
  for (std::size_t i = 0; i < 4; ++i) out[at + i] = static_cast<char>(sealed >> (8 * i) & 0xff);
  const unsigned char tag = last ? crypto_secretstream_xchacha20poly1305_TAG_FINAL : crypto_secretstream_xchacha20poly1305_TAG_MESSAGE;
  ::crypto_secretstream_xchacha20poly1305_push(&state_->stream, raw(out.data() + at + 4), nullptr, raw(plain.data()), plain.size(), nullptr, 0, tag);
}

struct SealDecoder::State {
  crypto_secretstream_xchacha20poly1305_state stream{};
  SecretBytes key;
  bool begun = false, last = false;
  explicit State(SecretBytes k) : key(std::move(k)) {}
  ~State() { ::sodium_memzero(&stream, sizeof stream); }
};

SealDecoder::SealDecoder(const Seal& seal, std::string_view name, Source source)
    : state_(std::make_unique<State>(seal.key_of(name))), source_(std::move(source)) {}
SealDecoder::~SealDecoder() = default;

bool SealDecoder::stop(SealEnd end) {
  end_ = end;
  return false;
}

bool SealDecoder::next(std::string& plain) {
  if (end_ != SealEnd::open) return false;
  if (!state_->begun) {
    std::array<char, kFileMagic.size() + kHeader> begin{};
    const std::size_t got = source_(begin.data(), begin.size());
    if (std::string_view(begin.data(), std::min(got, kFileMagic.size())) != kFileMagic.substr(0, got)) return stop(SealEnd::damaged);
    if (got < begin.size()) return stop(SealEnd::cut);
    if (::crypto_secretstream_xchacha20poly1305_init_pull(&state_->stream, raw(begin.data() + kFileMagic.size()), state_->key.data()) != 0)
      return stop(SealEnd::damaged);
    state_->begun = true;
    offset_ = begin.size();
  }
  std::array<char, 4> size{};
  const std::size_t got = source_(size.data(), size.size());
  if (state_->last) return stop(got == 0 ? SealEnd::complete : SealEnd::damaged);
  const std::size_t sealed = size_at(size.data());
  // Blocks that were never written read as zeros after a power cut.
  if (got < size.size() || sealed == 0) return stop(SealEnd::cut);
  if (!possible_size(sealed)) return stop(SealEnd::damaged);
  sealed_.resize(sealed);
  if (source_(sealed_.data(), sealed) < sealed) return stop(SealEnd::cut);
  plain.resize(sealed - kOverhead);
  unsigned char tag = 0;
  if (::crypto_secretstream_xchacha20poly1305_pull(&state_->stream, raw(plain.data()), nullptr, &tag, raw(sealed_.data()), sealed, nullptr, 0) != 0)
    return stop(SealEnd::damaged);
  offset_ += size.size() + sealed;
  state_->last = tag == crypto_secretstream_xchacha20poly1305_TAG_FINAL;
  return true;
}

std::uint64_t sealed_plain_bytes(const SealDecoder::Source& source) {
  std::string skip(kSealChunk + kOverhead, '\0');
  std::uint64_t plain = 0;
  if (source(skip.data(), kFileMagic.size() + kHeader) < kFileMagic.size() + kHeader || !skip.starts_with(kFileMagic)) return 0;
  while (true) {
    std::array<char, 4> size{};
    if (source(size.data(), size.size()) < size.size()) return plain;
    const std::size_t sealed = size_at(size.data());
    if (!possible_size(sealed) || source(skip.data(), sealed) < sealed) return plain;
    plain += sealed - kOverhead;
  }
}

}  // namespace booth::daemon
