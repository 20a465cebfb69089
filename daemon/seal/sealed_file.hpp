// Sealed files on disk: read whole or chunk by chunk, and written as they grow.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "daemon/seal/seal.hpp"
#include "hal/sealed_file.hpp"

namespace booth::daemon {

/// Whether a folder's files are sealed.
bool is_sealed(const std::filesystem::path& folder);
/// The key of a sealed folder. Throws std::runtime_error naming file, reason and remedy.
std::shared_ptr<const Seal> open_seal(const std::filesystem::path& folder, const PrivateKey& key);
/// What is said to somebody who wants to read a sealed folder without a key.
std::string sealed_sentence(const std::filesystem::path& folder);

/// The chunks of FOLDER/NAME.sealed. Not thread-safe. Throws std::runtime_error naming the file where it cannot be read.
class SealedReader {
 public:
  SealedReader(const std::filesystem::path& folder, const std::string& name, const Seal& seal);
  ~SealedReader();
  SealedReader(const SealedReader&) = delete;
  bool next(std::string& plain) { return decoder_.next(plain); }
  SealEnd end() const { return decoder_.end(); }
  /// What is wrong with how the file ended; empty where it is complete.
  std::string complaint() const;

 private:
  const std::filesystem::path file_;
  int fd_ = -1;
  SealDecoder decoder_;
};

/// All of FOLDER/NAME.sealed. Throws std::runtime_error also where it is cut, damaged, or more than `most` bytes.
std::string read_sealed_file(const std::filesystem::path& folder, const std::string& name, const Seal& seal, std::uint64_t most);
/// sealed_plain_bytes() of a file; 0 where it cannot be read.
std::uint64_t sealed_plain_bytes(const std::filesystem::path& file);

/// For whoever writes files that grow: each call makes a new key for the folder, writes it into seal.key and begins NAME.sealed.
hal::SealFiles seal_files(const PublicKey& to);

}  // namespace booth::daemon
