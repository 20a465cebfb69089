// A rosbag2 folder as ROS 2 writes it: metadata.yaml (version 5) and one SQLite file.
#include <fstream>
#include <stdexcept>

#include "drivers/recording/layouts.hpp"
#include "drivers/recording/ros_messages.hpp"
#include "drivers/recording/sqlite.hpp"
#include "drivers/recording/staging.hpp"
#include "drivers/recording/truth_file.hpp"

namespace booth::drivers {
namespace {

// Latched topics are offered as ROS offers them, so that a player that starts late still gets them.
constexpr const char* kReliable =
    "- history: 1\n  depth: 10\n  reliability: 1\n  durability: 2\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n   "
    " nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  avoid_ros_namespace_conventions: false";
constexpr const char* kLatched =
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    "
    "nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  avoid_ros_namespace_conventions: false";

/// A ROS name: letters, digits and underscores, no digit first.
std::string ros_name(const std::string& name) {
  std::string out;
  for (const char c : name) out += (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ? c : '_';
  return out.empty() || (out[0] >= '0' && out[0] <= '9') ? "camera_" + out : out;
}

std::string yaml_quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '\n' ? std::string("\\n") : std::string(1, c);
  return out + "\"";
}

class Rosbag2Writer final : public hal::DepthSink {
 public:
  Rosbag2Writer(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras, const std::optional<TruthBody>& body,
                const std::vector<hal::DepthFrame>& background)
      : staging_(path),
        cameras_(cameras),
        beta_(body ? body->beta : std::vector<double>{}),
        file_name_(staging_.final_path().filename().string() + "_0.db3"),
        file_(staging_.folder() / file_name_),
        background_(background),
        db_(open_database(file_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE)) {
    for (const auto& c : cameras_)
      if (c.depth_scale != 0.001)
        throw std::runtime_error("camera '" + c.name + "' counts " + std::to_string(c.depth_scale) +
                                 " m, ROS depth images are in millimetres: use the folder layout");
    // The staging folder is what makes this atomic; a journal would only cost time.
    execute("PRAGMA journal_mode=OFF");
    execute("PRAGMA synchronous=OFF");
    execute("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)");
    execute("CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL)");
    execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT "
        "NULL)");
    execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)");
    execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)");
    execute("INSERT INTO schema VALUES (3, 'humble')");
    insert_ = prepare(db_, file_, "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)");
    execute("BEGIN");
    for (const auto& c : cameras_) {
      const std::string base = "/" + ros_name(c.name) + "/depth";
      image_topic_.push_back(add_topic(base + "/image_raw", "sensor_msgs/msg/Image", kReliable));
      info_topic_.push_back(add_topic(base + "/camera_info", "sensor_msgs/msg/CameraInfo", kReliable));
      background_topic_.push_back(add_topic(base + "/background", "sensor_msgs/msg/Image", kLatched));
      frame_id_.push_back(ros_name(c.name) + "_depth_optical_frame");
    }
    tf_topic_ = add_topic("/tf_static", "tf2_msgs/msg/TFMessage", kLatched);
    if (body) write_truth_ply(staging_.folder() / "truth.ply", *body);
    last_.resize(cameras_.size());
  }

  void write(const hal::DepthFrame& frame, hal::UtcTime utc) override {
    const auto& camera = camera_of(frame, cameras_);
    const auto i = static_cast<std::size_t>(hal::to_int(frame.camera));
    if (!begun_) write_latched(utc);
    // A wall clock that was set back must not change the order of frames.
    last_[i] = std::max(utc, last_[i] + hal::Nanoseconds(1));
    ros::image(camera, last_[i], frame_id_[i], frame.depth, bytes_);
    insert(image_topic_[i], last_[i]);
    ros::camera_info(camera, last_[i], frame_id_[i], bytes_);
    insert(info_topic_[i], last_[i]);
  }

  void write_truth(hal::UtcTime utc, const hal::TruthSample& truth) override {
    if (!truth_) truth_.emplace(staging_.folder() / "truth.csv", beta_);
    truth_->write(utc, truth);
  }

  void close() override {
    execute("COMMIT");
    insert_.reset();
    db_.reset();
    if (truth_) truth_->close();
    write_metadata();
    staging_.publish();
  }

 private:
  struct Topic {
    std::string name, type;
    const char* qos;
    std::uint64_t messages = 0;
  };

  [[noreturn]] void fail() const { throw std::runtime_error("cannot write " + file_.string() + ": " + sqlite3_errmsg(db_.get()) + "; check the disk's space"); }
  void execute(const char* sql) {
    if (sqlite3_exec(db_.get(), sql, nullptr, nullptr, nullptr) != SQLITE_OK) fail();
  }

  std::size_t add_topic(const std::string& name, const std::string& type, const char* qos) {
    for (const Topic& t : topics_)
      if (t.name == name) throw std::runtime_error("two cameras have the same name in ROS ('" + name + "'): rename one");
    topics_.push_back({name, type, qos});
    const Statement s = prepare(db_, file_, "INSERT INTO topics VALUES (?, ?, ?, 'cdr', ?)");
    sqlite3_bind_int64(s.get(), 1, static_cast<sqlite3_int64>(topics_.size()));
    sqlite3_bind_text(s.get(), 2, name.c_str(), -1, SQLITE_TRANSIENT);
    sqlite3_bind_text(s.get(), 3, type.c_str(), -1, SQLITE_TRANSIENT);
    sqlite3_bind_text(s.get(), 4, qos, -1, SQLITE_STATIC);
    if (sqlite3_step(s.get()) != SQLITE_DONE) fail();
    return topics_.size() - 1;
  }

  void insert(std::size_t topic, hal::UtcTime time) {
    sqlite3_bind_int64(insert_.get(), 1, static_cast<sqlite3_int64>(topic + 1));
    sqlite3_bind_int64(insert_.get(), 2, time.time_since_epoch().count());
    sqlite3_bind_blob64(insert_.get(), 3, bytes_.data(), bytes_.size(), SQLITE_STATIC);
    if (sqlite3_step(insert_.get()) != SQLITE_DONE) fail();
    sqlite3_reset(insert_.get());
    ++topics_[topic].messages;
    first_ = begun_ ? std::min(first_, time) : time;
    latest_ = begun_ ? std::max(latest_, time) : time;
    begun_ = true;
  }

  /// What a player needs before the first frame: where the cameras are and what the empty room looks like.
  void write_latched(hal::UtcTime utc) {
    ros::tf_static(cameras_, frame_id_, utc, bytes_);
    insert(tf_topic_, utc);
    for (const auto& frame : background_) {
      const auto& camera = camera_of(frame, cameras_);
      const auto i = static_cast<std::size_t>(hal::to_int(frame.camera));
      ros::image(camera, utc, frame_id_[i], frame.depth, bytes_);
      insert(background_topic_[i], utc);
    }
  }

  void write_metadata() const {
    std::uint64_t total = 0;
    for (const Topic& t : topics_) total += t.messages;
    const auto start = first_.time_since_epoch().count(), duration = (latest_ - first_).count();
    std::ofstream out(staging_.folder() / "metadata.yaml");
    out << "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  duration:\n    nanoseconds: " << duration
        << "\n  starting_time:\n    nanoseconds_since_epoch: " << start << "\n  message_count: " << total << "\n  topics_with_message_count:\n";
    for (const Topic& t : topics_)
      out << "    - topic_metadata:\n        name: " << t.name << "\n        type: " << t.type
          << "\n        serialization_format: cdr\n        offered_qos_profiles: " << yaml_quoted(t.qos) << "\n      message_count: " << t.messages << "\n";
    out << "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " << file_name_ << "\n  files:\n    - path: " << file_name_
        << "\n      starting_time:\n        nanoseconds_since_epoch: " << start << "\n      duration:\n        nanoseconds: " << duration
        << "\n      message_count: " << total << "\n";
    out.close();
    if (!out) throw std::runtime_error("cannot write " + (staging_.folder() / "metadata.yaml").string() + "; check the disk's space");
  }

  Staging staging_;
  const std::vector<hal::CameraDescription> cameras_;
  const std::vector<double> beta_;
  const std::string file_name_;
  const std::filesystem::path file_;
  const std::vector<hal::DepthFrame> background_;
  Database db_;
  Statement insert_;
  std::vector<Topic> topics_;
  std::vector<std::size_t> image_topic_, info_topic_, background_topic_;
  std::size_t tf_topic_ = 0;
  std::vector<std::string> frame_id_;
  std::vector<hal::UtcTime> last_;
  hal::UtcTime first_{}, latest_{};
  bool begun_ = false;
  ros::Bytes bytes_;
  std::optional<TruthWriter> truth_;
};

}  // namespace

std::unique_ptr<hal::DepthSink> write_rosbag2(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras,
                                              const std::optional<TruthBody>& body, const std::vector<hal::DepthFrame>& background) {
  return std::make_unique<Rosbag2Writer>(path, cameras, body, background);
}

}  // namespace booth::drivers
