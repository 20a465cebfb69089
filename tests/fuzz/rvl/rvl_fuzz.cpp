// Packed depth images of any bytes: refused or an image, and what was packed by us comes back.
#include <vector>

#include "drivers/recording/rvl.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace booth::drivers;
  booth::fuzz::Input input(data, size);
  std::vector<std::uint16_t> depth(input.u16() % 4096);
  (void)rvl_unpack(std::as_bytes(std::span(data, size)), depth);
  for (auto& d : depth) d = input.u16();
  std::vector<std::byte> packed(rvl_bound(depth.size()));
  const std::size_t length = rvl_pack(depth, packed.data());
  booth::fuzz::require(length <= packed.size(), "the bound holds");
  std::vector<std::uint16_t> again(depth.size(), 1);
  booth::fuzz::require(rvl_unpack({packed.data(), length}, again) && again == depth, "what was packed comes back");
  return 0;
}
