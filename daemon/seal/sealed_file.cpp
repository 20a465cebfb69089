// Descriptors around the encoder and the decoder.
#include "daemon/seal/sealed_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostKeyFile = 4096;

std::size_t read_up_to(int fd, char* to, std::size_t count) {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t n = ::read(fd, to + done, count - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw std::runtime_error(std::strerror(errno));
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

int open_for_reading(const fs::path& file) {
  const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) throw std::runtime_error(fmt::format("{}: cannot be read: {}", file.string(), std::strerror(errno)));
  return fd;
}

std::string read_key_file(const fs::path& file) {
  const int fd = open_for_reading(file);
  std::string bytes(kMostKeyFile, '\0');
  try {
    bytes.resize(read_up_to(fd, bytes.data(), bytes.size()));
  } catch (const std::exception& e) {
    ::close(fd);
    throw std::runtime_error(fmt::format("{}: cannot be read: {}", file.string(), e.what()));
  }
  ::close(fd);
  return bytes;
}

class GrowingFile final : public hal::SealedFile {
 public:
  GrowingFile(const PublicKey& to, const fs::path& folder, const std::string& name)
      : seal_(Seal::fresh(to)), file_(folder / (name + kSealedEnding)), encoder_(*seal_, name) {
    const fs::path key = folder / kSealKeyName;
    const int fd = ::open(key.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    const std::string& bytes = seal_->key_file();
    const bool good = fd >= 0 && ::write(fd, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()) && ::fsync(fd) == 0;
    const int reason = errno;
    if (fd >= 0) ::close(fd);
    if (!good) throw std::runtime_error(fmt::format("cannot write {}: {}; check the disk's space", key.string(), std::strerror(reason)));
    fd_ = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd_ < 0) fail();
  }
  ~GrowingFile() override {
    if (fd_ >= 0) ::close(fd_);
  }
  GrowingFile(const GrowingFile&) = delete;

  void append(std::span<const std::byte> bytes) override {
    expect_unbroken();
    std::string_view rest(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    while (!rest.empty()) {
      const std::string_view part = rest.substr(0, kSealChunk - plain_.size());
      plain_ += part;
      rest.remove_prefix(part.size());
      if (plain_.size() == kSealChunk) chunk(false);
    }
  }
  void flush() override {
    expect_unbroken();
    if (!plain_.empty()) chunk(false);
    if (::fdatasync(fd_) != 0) fail();
  }
  void close() override {
    // A stream that has lost a chunk must not get another one: its end stays open, and readers say so.
    if (!broken_) chunk(true);
    if (::fsync(fd_) != 0) fail();
    ::close(std::exchange(fd_, -1));
  }
  std::uint64_t bytes() const override { return whole_; }

 private:
  void expect_unbroken() const {
    if (broken_) throw std::runtime_error(fmt::format("{}: could not be written before; nothing more goes into it", file_.string()));
  }
  void chunk(bool last) {
    sealed_.clear();
    encoder_.append(plain_, last, sealed_);
    plain_.clear();
    for (std::size_t done = 0; done < sealed_.size();) {
      const ssize_t n = ::write(fd_, sealed_.data() + done, sealed_.size() - done);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) {
        const int reason = n < 0 ? errno : ENOSPC;
        broken_ = true;
        // Half a chunk helps nobody. Where cutting it off fails, readers still find the end of what is whole.
        if (::ftruncate(fd_, static_cast<off_t>(whole_)) != 0) errno = reason;
        errno = reason;
        fail();
      }
      done += static_cast<std::size_t>(n);
    }
    whole_ += sealed_.size();
  }
  [[noreturn]] void fail() const { throw std::runtime_error(fmt::format("cannot write {}: {}; check the disk's space", file_.string(), std::strerror(errno))); }

  const std::shared_ptr<const Seal> seal_;
  const fs::path file_;
  SealEncoder encoder_;
  std::string plain_, sealed_;
  std::uint64_t whole_ = 0;  ///< bytes of the file up to its last whole chunk
  bool broken_ = false;
  int fd_ = -1;
};

}  // namespace

bool is_sealed(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / kSealKeyName, ignored);
}

std::shared_ptr<const Seal> open_seal(const fs::path& folder, const PrivateKey& key) {
  const fs::path file = folder / kSealKeyName;
  return Seal::open(read_key_file(file), key, file.string());
}

std::string sealed_sentence(const fs::path& folder) {
  std::string to;
  try {
    to = Seal::recipient_of(read_key_file(folder / kSealKeyName));
  } catch (const std::exception&) {
    // Then it says only that it is sealed.
  }
  return fmt::format("{}: is sealed{}; `boothctl decrypt {} --key FILE` opens it for whoever has the private key", folder.string(),
                     to.empty() ? "" : " to key " + to, folder.string());
}

SealedReader::SealedReader(const fs::path& folder, const std::string& name, const Seal& seal)
    : file_(folder / (name + kSealedEnding)), fd_(open_for_reading(file_)), decoder_(seal, name, [this](char* to, std::size_t count) {
        try {
          return read_up_to(fd_, to, count);
        } catch (const std::exception& e) {
          throw std::runtime_error(fmt::format("{}: cannot be read: {}", file_.string(), e.what()));
        }
      }) {}

SealedReader::~SealedReader() { ::close(fd_); }

std::string SealedReader::complaint() const {
  switch (decoder_.end()) {
    case SealEnd::complete:
      return {};
    case SealEnd::damaged:
      return fmt::format("{}: is damaged or was changed at byte {}; only what comes before it can be trusted", file_.string(), decoder_.offset());
    case SealEnd::cut:
    case SealEnd::open:
      break;
  }
  return fmt::format("{}: ends before its end, at byte {}: its writing was interrupted, or something was cut off", file_.string(), decoder_.offset());
}

std::string read_sealed_file(const fs::path& folder, const std::string& name, const Seal& seal, std::uint64_t most) {
  SealedReader in(folder, name, seal);
  std::string out, chunk;
  while (in.next(chunk)) {
    if (out.size() + chunk.size() > most)
      throw std::runtime_error(fmt::format("{}: has more than {} bytes, which are not accepted", (folder / (name + kSealedEnding)).string(), most));
    out += chunk;
  }
  if (in.end() != SealEnd::complete) throw std::runtime_error(in.complaint());
  return out;
}

std::uint64_t sealed_plain_bytes(const fs::path& file) {
  try {
    const int fd = open_for_reading(file);
    std::uint64_t out = 0;
    try {
      out = sealed_plain_bytes([fd](char* to, std::size_t count) { return read_up_to(fd, to, count); });
    } catch (const std::exception&) {
      out = 0;
    }
    ::close(fd);
    return out;
  } catch (const std::exception&) {
    return 0;
  }
}

hal::SealFiles seal_files(const PublicKey& to) {
  return [to](const fs::path& folder, const std::string& name) { return std::make_unique<GrowingFile>(to, folder, name); };
}

}  // namespace booth::daemon
