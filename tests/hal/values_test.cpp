// The plain values that cross the HAL: conversions, defaults, and mistakes that must not compile.
#include <gtest/gtest.h>

#include <type_traits>

#include "hal/depth_camera.hpp"
#include "hal/ground_truth.hpp"
#include "hal/status_light.hpp"
#include "hal/trigger.hpp"

namespace booth::hal {
namespace {

// Monotonic and wall time never mix, and a camera's number is no plain integer.
template <typename A, typename B>
concept Subtractable = requires(A a, B b) {
  a - b;
};
static_assert(Subtractable<MonotonicTime, MonotonicTime>);
static_assert(!Subtractable<MonotonicTime, UtcTime>);
static_assert(!std::is_convertible_v<UtcTime, MonotonicTime>);
static_assert(!std::is_convertible_v<int, CameraIndex>);
static_assert(std::is_abstract_v<DepthCamera>);
static_assert(std::has_virtual_destructor_v<DepthCamera> && std::has_virtual_destructor_v<GroundTruth> && std::has_virtual_destructor_v<Trigger> &&
              std::has_virtual_destructor_v<StatusLight>);

TEST(Time, SecondsAndNanosecondsAgree) {
  EXPECT_EQ(from_seconds(1.5), Nanoseconds(1'500'000'000));
  EXPECT_EQ(from_seconds(-0.25), Nanoseconds(-250'000'000));
  EXPECT_DOUBLE_EQ(seconds(Nanoseconds(33'333'333)), 0.033333333);
  // A year in nanoseconds still keeps microseconds.
  const double year = 365.25 * 86400;
  EXPECT_NEAR(seconds(from_seconds(year + 1e-6)) - year, 1e-6, 5e-7);
}

TEST(CameraDescription, StandsAtTheOriginUntilItIsPlaced) {
  const CameraDescription c;
  EXPECT_EQ(c.camera_to_world.rotation, (std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
  EXPECT_EQ(c.camera_to_world.translation, (std::array<double, 3>{}));
  EXPECT_EQ(c.depth_scale, 0.001) << "millimetres, as depth cameras deliver";
}

TEST(CameraIndex, ConvertsOnlyWhenAsked) { EXPECT_EQ(to_int(CameraIndex{3}), 3); }

}  // namespace
}  // namespace booth::hal
