// assimp converts in memory.
#include "daemon/record/export/fbx_file.hpp"

#include <assimp/scene.h>

#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <stdexcept>
#include <string>

#include "daemon/io/atomic_file.hpp"
#include "daemon/record/export/fbx_repair.hpp"

namespace booth::daemon {

void convert_glb_to_fbx(const std::filesystem::path& glb, const std::filesystem::path& fbx) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(glb.string(), 0);
  if (!scene) throw std::runtime_error(fbx.string() + ": cannot be made: " + importer.GetErrorString());
  Assimp::Exporter exporter;
  const aiExportDataBlob* blob = exporter.ExportToBlob(scene, "fbx");
  if (!blob) throw std::runtime_error(fbx.string() + ": cannot be made: " + exporter.GetErrorString());
  const auto repaired = repair_fbx({static_cast<const char*>(blob->data), blob->size});
  if (!repaired) throw std::runtime_error(fbx.string() + ": cannot be made: this version of assimp writes an FBX that is not understood");
  write_file_atomically(fbx, *repaired);
}

}  // namespace booth::daemon
