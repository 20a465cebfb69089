// Records: written through a sealed file, read back from whatever the key's holder opened.
#include "drivers/recording/sealed_recording.hpp"

#include <bit>
#include <chrono>
#include <cstring>
#include <fstream>
#include <optional>
#include <stdexcept>

#include "drivers/recording/bag_file.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/layouts.hpp"
#include "drivers/recording/rvl.hpp"
#include "drivers/recording/staging.hpp"

namespace booth::drivers {
namespace {

namespace fs = std::filesystem;

enum class Kind : std::uint8_t { header = 1, background = 2, depth = 3, group = 4, event = 5 };
enum Flag : std::uint8_t { kDepth = 1, kPlainImages = 2, kGroups = 4 };

constexpr std::uint8_t kVersion = 1;
constexpr std::size_t kHead = 5;                           ///< of a record: size and kind
constexpr std::size_t kMostRecord = std::size_t{1} << 28;  ///< more than any image that a recording may have
constexpr auto kCommit = std::chrono::seconds(1);

/// Numbers as 8 little-endian bytes each.
class Packer {
 public:
  explicit Packer(Kind kind) { bytes_.resize(kHead, static_cast<std::byte>(kind)); }
  Packer& byte(std::uint8_t v) { return bytes_.push_back(std::byte{v}), *this; }
  Packer& word(std::uint64_t v) {
    for (int i = 0; i < 8; ++i) bytes_.push_back(static_cast<std::byte>(v >> (8 * i) & 0xff));
    return *this;
  }
  Packer& integer(std::int64_t v) { return word(static_cast<std::uint64_t>(v)); }
  Packer& real(double v) { return word(std::bit_cast<std::uint64_t>(v)); }
  Packer& raw(std::span<const std::byte> v) { return bytes_.insert(bytes_.end(), v.begin(), v.end()), *this; }
  std::span<const std::byte> record() {
    const std::size_t size = bytes_.size() - kHead;
    for (std::size_t i = 0; i < 4; ++i) bytes_[i] = static_cast<std::byte>(size >> (8 * i) & 0xff);
    return bytes_;
  }

 private:
  std::vector<std::byte> bytes_;
};

/// Takes a record apart; throws when it is shorter than it should be.
class Unpacker {
 public:
  Unpacker(std::string_view bytes, const std::string& name) : rest_(bytes), name_(name) {}
  std::uint8_t byte() { return static_cast<std::uint8_t>(take(1)[0]); }
  std::uint64_t word() {
    std::uint64_t out = 0;
    const std::string_view bytes = take(8);
    for (std::size_t i = 0; i < 8; ++i) out |= std::uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
    return out;
  }
  std::int64_t integer() { return static_cast<std::int64_t>(word()); }
  double real() { return std::bit_cast<double>(word()); }
  std::string_view rest() { return take(rest_.size()); }

 private:
  std::string_view take(std::size_t count) {
    if (rest_.size() < count) throw std::runtime_error(name_ + ": holds a record that is too short");
    const std::string_view out = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return out;
  }
  std::string_view rest_;
  const std::string& name_;
};

hal::UtcTime time_of(std::int64_t ns) { return hal::UtcTime(hal::Nanoseconds(ns)); }

class SealedSink final : public RecordingSink {
 public:
  SealedSink(const fs::path& path, const std::vector<hal::CameraDescription>& cameras, const std::vector<hal::DepthFrame>& background, BagContents contents,
             const hal::SealFiles& seal)
      : staging_(path), file_(seal(staging_.folder(), kSealedRecording)), committed_(std::chrono::steady_clock::now()) {
    check_ros_cameras(cameras, contents.depth);
    const std::string text = calibration_text(cameras);
    Packer header(Kind::header);
    header.byte(kVersion).byte(
        static_cast<std::uint8_t>((contents.depth ? kDepth : 0) | (contents.compressed ? 0 : kPlainImages) | (contents.groups ? kGroups : 0)));
    file_->append(header.raw(std::as_bytes(std::span(text))).record());
    std::vector<std::byte> packed;
    for (const auto& frame : background) {
      if (!contents.depth) break;
      (void)camera_of(frame, cameras);
      packed.resize(rvl_bound(frame.depth.size()));
      const std::size_t size = rvl_pack(frame.depth, packed.data());
      Packer record(Kind::background);
      file_->append(record.byte(static_cast<std::uint8_t>(hal::to_int(frame.camera))).raw({packed.data(), size}).record());
    }
    file_->flush();
  }

  void depth(std::size_t camera, std::span<const std::byte> packed, hal::UtcTime utc) override {
    Packer record(Kind::depth);
    file_->append(record.byte(static_cast<std::uint8_t>(camera)).integer(utc.time_since_epoch().count()).raw(packed).record());
    commit_if_due();
  }
  void group(const hal::FittedGroup& g, hal::Nanoseconds utc_offset) override {
    Packer record(Kind::group);
    record.word(g.sequence).integer(g.reference.time_since_epoch().count()).integer(utc_offset.count()).byte(g.person ? 1 : 0);
    for (const auto& t : g.captured) record.integer(t.time_since_epoch().count());
    for (const double q : g.q) record.real(q);
    file_->append(record.record());
    commit_if_due();
  }
  void event(const std::string& text, hal::UtcTime utc) override {
    Packer record(Kind::event);
    file_->append(record.integer(utc.time_since_epoch().count()).raw(std::as_bytes(std::span(text))).record());
    commit_if_due();
  }
  void commit_if_due() override {
    const auto now = std::chrono::steady_clock::now();
    if (now - committed_ < kCommit) return;
    file_->flush();
    committed_ = now;
  }
  void give_up_last() noexcept override {}  // the file has done so by itself
  void close() override {
    file_->close();
    staging_.publish();
  }
  std::uint64_t bytes() const override { return file_->bytes(); }
  const fs::path& folder() const override { return staging_.folder(); }

 private:
  Staging staging_;
  const std::unique_ptr<hal::SealedFile> file_;
  std::chrono::steady_clock::time_point committed_;
};

/// What records become: the calls that would have made the bag while it was recorded.
class Unpacking {
 public:
  Unpacking(std::string name, fs::path out) : name_(std::move(name)), out_(std::move(out)) {}

  void record(Kind kind, std::string_view bytes) {
    Unpacker in(bytes, name_);
    if (kind == Kind::header) return header(in);
    if (cameras_.empty()) wrong("does not begin with its header");
    if (kind == Kind::background) return background(in);
    begin();
    switch (kind) {
      case Kind::depth: {
        const std::size_t camera = camera_number(in);
        const hal::UtcTime utc = time_of(in.integer());
        if (!contents_.depth) wrong("holds an image although it says that there are none");
        return writer_->write_packed(camera, std::as_bytes(std::span(in.rest())), utc);
      }
      case Kind::group:
        return group(in);
      case Kind::event: {
        const hal::UtcTime utc = time_of(in.integer());
        return writer_->write_event(std::string(in.rest()), utc);
      }
      case Kind::header:
      case Kind::background:
        break;
    }
    wrong("holds a record of a kind that this version does not know");
  }

  void close() {
    if (cameras_.empty()) wrong("holds nothing");
    begin();
    writer_->close();
  }

 private:
  void header(Unpacker& in) {
    if (!cameras_.empty()) wrong("has two headers");
    if (in.byte() != kVersion) wrong("was made by another version of boothd");
    const std::uint8_t flags = in.byte();
    contents_ = {.compressed = (flags & kPlainImages) == 0, .depth = (flags & kDepth) != 0, .groups = (flags & kGroups) != 0};
    cameras_ = parse_calibration_text(std::string(in.rest()), name_ + ": cameras");
  }
  void background(Unpacker& in) {
    if (writer_) wrong("holds pictures of the empty room behind its beginning");
    hal::DepthFrame& frame = background_.emplace_back();
    const std::size_t camera = camera_number(in);
    frame.camera = static_cast<hal::CameraIndex>(camera);
    const auto& k = cameras_[camera].intrinsics;
    frame.depth.resize(static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height));
    if (!rvl_unpack(std::as_bytes(std::span(in.rest())), frame.depth)) wrong("holds a picture of the empty room that is damaged");
  }
  void group(Unpacker& in) {
    if (!contents_.groups) wrong("holds a fitted frame although it says that there are none");
    hal::FittedGroup g;
    g.sequence = in.word();
    g.reference = hal::MonotonicTime(hal::Nanoseconds(in.integer()));
    const hal::Nanoseconds offset(in.integer());
    g.person = in.byte() != 0;
    for (auto& t : g.captured) t = hal::MonotonicTime(hal::Nanoseconds(in.integer()));
    for (double& q : g.q) q = in.real();
    writer_->write_group(g, offset);
  }
  std::size_t camera_number(Unpacker& in) const {
    const std::size_t camera = in.byte();
    if (camera >= cameras_.size()) wrong("names a camera that it does not have");
    return camera;
  }
  void begin() {
    if (!writer_) writer_.emplace(out_, cameras_, std::nullopt, background_, contents_);
  }
  [[noreturn]] void wrong(const char* what) const { throw std::runtime_error(name_ + ": " + what); }

  const std::string name_;
  const fs::path out_;
  BagContents contents_;
  std::vector<hal::CameraDescription> cameras_;
  std::vector<hal::DepthFrame> background_;
  std::optional<Rosbag2Writer> writer_;
};

}  // namespace

std::unique_ptr<RecordingSink> make_sealed_sink(const fs::path& path, const std::vector<hal::CameraDescription>& cameras,
                                                const std::vector<hal::DepthFrame>& background, BagContents contents, const hal::SealFiles& seal) {
  return std::make_unique<SealedSink>(path, cameras, background, contents, seal);
}

bool is_sealed_recording(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / (std::string(kSealedRecording) + ".sealed"), ignored);
}

std::string recover_sealed(const fs::path& partial) noexcept {
  const std::string whole = partial.filename().string(), name = whole.substr(0, whole.rfind(".partial-"));
  try {
    std::ofstream(partial / "interrupted.txt") << "The process that made this recording ended before the recording did; what it had written is here.\n";
    fs::path target = partial.parent_path() / name;
    if (fs::exists(target)) target = partial.parent_path() / (name + "-recovered-" + whole.substr(name.size() + 9));
    Staging::adopt(partial, target);
    return "recording " + name + " was interrupted; it is sealed, and what was written is in " + target.string();
  } catch (const std::exception& e) {
    return "recording " + name + " was interrupted and cannot be finished: " + e.what();
  }
}

Unpacked unpack_recording(const OpenedStream& stream, const std::string& name, const fs::path& out) {
  Unpacking bag(name, out);
  Unpacked done;
  std::string waiting;
  for (std::string piece; stream(piece);) {
    waiting += piece;
    std::size_t at = 0;
    while (waiting.size() - at >= kHead) {
      std::size_t size = 0;
      for (std::size_t i = 0; i < 4; ++i) size |= std::size_t{static_cast<unsigned char>(waiting[at + i])} << (8 * i);
      if (size > kMostRecord) throw std::runtime_error(name + ": holds a record that is too long");
      if (waiting.size() - at - kHead < size) break;
      bag.record(static_cast<Kind>(waiting[at + 4]), std::string_view(waiting).substr(at + kHead, size));
      at += kHead + size;
      ++done.records;
    }
    waiting.erase(0, at);
  }
  done.torn = !waiting.empty();
  bag.close();
  return done;
}

}  // namespace booth::drivers
