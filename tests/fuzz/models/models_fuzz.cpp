// Model files whose arrays were worked on: a model or prior that passes its checks, or one sentence; never numbers that are none.
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>

#include "daemon/io/model_file.hpp"
#include "daemon/io/npz.hpp"
#include "fit/body/skeleton.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace booth::daemon;
using booth::fuzz::Input;
using booth::fuzz::require;

struct Array {
  NpzType type = NpzType::f8;
  std::vector<std::size_t> shape;
  std::vector<double> values;
  std::vector<std::string> texts;
  bool scalar = false;
};
using Arrays = std::map<std::string, Array>;

Array numbers(NpzType type, std::vector<std::size_t> shape, std::vector<double> values) { return {type, std::move(shape), std::move(values), {}, false}; }
Array text(const std::string& value) { return {NpzType::text, {}, {}, {value}, true}; }

/// The smallest body that there can be: sixteen vertices, one of them a joint's all.
Arrays small_model() {
  constexpr std::size_t kVertices = 16, kJoints = 24;
  Arrays out;
  out["kind"] = text("boothd-body-model");
  out["format"] = numbers(NpzType::i4, {}, {1});
  out["version"] = text("v");
  out["sex"] = text("men");
  std::vector<double> places, regressor(kJoints * kVertices), weights(kVertices * kJoints), mirror, tree;
  for (std::size_t v = 0; v < kVertices; ++v) {
    for (int axis = 0; axis < 3; ++axis) places.push_back(0.05 * static_cast<double>(v * 3 + static_cast<std::size_t>(axis)) / 3);
    weights[v * kJoints] = 1;
    mirror.push_back(static_cast<double>(v));
  }
  for (std::size_t j = 0; j < kJoints; ++j) regressor[j * kVertices + j % kVertices] = 1;
  for (const auto& bone : booth::fit::bones()) tree.push_back(bone.parent);
  for (std::size_t j = 0; j < kJoints; ++j) tree.push_back(static_cast<double>(j));
  out["v_template"] = numbers(NpzType::f4, {kVertices, 3}, places);
  out["shapedirs"] = numbers(NpzType::f4, {kVertices, 3, 1}, std::vector<double>(kVertices * 3, 0.001));
  out["explained"] = numbers(NpzType::f8, {1}, {1});
  out["f"] = numbers(NpzType::i4, {2, 3}, {0, 1, 2, 1, 2, 3});
  out["J_regressor"] = numbers(NpzType::f4, {kJoints, kVertices}, regressor);
  out["q_rest"] = numbers(NpzType::f8, {36}, std::vector<double>(36));
  out["mirror_vertex"] = numbers(NpzType::i4, {kVertices}, mirror);
  out["landmarks"] = numbers(NpzType::i4, {1}, {0});
  out["kintree_table"] = numbers(NpzType::i4, {2, kJoints}, tree);
  out["weights"] = numbers(NpzType::f4, {kVertices, kJoints}, weights);
  return out;
}

Arrays arrays_of(const NpzReader& file) {
  Arrays out;
  for (const auto& key : file.keys()) {
    const NpzArray& from = file.array(key);
    Array& to = out[key];
    to.type = from.type;
    to.shape = from.shape;
    to.texts = from.texts;
    to.scalar = from.type == NpzType::text && from.shape.empty();
    if (from.type != NpzType::text)
      for (std::size_t i = 0; i < from.size(); ++i) to.values.push_back(from.number(i));
  }
  return out;
}

const Arrays& prior() {
  static const Arrays arrays = [] {
    Arrays whole = arrays_of(NpzReader(find_models() / "pose.npz"));
    // A few exemplars are as good as all, and quicker.
    Array& exemplars = whole["exemplars"];
    if (exemplars.shape.size() == 2 && exemplars.shape[0] > 4) {
      exemplars.shape[0] = 4;
      exemplars.values.resize(4 * exemplars.shape[1]);
    }
    return whole;
  }();
  return arrays;
}

double any_number(Input& in) {
  switch (in.u8() % 8) {
    case 0:
      return std::numeric_limits<double>::quiet_NaN();
    case 1:
      return std::numeric_limits<double>::infinity();
    case 2:
      return -1;
    case 3:
      return 1e30;
    case 4:
      return in.u16();
    case 5:
      return 0;
    default:
      return (static_cast<double>(in.u16()) - 32768) / 1024;
  }
}

void work_on(Arrays& arrays, Input& in) {
  for (int edits = 0; edits < 6 && !in.empty() && !arrays.empty(); ++edits) {
    const auto it = std::next(arrays.begin(), static_cast<std::ptrdiff_t>(in.u8() % arrays.size()));
    Array& a = it->second;
    switch (in.u8() % 6) {
      case 0:
        arrays.erase(it);
        break;
      case 1:
        if (!a.values.empty()) a.values[in.u16() % a.values.size()] = any_number(in);
        break;
      case 2:  // fewer or more along one side
        if (!a.shape.empty() && !a.values.empty()) {
          auto& side = a.shape[in.u8() % a.shape.size()];
          side = in.u8() % 32;
          std::size_t size = 1;
          for (const auto s : a.shape) size *= s;
          a.values.resize(size, 0.25);
        }
        break;
      case 3:
        for (double& value : a.values) value = any_number(in);
        break;
      case 4:
        if (!a.texts.empty()) a.texts[0] = std::string(in.u8() % 40, static_cast<char>(in.u8()));
        break;
      default:
        if (a.type != NpzType::text) a.type = std::array{NpzType::f2, NpzType::f4, NpzType::f8, NpzType::i4, NpzType::i8, NpzType::u1}[in.u8() % 6];
    }
  }
}

std::string archive_of(const Arrays& arrays) {
  NpzWriter file;
  for (const auto& [key, a] : arrays) {
    if (a.type == NpzType::text) {
      file.add_texts(key, a.texts, a.scalar);
      continue;
    }
    std::vector<double> values = a.values;
    const bool whole = a.type == NpzType::i4 || a.type == NpzType::i8 || a.type == NpzType::u1;
    for (double& v : values) v = whole ? (std::abs(v) < 1e9 ? (a.type == NpzType::u1 ? std::abs(std::fmod(v, 256)) : v) : 7) : v;
    file.add(key, a.type, a.shape, values);
  }
  return file.archive();
}

template <class F>
void load(F loader) {
  try {
    loader();
  } catch (const std::runtime_error& e) {
    require(std::string(e.what()).find("m.npz") != std::string::npos, "the sentence names the file");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const booth::fuzz::Scratch scratch;
  static const Arrays model = small_model();
  Input in(data, size);
  const bool is_model = in.u8() % 2 == 0;
  Arrays arrays = is_model ? model : prior();
  work_on(arrays, in);
  std::string archive;
  try {
    archive = archive_of(arrays);
  } catch (const std::exception&) {
    return 0;  // what our own writer does not write
  }
  const auto file = scratch.put("m.npz", archive);
  if (is_model) {
    load([&] { require(load_body_model(file).data().mean.allFinite(), "a model is finite"); });
    load([&] { (void)load_body_model_paper(file); });
  } else {
    load([&] {
      const auto p = load_pose_prior(file);
      require(p.mean.allFinite() && p.components.allFinite() && p.sigma.allFinite(), "a prior is finite");
    });
  }
  load([&] { (void)load_test_bodies(file); });
  return 0;
}
