// Parsing trusts no count and no index that a file states.
#include "drivers/recording/truth_file.hpp"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "drivers/recording/text.hpp"

namespace booth::drivers {
namespace {

// The order of the CMU average skeleton; a test holds it against the fit's table.
constexpr std::array<std::string_view, hal::kTruthJoints> kJointNames{
    "root",      "lhip",      "lknee",  "lankle", "lfoot_end", "ltoe_end",  "rhip",   "rknee",  "rankle",    "rfoot_end",  "rtoe_end",  "spine_pivot",
    "chest_top", "lshoulder", "lelbow", "lwrist", "lhand_end", "rshoulder", "relbow", "rwrist", "rhand_end", "neck_pivot", "head_base", "head_top"};

constexpr std::size_t kMaxRows = 20'000'000, kMaxVertices = 1'000'000, kMaxFaces = 2'000'000;
// Between rows further apart than this nothing is known.
constexpr hal::Nanoseconds kLargestGap = std::chrono::milliseconds(100);

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what) { throw std::runtime_error(path.string() + ": " + what); }

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  while (true) {
    const auto comma = line.find(',');
    fields.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

}  // namespace

const std::array<std::string_view, hal::kTruthJoints>& truth_joint_names() { return kJointNames; }

TruthWriter::TruthWriter(const std::filesystem::path& path, std::vector<double> beta)
    : path_(path), file_(std::fopen(path.c_str(), "we")), beta_(std::move(beta)) {
  check(file_ != nullptr);
  std::string header = "timestamp";
  for (int i = 0; i < hal::kTruthDofs; ++i) header += ",q" + std::to_string(i);
  for (std::size_t i = 0; i < beta_.size(); ++i) header += ",beta" + std::to_string(i);
  for (const auto name : kJointNames)
    for (const char* axis : {"_x", "_y", "_z"}) header += "," + std::string(name) + axis;
  check(std::fputs((header + "\n").c_str(), file_.get()) >= 0);
}

void TruthWriter::check(bool ok) const {
  if (!ok) throw std::runtime_error("cannot write " + path_.string() + ": " + std::strerror(errno) + "; check the disk's space and permissions");
}

void TruthWriter::write(hal::UtcTime time, const hal::TruthSample& sample) {
  last_ = std::max(time, last_ + hal::Nanoseconds(1));  // rows stay in order whatever the wall clock does
  std::string line = format_seconds(last_);
  for (const double q : sample.q) line += "," + format_number(q);
  for (const double b : beta_) line += "," + format_number(b);
  for (const auto& joint : sample.joints)
    for (const double x : joint) line += "," + format_number(static_cast<float>(x));
  check(std::fputs((line + "\n").c_str(), file_.get()) >= 0);
}

void TruthWriter::close() {
  check(std::fflush(file_.get()) == 0);
  check(std::fclose(file_.release()) == 0);
}

std::vector<TruthRow> read_truth_csv(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) fail(path, "cannot be read");
  std::string line;
  if (!std::getline(in, line)) fail(path, "is empty; it must begin with a header line");
  const auto header = split(line);
  const auto column = [&](const std::string& name) {
    const auto it = std::find(header.begin(), header.end(), name);
    if (it == header.end()) fail(path, "line 1: the column '" + name + "' is missing");
    return static_cast<std::size_t>(it - header.begin());
  };
  const std::size_t time_column = column("timestamp");
  std::vector<std::size_t> columns;
  columns.reserve(hal::kTruthDofs + 3 * kJointNames.size());
  for (int i = 0; i < hal::kTruthDofs; ++i) columns.push_back(column("q" + std::to_string(i)));
  for (const auto name : kJointNames)
    for (const char* axis : {"_x", "_y", "_z"}) columns.push_back(column(std::string(name) + axis));
  const std::size_t width = header.size();

  std::vector<TruthRow> rows;
  for (std::size_t number = 2; std::getline(in, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    const std::string place = "line " + std::to_string(number) + ": ";
    const auto fields = split(line);
    if (fields.size() != width) fail(path, place + std::to_string(fields.size()) + " columns, the header has " + std::to_string(width));
    const auto time = parse_seconds(fields[time_column]);
    if (!time) fail(path, place + "the timestamp is no number of seconds");
    if (!rows.empty() && *time <= rows.back().time) fail(path, place + "the timestamp is not after the one before");
    if (rows.size() >= kMaxRows) fail(path, place + "more rows than " + std::to_string(kMaxRows));
    rows.emplace_back();
    rows.back().time = *time;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const auto value = parse_number(fields[columns[i]]);
      if (!value) fail(path, place + "column " + std::string(header.size() > columns[i] ? std::to_string(columns[i] + 1) : "?") + " is no finite number");
      if (i < hal::kTruthDofs)
        rows.back().sample.q[i] = *value;
      else
        rows.back().sample.joints[(i - hal::kTruthDofs) / 3][(i - hal::kTruthDofs) % 3] = *value;
    }
  }
  return rows;
}

void write_truth_ply(const std::filesystem::path& path, const TruthBody& body) {
  static_assert(std::endian::native == std::endian::little, "truth.ply is written in the machine's byte order");
  std::ofstream out(path, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\ncomment resting body, CMU axes (y up, z forward, x left), metres\ncomment name " << body.name
      << "\ncomment sex " << body.sex << "\ncomment beta";
  for (const double b : body.beta) out << ' ' << format_number(b);
  out << "\nelement vertex " << body.vertices.size() << "\nproperty float x\nproperty float y\nproperty float z\n";
  for (int i = 0; i < kTruthSkinBones; ++i) out << "property uchar bone" << i << "\n";
  for (int i = 0; i < kTruthSkinBones; ++i) out << "property float weight" << i << "\n";
  out << "element face " << body.faces.size() << "\nproperty list uchar int vertex_indices\nelement joint " << kTruthBones
      << "\nproperty double x\nproperty double y\nproperty double z\nelement rest_pose 36\nproperty double q\nend_header\n";
  const auto put = [&](const auto& value) { out.write(reinterpret_cast<const char*>(&value), sizeof value); };
  for (std::size_t v = 0; v < body.vertices.size(); ++v) {
    put(body.vertices[v]);
    for (const int b : body.bones[v]) put(static_cast<std::uint8_t>(b));
    put(body.weights[v]);
  }
  for (const auto& f : body.faces) {
    put(std::uint8_t{3});
    put(f);
  }
  put(body.rest_joints);
  put(body.rest_pose);
  out.close();
  if (!out) fail(path, "cannot be written; check the disk's space and permissions");
}

TruthBody read_truth_ply(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(path, "cannot be read");
  TruthBody body;
  std::size_t vertices = 0, faces = 0;
  std::string layout, line;
  for (int lines = 0; std::getline(in, line) && line != "end_header"; ++lines) {
    if (lines > 100 || line.size() > 4096) fail(path, "its header is too long; it was not written by boothctl simulate");
    std::istringstream words(line);
    std::string first, second;
    words >> first >> second;
    if (first == "comment") {
      if (second == "name") std::getline(words >> std::ws, body.name);
      if (second == "sex") words >> body.sex;
      double b = 0;
      if (second == "beta")
        while (words >> b && body.beta.size() < 1000) body.beta.push_back(b);
      continue;
    }
    if (first == "element" && second == "vertex") words >> vertices;
    if (first == "element" && second == "face") words >> faces;
    layout += first == "element" ? "element " + second + "\n" : line + "\n";
  }
  constexpr std::string_view kLayout =
      "ply\nformat binary_little_endian 1.0\nelement vertex\nproperty float x\nproperty float y\nproperty float z\nproperty uchar bone0\nproperty uchar bone1\n"
      "property uchar bone2\nproperty uchar bone3\nproperty float weight0\nproperty float weight1\nproperty float weight2\nproperty float weight3\nelement "
      "face\n"
      "property list uchar int vertex_indices\nelement joint\nproperty double x\nproperty double y\nproperty double z\nelement rest_pose\nproperty double q\n";
  if (!in || layout != kLayout) fail(path, "is not a truth.ply as boothctl simulate writes it; remove it to open the recording without its surface");
  if (vertices > kMaxVertices || faces > kMaxFaces)
    fail(path, "says it has " + std::to_string(vertices) + " vertices and " + std::to_string(faces) + " faces, more than allowed");
  const auto get = [&](auto& value) {
    if (!in.read(reinterpret_cast<char*>(&value), sizeof value)) fail(path, "ends too early");
  };
  for (std::size_t v = 0; v < vertices; ++v) {
    std::array<std::uint8_t, kTruthSkinBones> bones;
    get(body.vertices.emplace_back());
    get(bones);
    get(body.weights.emplace_back());
    auto& own = body.bones.emplace_back();
    for (std::size_t i = 0; i < kTruthSkinBones; ++i) {
      own[i] = bones[i];
      const float w = body.weights.back()[i];
      if (bones[i] >= kTruthBones || !(w >= 0 && w <= 1)) fail(path, "vertex " + std::to_string(v) + " has a bone or weight out of range");
    }
    for (const float x : body.vertices.back())
      if (!(std::abs(x) < 10)) fail(path, "vertex " + std::to_string(v) + " is not in metres");
  }
  for (std::size_t f = 0; f < faces; ++f) {
    std::uint8_t corners = 0;
    get(corners);
    if (corners != 3) fail(path, "face " + std::to_string(f) + " is no triangle");
    get(body.faces.emplace_back());
    for (const int v : body.faces.back())
      if (v < 0 || static_cast<std::size_t>(v) >= vertices) fail(path, "face " + std::to_string(f) + " names a vertex that does not exist");
  }
  get(body.rest_joints);
  get(body.rest_pose);
  for (const auto& j : body.rest_joints)
    for (const double x : j)
      if (!(std::abs(x) < 10)) fail(path, "a joint is not in metres");
  for (const double q : body.rest_pose)
    if (!(std::abs(q) < 100)) fail(path, "the resting pose is out of range");
  return body;
}

RecordedTruth::RecordedTruth(std::vector<TruthRow> rows, std::optional<TruthBody> body, TruthSurface surface, std::shared_ptr<const Timeline> timeline,
                             hal::UtcTime zero)
    : rows_(std::move(rows)), body_(std::move(body)), surface_(std::move(surface)), timeline_(std::move(timeline)), zero_(zero) {}

std::optional<hal::TruthSample> RecordedTruth::at(hal::MonotonicTime t) const {
  if (!timeline_->begun()) return std::nullopt;
  const hal::UtcTime when = zero_ + (t - timeline_->origin());
  const auto after = std::lower_bound(rows_.begin(), rows_.end(), when, [](const TruthRow& r, hal::UtcTime w) { return r.time < w; });
  if (after == rows_.end()) return std::nullopt;
  if (after->time == when) return after->sample;
  if (after == rows_.begin()) return std::nullopt;
  const TruthRow &a = *(after - 1), &b = *after;
  if (b.time - a.time > kLargestGap) return std::nullopt;
  const double u = hal::seconds(when - a.time) / hal::seconds(b.time - a.time);
  hal::TruthSample s;
  for (std::size_t i = 0; i < s.q.size(); ++i) s.q[i] = a.sample.q[i] + u * (b.sample.q[i] - a.sample.q[i]);
  for (std::size_t j = 0; j < s.joints.size(); ++j)
    for (std::size_t i = 0; i < 3; ++i) s.joints[j][i] = a.sample.joints[j][i] + u * (b.sample.joints[j][i] - a.sample.joints[j][i]);
  return s;
}

std::vector<std::array<float, 3>> RecordedTruth::surface(hal::MonotonicTime t) const {
  if (!surface_ || !body_) return {};
  const auto sample = at(t);
  return sample ? surface_(*body_, sample->q) : std::vector<std::array<float, 3>>{};
}

const std::vector<std::array<int, 3>>& RecordedTruth::faces() const {
  static const std::vector<std::array<int, 3>> none;
  return body_ ? body_->faces : none;
}

}  // namespace booth::drivers
