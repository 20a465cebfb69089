// libpng through its simple interface: encode into memory, then write the file whole.
#include "daemon/io/png_image.hpp"

#include <png.h>

#include <stdexcept>
#include <string>

#include "daemon/io/atomic_file.hpp"

namespace booth::daemon {

void write_png(const std::filesystem::path& path, const Picture& picture) {
  static_assert(sizeof(Colour) == 3, "pixels are handed to libpng as packed RGB");
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width());
  image.height = static_cast<png_uint_32>(picture.height());
  image.format = PNG_FORMAT_RGB;
  const auto encode = [&](void* memory, png_alloc_size_t& bytes) {
    if (png_image_write_to_memory(&image, memory, &bytes, 0, picture.pixels().data(), 0, nullptr) == 0)
      throw std::runtime_error("cannot encode " + path.string() + ": " + image.message);
  };
  png_alloc_size_t bytes = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string encoded(bytes, '\0');
  encode(encoded.data(), bytes);
  encoded.resize(bytes);
  write_file_atomically(path, encoded);
}

}  // namespace booth::daemon
