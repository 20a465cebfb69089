// toml++ says where a value stands in the text; what stands there is exchanged, the last one first.
#include "daemon/calibrate/refined_calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "daemon/calibrate/calibration_store.hpp"
#include "daemon/config/toml_document.hpp"
#include "daemon/config/toml_text.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/io/file_bytes.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kLargest = 1u << 20;  // bytes of a calibration

struct Edit {
  std::size_t begin, end;  ///< bytes
  std::string text;
};

/// Places of a text by line and column, both from 1, columns counted in characters.
class Places {
 public:
  explicit Places(const std::string& text) : text_(text) {
    starts_.push_back(0);
    for (std::size_t i = 0; i < text.size(); ++i)
      if (text[i] == '\n') starts_.push_back(i + 1);
  }
  std::size_t at(const toml::source_position& p) const {
    std::size_t i = starts_.at(p.line - 1);
    for (auto column = p.column; column > 1 && i < text_.size(); --column) {
      ++i;
      while (i < text_.size() && (static_cast<unsigned char>(text_[i]) & 0xC0) == 0x80) ++i;
    }
    return i;
  }

 private:
  const std::string& text_;
  std::vector<std::size_t> starts_;
};

std::string matrix(const hal::RigidTransform& t) {
  std::string out = "[\n";
  for (std::size_t r = 0; r < 3; ++r)
    out += fmt::format("  [{}, {}, {}, {}],\n", toml_float(t.rotation[3 * r]), toml_float(t.rotation[3 * r + 1]), toml_float(t.rotation[3 * r + 2]),
                       toml_float(t.translation[r]));
  return out + "  [0.0, 0.0, 0.0, 1.0],\n]";
}

std::string provenance(const PersonRefinement& r, const RefinementOrigin& o) {
  std::string out = fmt::format(
      "\n[[refinement]]  # by a person before the cameras (docs/guide/calibrate.md); errors on frames that served no estimate\nutc = {}\nby = {}\nsoftware = "
      "{}\n"
      "recording = {}\nseconds = {}\nheld_out_frames = {}\nresidual_before_mm = {}\nresidual_after_mm = {}\ndisagreement_before_mm = {}\ndisagreement_after_mm "
      "= {}\n",
      toml_string(o.utc), toml_string(o.by), toml_string(o.software), toml_string(o.recording), toml_float(r.seconds), r.held_out_frames,
      toml_float(1e3 * r.residual_before), toml_float(1e3 * r.residual_after), toml_float(1e3 * r.disagreement_before), toml_float(1e3 * r.disagreement_after));
  for (std::size_t c = 0; c < r.cameras.size(); ++c)
    out += fmt::format("[[refinement.camera]]\nname = {}\nmoved_mm = {}\nturned_deg = {}\nlate_ms = {}\n", toml_string(r.cameras[c].name),
                       toml_float(1e3 * r.change[c].shift), toml_float(r.change[c].turn * 180 / 3.14159265358979), toml_float(1e3 * r.change[c].late));
  return out;
}

toml::table parsed(const std::string& text, const fs::path& file) {
  try {
    return parse_toml(text, file.string());
  } catch (const toml::parse_error& e) {
    throw std::runtime_error(fmt::format("{}: line {}: {}", file.string(), e.source().begin.line, e.description()));
  }
}

}  // namespace

std::string refined_calibration_text(const fs::path& file, const PersonRefinement& refinement, const RefinementOrigin& origin) {
  const std::vector<hal::CameraDescription> stored = read_cameras(file);  // says what is wrong with it
  const std::vector<double> late = read_time_offsets(file);
  std::string text = read_file_bytes(file, kLargest);
  const toml::table root = parsed(text, file);
  const Places places(text);
  std::vector<Edit> edits;
  for (std::size_t c = 0; c < refinement.cameras.size(); ++c) {
    const auto& camera = refinement.cameras[c];
    const auto it = std::find_if(stored.begin(), stored.end(), [&](const auto& s) { return s.name == camera.name; });
    if (it == stored.end()) throw std::runtime_error(fmt::format("{}: has no camera '{}'", file.string(), camera.name));
    const auto i = static_cast<std::size_t>(it - stored.begin());
    const toml::table& table = *(*root["camera"].as_array())[i].as_table();
    const auto exchange = [&](const toml::node& node, std::string value) {
      edits.push_back({places.at(node.source().begin), places.at(node.source().end), std::move(value)});
    };
    const std::string offset = toml_float(1e3 * (late[i] + refinement.change[c].late));
    const toml::node* known_offset = table.get("time_offset_ms");
    const toml::node& place = *table.get("camera_to_world");
    exchange(place, matrix(camera.camera_to_world) +
                        (known_offset != nullptr ? "" : fmt::format("\ntime_offset_ms = {}  # its time stamps lie so far behind its exposures", offset)));
    if (known_offset != nullptr) exchange(*known_offset, offset);
  }
  if (const auto utc = root["calibration"]["utc"]; utc.is_string())
    edits.push_back({places.at(utc.node()->source().begin), places.at(utc.node()->source().end), toml_string(origin.utc)});
  std::sort(edits.begin(), edits.end(), [](const Edit& a, const Edit& b) { return a.begin > b.begin; });
  for (const Edit& e : edits) text.replace(e.begin, e.end - e.begin, e.text);
  text += provenance(refinement, origin);
  (void)parsed(text, file);  // what is written can be read
  return with_checksum(text);
}

void store_refined_calibration(const fs::path& file, const PersonRefinement& refinement, const RefinementOrigin& origin) {
  if (!refinement.better) throw std::invalid_argument("a refinement that is not better is not stored");
  replace_calibration(file, refined_calibration_text(file, refinement, origin));
}

}  // namespace booth::daemon
