// What closes the files of one folder: a key of its own, which only the holder of the private key gets back, and which is gone for good when its file is.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/seal/keys.hpp"

namespace booth::daemon {

inline constexpr const char* kSealKeyName = "seal.key";          ///< the folder's key, itself sealed to the public key
inline constexpr const char* kSealedEnding = ".sealed";          ///< of every file that is closed with it
inline constexpr std::size_t kSealChunk = std::size_t{1} << 16;  ///< plain bytes in a chunk, at most

/// The key of one folder. Immutable; thread-safe.
class Seal {
 public:
  /// A new random key, for whoever holds the private half of `to`.
  static std::shared_ptr<const Seal> fresh(const PublicKey& to);
  /// From the bytes of a seal.key. Throws std::runtime_error naming `name`: not such a file, damaged, or sealed to another key than this.
  static std::shared_ptr<const Seal> open(std::string_view key_file, const PrivateKey& key, const std::string& name);
  /// The id of the key that the bytes of a seal.key were sealed to; empty where they are none.
  static std::string recipient_of(std::string_view key_file);

  const std::string& key_file() const { return key_file_; }  ///< what belongs into seal.key
  const std::string& recipient() const { return recipient_; }
  /// The key of one file of the folder: files cannot take each other's place.
  SecretBytes key_of(std::string_view name) const;

 private:
  Seal(SecretBytes key, std::string key_file, std::string recipient);
  const SecretBytes key_;
  const std::string key_file_, recipient_;
};

/// A file being sealed: "boothsl1", 24 bytes that begin the stream, then chunks, each its size (4 bytes, little-endian) and XChaCha20-Poly1305 of libsodium's
/// secretstream, which also notices a chunk that is missing, twice there or out of place. The last one says that it is. Not thread-safe.
class SealEncoder {
 public:
  /// `name` is the file's without ".sealed".
  SealEncoder(const Seal& seal, std::string_view name);
  ~SealEncoder();
  /// Appends a chunk of at most kSealChunk bytes, before the first one also the file's beginning. Nothing may follow the last.
  void append(std::string_view plain, bool last, std::string& out);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// How a sealed file ended.
enum class SealEnd : std::uint8_t {
  open,      ///< there may be more
  complete,  ///< with its last chunk
  cut,       ///< before it: interrupted, or somebody cut it off; what was read is whole
  damaged,   ///< something was changed, or it belongs to another file or key; what was read before is whole
};

/// Hands out what is whole, chunk by chunk. Takes any bytes. Not thread-safe.
class SealDecoder {
 public:
  /// Fills the buffer; fewer bytes than asked for are the end. May throw; nothing else here does.
  using Source = std::function<std::size_t(char* to, std::size_t count)>;
  SealDecoder(const Seal& seal, std::string_view name, Source source);
  ~SealDecoder();
  /// The next chunk, which may be empty. False when there is none; end() then says why.
  bool next(std::string& plain);
  SealEnd end() const { return end_; }
  /// Where the first byte lies that was not understood.
  std::uint64_t offset() const { return offset_; }

 private:
  struct State;
  bool stop(SealEnd end);
  std::unique_ptr<State> state_;
  Source source_;
  SealEnd end_ = SealEnd::open;
  std::uint64_t offset_ = 0;
  std::string sealed_;
};

/// Plain bytes that lie in the whole chunks of a sealed file, told from their sizes alone, without a key: what a booth knows of a file it cannot read.
std::uint64_t sealed_plain_bytes(const SealDecoder::Source& source);

}  // namespace booth::daemon
