// 16-bit grey PNG files, the usual container of depth images.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/recording/frame_store.hpp"

namespace booth::drivers {

/// Reads a picture of exactly width x height into `depth` (already of that size). Never throws; no operator new once `rows` has its size.
class PngReader {
 public:
  PngReader(int width, int height);
  Load read(const char* path, std::vector<std::uint16_t>& depth) noexcept;

 private:
  const int width_, height_;
  std::vector<unsigned char*> rows_;
};

/// Throws std::runtime_error naming the file and the system's reason.
void write_png16(const std::filesystem::path& path, int width, int height, const std::uint16_t* depth);

}  // namespace booth::drivers
