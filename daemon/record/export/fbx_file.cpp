// assimp writes to a name of its own beside the final one; the rename makes the file appear whole.
#include "daemon/record/export/fbx_file.hpp"

#include <assimp/scene.h>

#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <stdexcept>
#include <string>

namespace booth::daemon {

void convert_glb_to_fbx(const std::filesystem::path& glb, const std::filesystem::path& fbx) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(glb.string(), 0);
  if (!scene) throw std::runtime_error(fbx.string() + ": cannot be made: " + importer.GetErrorString());
  std::filesystem::path part = fbx;
  part += ".part";
  Assimp::Exporter exporter;
  const aiReturn done = exporter.Export(scene, "fbx", part.string());
  std::error_code error;
  if (done == aiReturn_SUCCESS) std::filesystem::rename(part, fbx, error);
  if (done == aiReturn_SUCCESS && !error) return;
  std::error_code ignored;
  std::filesystem::remove(part, ignored);
  throw std::runtime_error(fbx.string() + ": cannot be written: " + (error ? error.message() : std::string(exporter.GetErrorString())) +
                           "; check the folder and the disk's space");
}

}  // namespace booth::daemon
