// assimp converts in memory.
#include "daemon/record/export/fbx_file.hpp"

#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include "daemon/io/atomic_file.hpp"
#include "daemon/record/export/fbx_repair.hpp"

namespace booth::daemon {
namespace {

constexpr std::int64_t kSecond = 46'186'158'000;  ///< FBX's unit of time

/// assimp's exporter knows whole seconds only: each frame becomes a second, and the repair makes it a frame again. Returns the number of the last frame.
std::int64_t frames_as_seconds(aiScene& scene, int rate) {
  double last = 0;
  const auto mend = [&](auto* keys, unsigned count, double ticks) {
    for (unsigned k = 0; k < count; ++k) last = std::max(last, keys[k].mTime = std::round(keys[k].mTime / ticks * rate));
  };
  for (unsigned a = 0; a < scene.mNumAnimations; ++a) {
    aiAnimation& animation = *scene.mAnimations[a];
    const double ticks = animation.mTicksPerSecond > 0 ? animation.mTicksPerSecond : 1;
    for (unsigned c = 0; c < animation.mNumChannels; ++c) {
      aiNodeAnim& channel = *animation.mChannels[c];
      mend(channel.mPositionKeys, channel.mNumPositionKeys, ticks);
      mend(channel.mRotationKeys, channel.mNumRotationKeys, ticks);
      mend(channel.mScalingKeys, channel.mNumScalingKeys, ticks);
    }
    animation.mTicksPerSecond = 1;
    animation.mDuration = last;
  }
  return std::llround(last);
}

}  // namespace

void convert_glb_to_fbx(const std::filesystem::path& glb, const std::filesystem::path& fbx, int rate) {
  Assimp::Importer importer;
  importer.ReadFile(glb.string(), 0);
  const std::unique_ptr<aiScene> scene(importer.GetOrphanedScene());
  if (!scene) throw std::runtime_error(fbx.string() + ": cannot be made: " + importer.GetErrorString());
  const std::int64_t frames = frames_as_seconds(*scene, rate);
  Assimp::Exporter exporter;
  const aiExportDataBlob* blob = exporter.ExportToBlob(scene.get(), "fbx");
  if (!blob) throw std::runtime_error(fbx.string() + ": cannot be made: " + exporter.GetErrorString());
  const auto repaired = repair_fbx({static_cast<const char*>(blob->data), blob->size}, rate, frames * kSecond / rate);
  if (!repaired) throw std::runtime_error(fbx.string() + ": cannot be made: this version of assimp writes an FBX that is not understood");
  write_file_atomically(fbx, *repaired);
}

}  // namespace booth::daemon
