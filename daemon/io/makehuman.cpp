// Parsers of Wavefront OBJ (only v, g, f), .target text and the rig's JSON, each as strict as training needs.
#include "daemon/io/makehuman.hpp"

#include <charconv>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <stdexcept>

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using fit::train::BaseBody;
using fit::train::Target;

constexpr double kMetres = 0.1;  // files are decimetres
constexpr std::string_view kWhere = "give the folder that holds base.obj, targets/ and rigs/";

[[noreturn]] void fail(const fs::path& file, int line, const std::string& what) {
  throw std::runtime_error(file.string() + (line > 0 ? ":" + std::to_string(line) : "") + ": " + what);
}

std::ifstream open(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) fail(file, 0, "cannot be read; " + std::string(kWhere));
  return in;
}

/// Numbers in these files may start with "." or "-.", which from_chars accepts.
double number(const fs::path& file, int line, std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) fail(file, line, "'" + std::string(text) + "' is not a number");
  return value;
}

void read_obj(const fs::path& file, BaseBody& body) {
  auto in = open(file);
  std::vector<Eigen::Vector3d> vertices;
  std::map<std::string, std::set<int>> members;
  std::string text, group;
  for (int line = 1; std::getline(in, text); ++line) {
    std::istringstream words(text);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      std::string x, y, z;
      words >> x >> y >> z;
      vertices.emplace_back(number(file, line, x) * kMetres, number(file, line, y) * kMetres, number(file, line, z) * kMetres);
    } else if (kind == "g") {
      words >> group;
    } else if (kind == "f") {
      std::vector<int> corners;
      for (std::string word; words >> word;) {
        const double index = number(file, line, std::string_view(word).substr(0, word.find('/')));
        if (index < 1 || index > static_cast<double>(vertices.size())) fail(file, line, "face names vertex " + word + ", which does not exist");
        corners.push_back(static_cast<int>(index) - 1);
      }
      const bool eye = group == "helper-l-eye" || group == "helper-r-eye";
      if (group == "body" || eye) {
        if (corners.size() != 4) fail(file, line, "expected a face of four corners");
        (eye ? body.occluder_quads : body.quads).push_back({corners[0], corners[1], corners[2], corners[3]});
      }
      if (group == "body" || group.starts_with("joint-")) members[group].insert(corners.begin(), corners.end());
    }
  }
  if (body.quads.empty()) fail(file, 0, "has no group 'body'");
  body.skin_vertices = *members["body"].rbegin() + 1;
  if (body.skin_vertices != static_cast<int>(members["body"].size())) fail(file, 0, "the vertices of group 'body' do not stand first");
  body.vertices.resize(3, static_cast<Eigen::Index>(vertices.size()));
  for (std::size_t i = 0; i < vertices.size(); ++i) body.vertices.col(static_cast<Eigen::Index>(i)) = vertices[i];
  for (const auto& [name, set] : members)
    if (name != "body") body.points[name] = {set.begin(), set.end()};
}

Target read_target(const fs::path& file, int vertex_count) {
  auto in = open(file);
  Target target;
  std::string text;
  for (int line = 1; std::getline(in, text); ++line) {
    if (text.empty() || text.front() == '#') continue;
    std::istringstream words(text);
    std::string index, x, y, z;
    if (!(words >> index)) continue;
    words >> x >> y >> z;
    const double vertex = number(file, line, index);
    if (vertex < 0 || vertex >= vertex_count) fail(file, line, "vertex " + index + " does not exist in base.obj");
    target.vertex.push_back(static_cast<int>(vertex));
    target.offset.emplace_back(static_cast<float>(number(file, line, x) * kMetres), static_cast<float>(number(file, line, y) * kMetres),
                               static_cast<float>(number(file, line, z) * kMetres));
  }
  return target;
}

nlohmann::json read_json(const fs::path& file) {
  auto in = open(file);
  auto json = nlohmann::json::parse(in, nullptr, false);
  if (json.is_discarded()) fail(file, 0, "is not JSON");
  return json;
}

std::string without_ending(const std::string& name) { return name.ends_with(".target") ? name.substr(0, name.size() - 7) : name; }

void read_targets(const fs::path& directory, BaseBody& body) {
  const auto alias = read_json(directory / "alias.json");
  if (!alias.is_object()) fail(directory / "alias.json", 0, "expected an object of target names");
  const int count = static_cast<int>(body.vertices.cols());
  for (const auto& [name, stored] : alias.items()) body.targets[without_ending(name)] = read_target(directory / stored.get<std::string>(), count);
  // Almost empty upstream: this corner would keep the stature of an average person. All other files of the same sex and age agree.
  for (const std::string sex : {"male", "female"}) {
    const std::string prefix = "macrodetails/height/" + sex + "-old-";
    body.targets[prefix + "maxmuscle-maxweight-minheight"] = body.targets.at(prefix + "averagemuscle-averageweight-minheight");
  }
}

void read_weights(const fs::path& file, BaseBody& body) {
  const auto json = read_json(file);
  if (!json.contains("weights")) fail(file, 0, "has no key 'weights'");
  for (const auto& [bone, entries] : json.at("weights").items())
    for (const auto& entry : entries) {
      const int vertex = entry.at(0).get<int>();
      const float weight = entry.at(1).get<float>();
      if (vertex < 0 || vertex >= body.vertices.cols() || !(weight >= 0))
        fail(file, 0, "bone " + bone + " has a weight of a vertex that does not exist, or a negative one");
      body.weights[bone].emplace_back(vertex, weight);
    }
}

}  // namespace

BaseBody load_makehuman(const fs::path& directory) {
  BaseBody body;
  read_obj(directory / "base.obj", body);
  try {
    read_targets(directory / "targets", body);
    read_weights(directory / "rigs" / "default_weights.mhw", body);
  } catch (const nlohmann::json::exception& e) {
    fail(directory, 0, std::string("unexpected JSON: ") + e.what());
  } catch (const std::out_of_range&) {
    fail(directory / "targets", 0, "lacks the height targets; " + std::string(kWhere));
  }
  return body;
}

}  // namespace booth::daemon
