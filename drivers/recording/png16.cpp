// libpng reports errors with longjmp: everything that a jump could skip is trivial or lives outside the function that sets it.
#include "drivers/recording/png16.hpp"

#include <png.h>

#include <bit>
#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace booth::drivers {
namespace {

struct CloseFile {
  void operator()(std::FILE* f) const { std::fclose(f); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

[[noreturn]] void on_error(png_structp png, png_const_charp) { std::longjmp(*static_cast<std::jmp_buf*>(png_get_error_ptr(png)), 1); }
void on_warning(png_structp, png_const_charp) {}

/// The whole picture into `rows`; false when it is not a width x height 16-bit grey PNG.
bool decode(std::FILE* file, png_structp png, png_infop info, std::jmp_buf& failed, png_uint_32 width, png_uint_32 height, unsigned char** rows) {
  if (setjmp(failed) != 0) return false;
  png_set_user_limits(png, width, height);
  png_set_chunk_cache_max(png, 16);
  png_set_chunk_malloc_max(png, 1 << 20);
  png_init_io(png, file);
  png_read_info(png, info);
  if (png_get_image_width(png, info) != width || png_get_image_height(png, info) != height || png_get_bit_depth(png, info) != 16 ||
      png_get_color_type(png, info) != PNG_COLOR_TYPE_GRAY)
    return false;
  if constexpr (std::endian::native == std::endian::little) png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  png_read_image(png, rows);
  png_read_end(png, nullptr);
  return true;
}

bool encode(std::FILE* file, png_structp png, png_infop info, std::jmp_buf& failed, png_uint_32 width, png_uint_32 height, unsigned char** rows) {
  if (setjmp(failed) != 0) return false;
  png_init_io(png, file);
  png_set_IHDR(png, info, width, height, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(png, 1);  // noise does not compress; more effort only costs time
  png_set_filter(png, 0, PNG_FILTER_SUB);
  png_write_info(png, info);
  if constexpr (std::endian::native == std::endian::little) png_set_swap(png);
  png_write_image(png, rows);
  png_write_end(png, nullptr);
  return true;
}

}  // namespace

PngReader::PngReader(int width, int height) : width_(width), height_(height), rows_(static_cast<std::size_t>(height)) {}

Load PngReader::read(const char* path, std::vector<std::uint16_t>& depth) noexcept {
  const File file(std::fopen(path, "rbe"));
  if (!file) return errno == ENOENT ? Load::missing : Load::broken;
  for (std::size_t y = 0; y < rows_.size(); ++y) rows_[y] = reinterpret_cast<unsigned char*>(depth.data() + y * static_cast<std::size_t>(width_));
  std::jmp_buf failed;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &failed, on_error, on_warning);
  if (png == nullptr) return Load::broken;
  png_infop info = png_create_info_struct(png);
  const bool ok = info != nullptr && decode(file.get(), png, info, failed, static_cast<png_uint_32>(width_), static_cast<png_uint_32>(height_), rows_.data());
  png_destroy_read_struct(&png, &info, nullptr);
  return ok ? Load::ok : Load::broken;
}

void write_png16(const std::filesystem::path& path, int width, int height, const std::uint16_t* depth) {
  const auto fail = [&](const char* why) {
    throw std::runtime_error("cannot write " + path.string() + ": " + why + "; check the disk's space and permissions");
  };
  File file(std::fopen(path.c_str(), "wbe"));
  if (!file) fail(std::strerror(errno));
  std::vector<unsigned char*> rows(static_cast<std::size_t>(height));
  for (std::size_t y = 0; y < rows.size(); ++y)
    rows[y] = const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(depth + y * static_cast<std::size_t>(width)));  // libpng only reads them
  std::jmp_buf failed;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &failed, on_error, on_warning);
  if (png == nullptr) fail("libpng has no memory");
  png_infop info = png_create_info_struct(png);
  const bool ok = info != nullptr && encode(file.get(), png, info, failed, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), rows.data());
  png_destroy_write_struct(&png, &info);
  if (!ok) fail(errno != 0 ? std::strerror(errno) : "libpng refused it");
  if (std::fclose(file.release()) != 0) fail(std::strerror(errno));
}

}  // namespace booth::drivers
