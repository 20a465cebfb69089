// What a sensor says of itself, the file it is kept in, and the clock it counts by.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/calibration.hpp"
#include "drivers/kinect2/calibration_cache.hpp"
#include "drivers/kinect2/device_time.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::byte>;

Bytes depth_page() {
  Bytes page(kDepthCameraBytes);
  const std::array<float, 10> values{365.4028f, 365.4028f, 0, 260.9255f, 205.5946f, 0.095575f, -0.277055f, 0, 0, 0.097539f};
  for (std::size_t i = 0; i < values.size(); ++i) write_f32(page, 4 * i, values[i]);
  return page;
}

Bytes colour_page() {
  Bytes page(kColourCameraBytes);
  page[0] = std::byte{1};
  const std::array<float, 5> values{1081.37f, 959.5f, 539.5f, 863, 52};
  for (std::size_t i = 0; i < values.size(); ++i) write_f32(page, 1 + 4 * i, values[i]);
  return page;
}

Bytes utf16(const std::string& text, std::size_t bytes) {
  Bytes page(bytes);
  for (std::size_t i = 0; i < text.size(); ++i) write_u16(page, 2 * i, static_cast<std::uint8_t>(text[i]));
  return page;
}

TEST(CalibrationPages, ALensIsReadFromItsPlaces) {
  const auto p = parse_depth_camera(depth_page());
  EXPECT_NEAR(p.fx, 365.4028, 1e-4);
  EXPECT_NEAR(p.cx, 260.9255, 1e-4);
  EXPECT_NEAR(p.cy, 205.5946, 1e-4);
  EXPECT_NEAR(p.k2, -0.277055, 1e-7);
  EXPECT_NEAR(p.k3, 0.097539, 1e-7);
}

TEST(CalibrationPages, NoNumberThatCannotBeIsTaken) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
  for (std::size_t word = 0; word < 23; ++word)
    for (const float bad : {nan, infinite, -infinite}) {
      Bytes page = depth_page();
      write_f32(page, 4 * word, bad);
      EXPECT_THROW((void)parse_depth_camera(page), std::runtime_error) << "word " << word << " is " << bad;
    }
  for (const std::size_t word : {0, 1, 3, 4})
    for (const float bad : {0.0f, -365.0f, 1e30f}) {
      Bytes page = depth_page();
      write_f32(page, 4 * word, bad);
      EXPECT_THROW((void)parse_depth_camera(page), std::runtime_error) << "word " << word << " is " << bad;
    }
  EXPECT_THROW((void)parse_depth_camera(std::span<const std::byte>(depth_page()).first(91)), std::runtime_error);
  for (std::size_t i = 0; i < 25; ++i) {
    Bytes page = colour_page();
    write_f32(page, 1 + 4 * i, nan);
    EXPECT_THROW((void)parse_colour_camera(page), std::runtime_error);
  }
  EXPECT_NO_THROW((void)parse_colour_camera(colour_page()));
  EXPECT_THROW((void)parse_colour_camera(std::span<const std::byte>(colour_page()).first(kColourCameraBytes - 1)), std::runtime_error);
}

TEST(CalibrationPages, PhaseTablesLieBetweenTheirFrequencies) {
  Bytes page(kPhaseTablesBytes);
  write_u16(page, 32 + 2, 11);
  write_u16(page, 434'212 + 2, 22);
  write_u16(page, 868'392 + 2 + 2 * (kPixels - 1), 33);
  const auto tables = parse_phase_offsets(page);
  EXPECT_EQ(tables.p0[0].front(), 11);
  EXPECT_EQ(tables.p0[1].front(), 22);
  EXPECT_EQ(tables.p0[2].back(), 33);
  EXPECT_THROW((void)parse_phase_offsets(std::span<const std::byte>(page).first(kPhaseTablesBytes - 1)), std::runtime_error);
}

TEST(CalibrationPages, AnUnusualHeaderIsSaidAndNothingElse) {
  Bytes page(kPhaseTablesBytes);
  const std::array<std::uint32_t, 8> header{32, 3, 2, 434'176, 2, 12, 286, 8};
  for (std::size_t i = 0; i < header.size(); ++i) write_u32(page, 4 * i, header[i]);
  EXPECT_EQ(unusual_phase_header(page), "");
  write_u32(page, 4, 4);
  EXPECT_NE(unusual_phase_header(page).find("32 4 2 434176"), std::string::npos);
  EXPECT_NE(unusual_phase_header({}), "");
}

TEST(Serial, EndsAtAZeroOrAtTheEndAndHasOnlyLettersAndDigits) {
  EXPECT_EQ(parse_serial(utf16("018436651247", 128)), "018436651247");
  EXPECT_EQ(parse_serial(utf16("018436651247", 24)), "018436651247") << "no terminator";
  EXPECT_THROW((void)parse_serial(utf16("0184\n6651247", 128)), std::runtime_error);
  EXPECT_THROW((void)parse_serial(utf16("../../etc", 128)), std::runtime_error);
  EXPECT_THROW((void)parse_serial(utf16("", 128)), std::runtime_error);
  EXPECT_THROW((void)parse_serial({}), std::runtime_error);
  EXPECT_EQ(parse_serial(utf16(std::string(64, '7'), 129)).size(), 64u) << "an odd byte at the end is nobody's";
}

TEST(Firmware, IsTheFourthRecord) {
  Bytes reply(512);
  write_u32(reply, 48, 0x0002'0003);
  write_u32(reply, 52, 3912);
  EXPECT_EQ(parse_firmware(reply), "2.3.3912.0");
  EXPECT_THROW((void)parse_firmware(std::span<const std::byte>(reply).first(63)), std::runtime_error);
}

TEST(Board, IsPrintableOrNothing) {
  Bytes reply(92);
  const std::string code = "GMF631.1X";
  for (std::size_t i = 0; i < code.size(); ++i) reply[0x48 + i] = static_cast<std::byte>(code[i]);
  EXPECT_EQ(parse_board(reply), code);
  reply[0x48] = std::byte{0x1B};
  EXPECT_EQ(parse_board(reply), "");
  EXPECT_EQ(parse_board(std::span<const std::byte>(reply).first(10)), "");
}

TEST(Intrinsics, AreThoseOfThePictureTurnedRound) {
  const auto k = unmirrored_intrinsics(parse_depth_camera(depth_page()));
  EXPECT_NEAR(k.cx, 511.5 - 260.9255, 1e-4);
  EXPECT_NEAR(k.cy, 205.5946 - 0.5, 1e-4);
}

class CacheTest : public testing::Test {
 protected:
  CacheTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "booth-cache-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no scratch folder");
    folder_ = pattern;
  }
  ~CacheTest() override { std::filesystem::remove_all(folder_); }
  static Calibration calibration() {
    Calibration c;
    c.serial = "018436651247";
    c.firmware = "2.3.3912.0";
    c.depth = parse_depth_camera(depth_page());
    c.colour = parse_colour_camera(colour_page());
    for (std::size_t f = 0; f < 3; ++f) {
      c.phase.p0[f].resize(kPixels);
      for (std::size_t i = 0; i < kPixels; ++i) c.phase.p0[f][i] = static_cast<std::uint16_t>(i * (f + 1));
    }
    return c;
  }
  std::filesystem::path file() const { return folder_ / "018436651247-2.3.3912.0.calibration"; }
  void overwrite(std::streamoff at, char value) const {
    std::fstream f(file(), std::ios::in | std::ios::out | std::ios::binary);
    f.seekp(at);
    f.put(value);
  }
  std::filesystem::path folder_;
};

TEST_F(CacheTest, GivesBackWhatItWasGiven) {
  const CalibrationCache cache(folder_ / "not/there/yet");
  EXPECT_FALSE(cache.load("018436651247", "2.3.3912.0"));
  ASSERT_TRUE(cache.store(calibration()));
  const auto back = cache.load("018436651247", "2.3.3912.0");
  ASSERT_TRUE(back);
  EXPECT_EQ(back->depth.fx, calibration().depth.fx);
  EXPECT_EQ(back->colour.b, 52);
  EXPECT_EQ(back->phase.p0[2], calibration().phase.p0[2]);
  EXPECT_FALSE(cache.load("018436651247", "2.3.3913.0")) << "another firmware is asked again";
  EXPECT_TRUE(cache.load_latest("018436651247"));
  EXPECT_FALSE(cache.load_latest("01843665124")) << "the beginning of a serial is not the serial";
}

TEST_F(CacheTest, NamesThatLeaveTheFolderAreNoNames) {
  const CalibrationCache cache(folder_);
  Calibration c = calibration();
  for (const std::string& bad : std::initializer_list<std::string>{"../x", "", "a/b", std::string(64, 'a')}) {
    c.serial = bad;
    EXPECT_FALSE(cache.store(c));
    EXPECT_FALSE(cache.load(bad, c.firmware));
    EXPECT_FALSE(cache.load_latest(bad));
  }
}

TEST_F(CacheTest, ADamagedFileIsNoFile) {
  const CalibrationCache cache(folder_);
  ASSERT_TRUE(cache.store(calibration()));
  const auto size = std::filesystem::file_size(file());
  for (const std::streamoff at : {0L, 6L, 9L, 80L, 140L, 1000L, static_cast<long>(size) - 1}) {
    ASSERT_TRUE(cache.store(calibration()));
    overwrite(at, '\x5A');
    EXPECT_FALSE(cache.load("018436651247", "2.3.3912.0")) << "byte " << at;
  }
  ASSERT_TRUE(cache.store(calibration()));
  std::filesystem::resize_file(file(), size - 1);
  EXPECT_FALSE(cache.load("018436651247", "2.3.3912.0"));
  std::filesystem::resize_file(file(), size + 1);
  EXPECT_FALSE(cache.load("018436651247", "2.3.3912.0"));
  std::filesystem::resize_file(file(), 0);
  EXPECT_FALSE(cache.load_latest("018436651247"));
}

TEST_F(CacheTest, NumbersThatCannotBeAreNotTakenEvenWithAGoodChecksum) {
  const CalibrationCache cache(folder_);
  Calibration c = calibration();
  c.depth.fx = std::numeric_limits<double>::quiet_NaN();
  ASSERT_TRUE(cache.store(c));
  EXPECT_FALSE(cache.load("018436651247", "2.3.3912.0"));
}

TEST_F(CacheTest, TheFileIsTheSameOnEveryMachine) {
  const CalibrationCache cache(folder_);
  ASSERT_TRUE(cache.store(calibration()));
  std::ifstream in(file(), std::ios::binary);
  Bytes bytes(std::filesystem::file_size(file()));
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  EXPECT_EQ(std::bit_cast<double>(read_u64(bytes, 8 + 128)), calibration().depth.fx) << "little-endian, after magic and two names";
}

/// A device whose crystal is `ppm` too fast, seen through a bus that delays by 2 ms and sometimes by much more.
struct Device {
  double ppm = 0;
  std::uint32_t first_ticks = 0;
  hal::MonotonicTime exposed(int frame) const { return hal::MonotonicTime(100s) + hal::from_seconds(frame / 30.0); }
  std::uint32_t ticks(int frame) const { return first_ticks + static_cast<std::uint32_t>(std::llround(frame / 30.0 * (1 + ppm * 1e-6) * kTicksPerSecond)); }
  hal::MonotonicTime arrived(int frame) const {
    return exposed(frame) + 30ms + (frame % 7 == 0 ? 0us : std::chrono::microseconds(1000 + 7919 * (frame % 13) % 9000));
  }
};

TEST(DeviceTime, FollowsADriftingCrystal) {
  for (const double ppm : {-200.0, 0.0, 150.0}) {
    const Device device{.ppm = ppm};
    DeviceTime time(30ms);
    double worst = 0;
    for (int i = 0; i < 30 * 600; ++i) {
      const auto t = time.to_host(device.ticks(i), device.arrived(i));
      if (i > 300) worst = std::max(worst, std::abs(hal::seconds(t - device.exposed(i))));
    }
    EXPECT_LT(worst, 0.0015) << ppm;
    EXPECT_NEAR(time.drift_ppm(), -ppm, 40) << ppm;
    EXPECT_EQ(time.jumps(), 0);
  }
}

TEST(DeviceTime, DoesNotNoticeTheWrapOfItsCounter) {
  const Device device{.first_ticks = 0u - 8000};
  DeviceTime time(30ms);
  hal::MonotonicTime last{};
  for (int i = 0; i < 90; ++i) {
    const auto t = time.to_host(device.ticks(i), device.arrived(i));
    if (i > 7) {
      EXPECT_NEAR(hal::seconds(t - last), 1 / 30.0, 0.002);
    }
    last = t;
  }
  EXPECT_EQ(time.jumps(), 0);
}

TEST(DeviceTime, IsNeverAfterTheArrivalAndNeverGoesBack) {
  DeviceTime time(0ms);
  hal::MonotonicTime last{};
  std::uint32_t random = 1;
  for (int i = 0; i < 5000; ++i) {
    random = random * 1664525u + 1013904223u;
    const auto arrived = hal::MonotonicTime(100s) + i * 10ms;
    const auto t = time.to_host(random, arrived);  // ticks of a device that lies
    EXPECT_LE(t, arrived);
    EXPECT_GT(t, last);
    last = t;
    if (i % 1000 == 999) time.reset();
  }
}

TEST(DeviceTime, BeginsAnewAfterAJump) {
  for (const double jump : {3600.0, -3600.0, 0.3, -0.3}) {
    Device device;
    DeviceTime time(30ms);
    for (int i = 0; i < 300; ++i) (void)time.to_host(device.ticks(i), device.arrived(i));
    device.first_ticks = static_cast<std::uint32_t>(std::llround(jump * kTicksPerSecond));
    hal::MonotonicTime t;
    for (int i = 300; i < 340; ++i) t = time.to_host(device.ticks(i), device.arrived(i));
    EXPECT_LT(std::abs(hal::seconds(t - device.exposed(339))), 0.011) << "one second after a jump by " << jump << " s";
  }
}

}  // namespace
}  // namespace booth::drivers::kinect2
