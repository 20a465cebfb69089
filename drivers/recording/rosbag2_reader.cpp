// Any rosbag2 folder with SQLite storage that holds 16UC1 depth images, their CameraInfo and the cameras' transforms.
#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>
#include <stdexcept>

#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/layouts.hpp"
#include "drivers/recording/ros_messages.hpp"
#include "drivers/recording/rosbag2_writer.hpp"
#include "drivers/recording/sqlite.hpp"

namespace booth::drivers {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kMaxFrames = 10'000'000, kMaxTopics = 10'000, kMaxCameras = 64, kMaxBackground = 1000;
constexpr std::size_t kMaxMessage = 96u << 20;  // bytes; the largest picture allowed has 64 MiB

[[noreturn]] void fail(const fs::path& file, const std::string& what) { throw std::runtime_error(file.string() + ": " + what); }

/// The two things that metadata.yaml must tell: which files, and whether messages are compressed.
struct Metadata {
  std::vector<fs::path> files;
  bool zstd_messages = false;
};

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r\"'"), last = text.find_last_not_of(" \t\r\"'");
  return first == std::string_view::npos ? std::string() : std::string(text.substr(first, last - first + 1));
}

/// rosbag2 writes block-style YAML with one key or item a line; nothing else is needed of it.
Metadata read_metadata(const fs::path& folder) {
  const fs::path path = folder / "metadata.yaml";
  std::ifstream in(path);
  if (!in) fail(path, "cannot be read");
  Metadata m;
  std::string format, mode, storage, line;
  bool in_list = false;
  for (int number = 0; std::getline(in, line) && number < 100'000; ++number) {
    const auto start = line.find_first_not_of(' ');
    if (start == std::string::npos) continue;
    if (in_list && line.compare(start, 2, "- ") == 0) {
      m.files.push_back(folder / fs::path(trimmed(std::string_view(line).substr(start + 2))).filename());
      continue;
    }
    in_list = false;
    const auto colon = line.find(':', start);
    if (colon == std::string::npos) continue;
    const auto key = line.substr(start, colon - start), value = trimmed(std::string_view(line).substr(colon + 1));
    if (key == "relative_file_paths") in_list = true;
    if (key == "compression_format") format = value;
    if (key == "compression_mode") mode = value;
    if (key == "storage_identifier") storage = value;
  }
  if (in.bad()) fail(path, "cannot be read to its end: the disk may be damaged");
  if (storage != "sqlite3") fail(path, "the storage is '" + storage + "'; only sqlite3 is read, convert the bag with 'ros2 bag convert'");
  if (m.files.empty()) fail(path, "names no files under relative_file_paths");
  std::transform(mode.begin(), mode.end(), mode.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  if (mode == "file") fail(path, "the bag's files are compressed as a whole; unpack them first with 'ros2 bag convert'");
  if (mode == "message") {
    if (format != "zstd") fail(path, "messages are compressed with '" + format + "'; only zstd is read");
    m.zstd_messages = true;
  }
  return m;
}

/// Messages as they were before compression. Its buffer grows to the largest message and then stays.
class Unpacker {
 public:
  explicit Unpacker(bool zstd) : zstd_(zstd) {}
  /// Empty when the bytes are broken.
  std::span<const std::byte> unpack(std::span<const std::byte> stored) {
    if (!zstd_) return stored.size() <= kMaxMessage ? stored : std::span<const std::byte>{};
    const auto size = ZSTD_getFrameContentSize(stored.data(), stored.size());
    if (size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR || size > kMaxMessage) return {};
    if (buffer_.size() < size) buffer_.resize(size);
    const std::size_t got = ZSTD_decompressDCtx(context_.get(), buffer_.data(), buffer_.size(), stored.data(), stored.size());
    return ZSTD_isError(got) ? std::span<const std::byte>{} : std::span<const std::byte>(buffer_.data(), got);
  }

 private:
  struct Free {
    void operator()(ZSTD_DCtx* c) const { ZSTD_freeDCtx(c); }
  };
  bool zstd_;
  std::vector<std::byte> buffer_;
  std::unique_ptr<ZSTD_DCtx, Free> context_{ZSTD_createDCtx()};
};

struct Bag {
  fs::path path;
  Database db;
};

Bag open_bag(const fs::path& path) {
  Bag bag{path, open_database(path, SQLITE_OPEN_READONLY)};
  sqlite3_limit(bag.db.get(), SQLITE_LIMIT_LENGTH, static_cast<int>(kMaxMessage));
  distrust(bag.db, path);
  return bag;
}

/// Where one message lies.
struct MessageId {
  hal::UtcTime time;
  std::uint32_t file = 0;
  std::int64_t id = 0;
};

class BagStore final : public FrameStore {
 public:
  BagStore(const std::vector<fs::path>& files, std::vector<MessageId> messages, bool zstd, bool rvl, int width, int height)
      : messages_(std::move(messages)), unpacker_(zstd), rvl_(rvl), width_(width), height_(height) {
    for (const auto& m : messages_) times_.push_back(m.time);
    for (const auto& file : files) {
      bags_.push_back(open_bag(file));
      select_.push_back(prepare(bags_.back().db, file, "SELECT data FROM messages WHERE id = ?"));
    }
  }
  const std::vector<hal::UtcTime>& times() const override { return times_; }

  Load load(std::size_t i, std::vector<std::uint16_t>& depth) noexcept override {
    const MessageId& m = messages_[i];
    sqlite3_stmt* select = select_[m.file].get();
    sqlite3_bind_int64(select, 1, m.id);
    Load result = Load::broken;
    try {
      if (sqlite3_step(select) == SQLITE_ROW) {
        const auto bytes = unpacker_.unpack(blob(select, 0));
        if (rvl_ ? ros::read_compressed_image(bytes, width_, height_, depth) : ros::read_image(bytes, width_, height_, depth)) result = Load::ok;
      }
    } catch (const std::bad_alloc&) {  // a compressed message that says it is large: as good as broken
    }
    sqlite3_reset(select);
    return result;
  }

 private:
  std::vector<Bag> bags_;
  std::vector<Statement> select_;
  std::vector<MessageId> messages_;
  std::vector<hal::UtcTime> times_;
  Unpacker unpacker_;
  bool rvl_;
  int width_, height_;
};

struct Topic {
  std::string name, type;
  std::vector<MessageId> messages;
};

constexpr const char *kImage = "sensor_msgs/msg/Image", *kCompressedImage = "sensor_msgs/msg/CompressedImage";
bool is_image(const std::string& type) { return type == kImage || type == kCompressedImage; }

/// All topics in the order of their first appearance, with where their messages lie.
class Contents {
 public:
  Contents(std::vector<fs::path> files, bool zstd) : files_(std::move(files)), zstd_(zstd), unpacker_(zstd) {
    for (std::uint32_t i = 0; i < files_.size(); ++i) {
      bags_.push_back(open_bag(files_[i]));
      add(i);
    }
  }

  const std::vector<Topic>& topics() const { return topics_; }
  const std::vector<fs::path>& files() const { return files_; }
  bool zstd() const { return zstd_; }
  const Topic* find(const std::string& name) const {
    const auto it = std::find_if(topics_.begin(), topics_.end(), [&](const Topic& t) { return t.name == name; });
    return it == topics_.end() ? nullptr : &*it;
  }
  /// Calls `use` with the message's bytes while they are valid.
  template <typename Use>
  auto with(const MessageId& m, Use use) {
    const Statement s = prepare(bags_[m.file].db, files_[m.file], "SELECT data FROM messages WHERE id = ?");
    sqlite3_bind_int64(s.get(), 1, m.id);
    return use(sqlite3_step(s.get()) == SQLITE_ROW ? unpacker_.unpack(blob(s.get(), 0)) : std::span<const std::byte>{});
  }

 private:
  void add(std::uint32_t file) {
    std::map<std::int64_t, std::size_t> by_id;
    const auto text = [](sqlite3_stmt* s, int column) {
      const auto* t = reinterpret_cast<const char*>(sqlite3_column_text(s, column));
      return std::string(t == nullptr ? "" : t);
    };
    const Statement select_topics = prepare(bags_[file].db, files_[file], "SELECT id, name, type FROM topics ORDER BY id");
    int rc;
    std::size_t rows = 0;
    while ((rc = sqlite3_step(select_topics.get())) == SQLITE_ROW) {
      if (++rows > kMaxTopics) fail(files_[file], "has more than " + std::to_string(kMaxTopics) + " topics");
      const std::string name = text(select_topics.get(), 1), type = text(select_topics.get(), 2);
      const Topic* known = find(name);
      const std::size_t index = known != nullptr ? static_cast<std::size_t>(known - topics_.data()) : topics_.size();
      if (known == nullptr) topics_.push_back({name, type, {}});
      by_id[sqlite3_column_int64(select_topics.get(), 0)] = index;
    }
    done(rc, file);
    // The stamp of the message itself stands in its first 12 bytes; the time of the bag is when the recorder heard it.
    const Statement select = prepare(bags_[file].db, files_[file], "SELECT id, topic_id, timestamp, substr(data, 1, 12), length(data) FROM messages");
    const std::int64_t most = bytes_of(bags_[file].db, files_[file]);
    std::int64_t bytes = 0;
    std::size_t count = 0;
    while ((rc = sqlite3_step(select.get())) == SQLITE_ROW) {
      bytes += kLeastRow + sqlite3_column_int64(select.get(), 4);
      if (bytes > most) fail(files_[file], "names more messages than it has room for; the bag is damaged, try 'ros2 bag reindex'");
      if (++count > kMaxFrames) fail(files_[file], "has more than " + std::to_string(kMaxFrames) + " messages");
      const auto topic = by_id.find(sqlite3_column_int64(select.get(), 1));
      if (topic == by_id.end()) continue;
      MessageId m{hal::UtcTime(hal::Nanoseconds(sqlite3_column_int64(select.get(), 2))), file, sqlite3_column_int64(select.get(), 0)};
      hal::UtcTime stamp;
      if (!zstd_ && is_image(topics_[topic->second].type) && ros::read_stamp(blob(select.get(), 3), stamp)) m.time = stamp;
      topics_[topic->second].messages.push_back(m);
    }
    done(rc, file);
  }
  void done(int rc, std::uint32_t file) const {
    if (rc != SQLITE_DONE) fail(files_[file], std::string(sqlite3_errmsg(bags_[file].db.get())) + "; the bag is damaged, try 'ros2 bag reindex'");
  }

  std::vector<fs::path> files_;
  bool zstd_;
  Unpacker unpacker_;
  std::vector<Bag> bags_;
  std::vector<Topic> topics_;
};

std::string parent_topic(const std::string& name) { return name.substr(0, name.rfind('/')); }

/// What boothd did with the frames, where the bag is boothd's; what does not fit together is left out.
LiveGroups read_live(Contents& bag) {
  LiveGroups live;
  const Topic *groups = bag.find("/booth/group"), *joints = bag.find("/booth/joint_states");
  if (groups == nullptr || joints == nullptr || groups->messages.size() != joints->messages.size()) return live;
  std::vector<std::int64_t> values;
  for (std::size_t i = 0; i < groups->messages.size(); ++i) {
    if (!bag.with(groups->messages[i], [&](auto bytes) { return ros::read_integers(bytes, 4 + hal::kMostRecordedCameras, values); }) || values.size() < 5)
      continue;
    hal::FittedGroup& g = live.groups.emplace_back();
    g.sequence = static_cast<std::uint64_t>(values[0]);
    g.reference = hal::MonotonicTime(hal::Nanoseconds(values[1]));
    live.to_live = hal::Nanoseconds(values[2]);  // the same in all messages of a bag
    g.person = values[3] != 0;
    for (std::size_t c = 4; c < values.size(); ++c) g.captured[c - 4] = hal::MonotonicTime(hal::Nanoseconds(values[c]));
    if (!bag.with(joints->messages[i], [&](auto bytes) { return ros::read_joint_state(bytes, g.q); })) live.groups.pop_back();
  }
  return live;
}

/// The exact calibration beside a bag, where there is one and it is the bag's: ROS has no field for all of it and keeps rotations as quaternions.
void take_exact(const fs::path& file, std::vector<RecordedCameraData>& cameras) {
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return;
  for (const auto& exact : read_calibration(file))
    for (auto& camera : cameras) {
      auto& d = camera.description;
      if (ros_name(exact.name) != d.name || exact.intrinsics.width != d.intrinsics.width || exact.intrinsics.height != d.intrinsics.height) continue;
      d = exact;
      d.depth_scale = 0.001;
      break;
    }
}

/// Follows the transforms from a frame up to the one that has no parent.
bool to_root(const std::map<std::string, ros::Transform>& transforms, std::string frame, hal::RigidTransform& out) {
  out = {};
  bool found = false;
  for (int depth = 0; depth < 100; ++depth) {
    const auto t = transforms.find(frame);
    if (t == transforms.end()) return found;
    const auto& p = t->second.child_to_parent;
    hal::RigidTransform next;
    for (std::size_t r = 0; r < 3; ++r) {
      next.translation[r] = p.translation[r];
      for (std::size_t k = 0; k < 3; ++k) {
        next.translation[r] += p.rotation[3 * r + k] * out.translation[k];
        double sum = 0;
        for (std::size_t j = 0; j < 3; ++j) sum += p.rotation[3 * r + j] * out.rotation[3 * j + k];
        next.rotation[3 * r + k] = sum;
      }
    }
    out = next;
    frame = t->second.parent;
    found = true;
  }
  return false;  // a circle
}

}  // namespace

std::vector<RecordedCameraData> read_rosbag2(const fs::path& path, LiveGroups* live) {
  const Metadata metadata = read_metadata(path);
  Contents bag(metadata.files, metadata.zstd_messages);

  std::map<std::string, ros::Transform> transforms;
  if (const Topic* tf = bag.find("/tf_static"))
    for (const auto& m : tf->messages) {
      std::vector<ros::Transform> read;
      if (!bag.with(m, [&](auto bytes) { return ros::read_tf(bytes, read); })) fail(bag.files()[m.file], "a message of /tf_static is broken");
      for (auto& t : read) transforms[t.child] = t;
    }

  std::vector<RecordedCameraData> cameras;
  std::set<std::string> taken;
  std::string other_format;
  for (const Topic& topic : bag.topics()) {
    if (!is_image(topic.type) || topic.name.ends_with("/background") || topic.messages.empty()) continue;
    const bool rvl = topic.type == kCompressedImage;
    std::string frame_id, format;
    // Others are colour images, say.
    if (!bag.with(topic.messages.front(),
                  [&](auto bytes) { return rvl ? ros::read_compressed_header(bytes, frame_id, format) : ros::read_image_header(bytes, frame_id); })) {
      if (format.find("compressedDepth") != std::string::npos) other_format = topic.name + " ('" + format + "')";
      continue;
    }
    // The transport's name is a level of its own below the image's topic; where a bag holds both, one is enough.
    const std::string image_name = rvl ? parent_topic(topic.name) : topic.name;
    if (!taken.insert(image_name).second) continue;
    const fs::path& file = bag.files()[topic.messages.front().file];
    RecordedCameraData data;
    auto& d = data.description;
    const std::string base = parent_topic(image_name);
    d.name = base.substr(0, base.find('/', 1)).substr(base.empty() ? 0 : 1);

    const Topic* info = bag.find(base + "/camera_info");
    if (info == nullptr || info->messages.empty()) fail(file, "the depth images of " + topic.name + " have no " + base + "/camera_info beside them");
    std::string info_frame;
    if (!bag.with(info->messages.front(), [&](auto bytes) { return ros::read_camera_info(bytes, d.intrinsics, info_frame); }))
      fail(file, base + "/camera_info is broken or has a distortion model other than plumb_bob");
    if (!to_root(transforms, frame_id, d.camera_to_world)) fail(file, "/tf_static does not say where the frame '" + frame_id + "' of " + topic.name + " is");
    d.depth_scale = 0.001;  // 16UC1 depth is in millimetres by convention
    check_description(d, file.string());

    if (const Topic* empty_room = bag.find(base + "/background"))
      for (const auto& m : empty_room->messages) {
        auto& picture = data.background.emplace_back(static_cast<std::size_t>(d.intrinsics.width) * static_cast<std::size_t>(d.intrinsics.height));
        if (!bag.with(m, [&](auto bytes) { return ros::read_image(bytes, d.intrinsics.width, d.intrinsics.height, picture); })) data.background.pop_back();
        if (data.background.size() >= std::min(kMaxBackground, most_background(d.intrinsics))) break;
      }

    auto messages = topic.messages;
    std::stable_sort(messages.begin(), messages.end(), [](const MessageId& a, const MessageId& b) { return a.time < b.time; });
    messages.erase(std::unique(messages.begin(), messages.end(), [](const MessageId& a, const MessageId& b) { return a.time == b.time; }), messages.end());
    data.frames = std::make_unique<BagStore>(bag.files(), std::move(messages), bag.zstd(), rvl, d.intrinsics.width, d.intrinsics.height);
    d.nominal_rate = rate_of(data.frames->times());
    if (cameras.size() >= kMaxCameras) fail(file, "has more than " + std::to_string(kMaxCameras) + " depth cameras");
    cameras.push_back(std::move(data));
  }
  if (cameras.empty() && !other_format.empty())
    fail(path, other_format + " is compressed in a way that is not read; only '16UC1; compressedDepth rvl' and uncompressed images are");
  if (cameras.empty()) fail(path, "holds no topic with 16UC1 depth images (sensor_msgs/msg/Image, or CompressedImage with RVL)");
  take_exact(path / "calibration.toml", cameras);
  if (live != nullptr) *live = read_live(bag);
  return cameras;
}

}  // namespace booth::drivers
