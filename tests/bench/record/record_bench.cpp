// Task `record`: depth images packed and unpacked on one core, how small they get, what sealing them costs, and what handing one to the recorder costs a
// camera's thread.
#include <unistd.h>
#include <zstd.h>

#include <CLI/CLI.hpp>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <thread>

#include "daemon/io/atomic_file.hpp"
#include "daemon/seal/seal.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/recording/flight_recorder.hpp"
#include "drivers/recording/rvl.hpp"
#include "tests/bench/harness/harness.hpp"
#include "tests/support/frame_memory.hpp"

namespace booth::bench {
namespace {

using Images = std::vector<std::vector<std::uint16_t>>;

Images images(bool short_form) {
  tests::SceneRequest request;
  request.seconds = short_form ? 0.2 : 1;
  const tests::FrameMemory memory = tests::render_frames(request);
  Images out;
  for (const auto& camera : memory.frames)
    for (const auto& f : camera) out.push_back(f.depth);
  return out;
}

/// Packed images through the seal, in memory and into files, beside the same bytes copied and written plain.
void measure_sealing(const std::vector<std::string>& pieces, int repeats, Report& report) {
  const daemon::PrivateKey key = daemon::make_private_key();
  const auto seal = daemon::Seal::fresh(key.public_half);
  std::size_t total = 0;
  for (const auto& p : pieces) total += p.size();
  std::string sealed, copy;
  sealed.reserve(2 * daemon::kSealChunk);
  copy.resize(daemon::kSealChunk);
  const std::filesystem::path place = std::filesystem::temp_directory_path() / ("booth-bench-" + std::to_string(::getpid()));
  std::filesystem::create_directories(place);
  const auto write = [&](const daemon::Seal* with) {
    daemon::AtomicFile file({place / "images", with}, 0600);
    for (const auto& p : pieces) file.write(p);
    file.flush();  // not synchronised: the processor's work is asked for, not the disk's
  };
  const auto seconds = median_thread_seconds_in_turns(repeats, {[&] {
                                                                  daemon::SealEncoder encoder(*seal, "images");
                                                                  for (const auto& p : pieces)
                                                                    for (std::size_t at = 0; at < p.size(); at += daemon::kSealChunk) {
                                                                      sealed.clear();
                                                                      encoder.append(std::string_view(p).substr(at, daemon::kSealChunk), false, sealed);
                                                                    }
                                                                },
                                                                [&] {
                                                                  for (const auto& p : pieces)
                                                                    for (std::size_t at = 0; at < p.size(); at += daemon::kSealChunk)
                                                                      std::memcpy(copy.data(), p.data() + at, std::min(daemon::kSealChunk, p.size() - at));
                                                                },
                                                                [&] { write(seal.get()); }, [&] { write(nullptr); }});
  std::filesystem::remove_all(place);
  const double megabytes = 1e-6 * static_cast<double>(total);
  report.add({"sealed in memory, one core", "MB/s", megabytes / seconds[0], "plain copy", megabytes / seconds[1]});
  report.add({"sealed into a file, processor's time", "MB/s", megabytes / seconds[2], "written plain", megabytes / seconds[3]});
}

void run(const Common& common, Report& report) {
  const Images all = images(common.short_form);
  const int repeats = common.short_form ? 3 : 15;
  const std::size_t pixels = all.front().size();
  std::vector<std::vector<std::byte>> packed(all.size(), std::vector<std::byte>(drivers::rvl_bound(pixels)));
  std::vector<std::uint16_t> copy(pixels), unpacked(pixels);
  std::vector<char> squeezed(ZSTD_compressBound(2 * pixels));
  std::size_t rvl_bytes = 0, zstd_bytes = 0;
  const auto pack_all = [&] {
    rvl_bytes = 0;
    for (std::size_t i = 0; i < all.size(); ++i) rvl_bytes += drivers::rvl_pack(all[i], packed[i].data());
  };
  std::vector<std::size_t> sizes;
  pack_all();
  for (std::size_t i = 0; i < all.size(); ++i) sizes.push_back(drivers::rvl_pack(all[i], packed[i].data()));
  const auto seconds = median_thread_seconds_in_turns(repeats, {pack_all,
                                                                [&] {
                                                                  for (std::size_t i = 0; i < all.size(); ++i)
                                                                    if (!drivers::rvl_unpack({packed[i].data(), sizes[i]}, unpacked))
                                                                      throw std::runtime_error("a packed image was not understood");
                                                                },
                                                                [&] {
                                                                  for (const auto& image : all) std::memcpy(copy.data(), image.data(), 2 * pixels);
                                                                },
                                                                [&] {
                                                                  zstd_bytes = 0;
                                                                  for (const auto& image : all)
                                                                    zstd_bytes += ZSTD_compress(squeezed.data(), squeezed.size(), image.data(), 2 * pixels, 1);
                                                                }});
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    (void)drivers::rvl_unpack({packed[i].data(), sizes[i]}, unpacked);
    wrong += unpacked != all[i];
  }
  const auto n = static_cast<double>(all.size());
  const std::string plain = "plain copy of the image";
  report.add({"pack, one core", "frames/s", n / seconds[0], plain, n / seconds[2]});
  report.add({"unpack, one core", "frames/s", n / seconds[1], plain, n / seconds[2]});
  report.add({"pack, one core, against zstd -1", "frames/s", n / seconds[0], "zstd -1", n / seconds[3]});
  report.add({"size", "bytes/frame", static_cast<double>(rvl_bytes) / n, "not packed", 2.0 * static_cast<double>(pixels)});
  report.add({"size against zstd -1", "bytes/frame", static_cast<double>(rvl_bytes) / n, "zstd -1", static_cast<double>(zstd_bytes) / n});
  report.add({"images that came back different", "", static_cast<double>(wrong)});

  std::vector<std::string> pieces;
  for (std::size_t i = 0; i < all.size(); ++i) pieces.emplace_back(reinterpret_cast<const char*>(packed[i].data()), sizes[i]);
  measure_sealing(pieces, repeats, report);

  drivers::SystemClock clock;
  hal::CameraDescription camera;
  camera.intrinsics = {.width = 512, .height = static_cast<int>(pixels / 512), .fx = 365, .fy = 365, .cx = 256, .cy = 212, .distortion = {}};
  const auto recorder = drivers::make_flight_recorder({.directory = "/nonexistent", .depth = true, .memory_bytes = 64u << 20}, {camera}, {}, clock);
  hal::DepthFrame frame;
  frame.depth = all.front();
  const auto handing =
      median_thread_seconds_in_turns(repeats, {[&] {
                                       frame.captured = clock.now();
                                       recorder->frame(frame);
                                       std::this_thread::sleep_for(std::chrono::milliseconds(15));  // no processor time; the slot is free again
                                     }});
  report.add({"handed to the recorder, camera's thread", "ms", 1e3 * handing[0], plain, 1e3 * seconds[2] / n});
}

const Registration registration({"record", "Depth images packed for recordings: frames per second on one core, size, and what it costs a camera's thread",
                                 [](CLI::App&) { return Run(run); }});

}  // namespace
}  // namespace booth::bench
