// What every hal::DepthCamera must do, whatever stands behind it.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <future>
#include <thread>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/synthetic/optics.hpp"
#include "tests/conformance/sources.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::tests {
namespace {

using drivers::Pace;
using hal::ReadStatus;
using namespace std::chrono_literals;

/// Time stands still, so nothing that is not due ever becomes due.
class FrozenClock final : public hal::Clock {
 public:
  hal::MonotonicTime now() const override { return hal::MonotonicTime(5s); }
  hal::UtcTime utc_now() const override { return hal::UtcTime(5s); }
  void sleep_until(hal::MonotonicTime) override { std::this_thread::sleep_for(1ms); }
};

class DepthCamera : public testing::TestWithParam<Kind> {
 protected:
  drivers::Source open(Pace pace, std::shared_ptr<hal::Clock> clock, std::uint64_t seed = 7) {
    return open_scene(scratch_, GetParam(), pace, std::move(clock), seed);
  }
  drivers::Source open_fast(std::uint64_t seed = 7) { return open(Pace::fast, std::make_shared<drivers::ManualClock>(), seed); }
  drivers::Source open_live() { return open(Pace::own, std::make_shared<drivers::SystemClock>()); }
  const ScratchFolder scratch_;
};

Eigen::Vector3d world_point(const hal::CameraDescription& c, int u, int v, std::uint16_t counts) {
  const Eigen::Vector2d ray = drivers::undistorted_ray(c.intrinsics, u, v);
  const Eigen::Vector3d p = counts * c.depth_scale * Eigen::Vector3d(ray.x(), ray.y(), 1);
  const Eigen::Matrix3d r = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(c.camera_to_world.rotation.data());
  return r * p + Eigen::Map<const Eigen::Vector3d>(c.camera_to_world.translation.data());
}

/// Pixels that are clearly nearer than the empty room, with no lone ones.
template <typename Use>
void for_each_person_pixel(const hal::DepthFrame& frame, const hal::DepthFrame& background, int width, int height, Use use) {
  const auto nearer = [&](int i) {
    return frame.depth[static_cast<std::size_t>(i)] > 0 && frame.depth[static_cast<std::size_t>(i)] + 300 < background.depth[static_cast<std::size_t>(i)];
  };
  for (int v = 1; v + 1 < height; ++v)
    for (int u = 1; u + 1 < width; ++u) {
      const int i = v * width + u;
      if (nearer(i) && nearer(i - 1) && nearer(i + 1) && nearer(i - width) && nearer(i + width)) use(u, v, frame.depth[static_cast<std::size_t>(i)]);
    }
}

TEST_P(DepthCamera, DescribesItself) {
  const auto source = open_fast();
  ASSERT_EQ(source.cameras.size(), 2u);
  for (const auto& camera : source.cameras) {
    const auto& d = camera->description();
    EXPECT_FALSE(d.name.empty());
    EXPECT_EQ(d.intrinsics.width, 512);
    EXPECT_EQ(d.intrinsics.height, 424);
    // A sensor keeps its lens in single precision.
    const double exact = GetParam() == Kind::kinect2 ? 1e-5 : 1e-9;
    EXPECT_NEAR(d.intrinsics.fx, 365.5, exact);
    EXPECT_NEAR(d.intrinsics.cy, 205.4, exact);
    EXPECT_NEAR(d.intrinsics.distortion[1], -0.27, GetParam() == Kind::kinect2 ? 1e-7 : 1e-12);
    EXPECT_EQ(d.depth_scale, 0.001);
    EXPECT_NEAR(d.nominal_rate, 30, 0.5);
    const Eigen::Matrix3d r = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(d.camera_to_world.rotation.data());
    EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_NEAR(r.determinant(), 1, 1e-9);
  }
  const auto expected = scene_settings(7).cameras;
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t k = 0; k < 9; ++k)
      EXPECT_NEAR(source.cameras[i]->description().camera_to_world.rotation[k], expected[i].camera_to_world.rotation[k], 1e-9);
}

TEST_P(DepthCamera, GivesEveryFrameInOrderAtTheNominalRate) {
  const auto source = open_fast();
  auto& camera = *source.cameras[0];
  camera.start();
  hal::DepthFrame frame;
  hal::MonotonicTime last{};
  int count = 0;
  ReadStatus status;
  while ((status = camera.read(frame, 1s)) == ReadStatus::frame) {
    EXPECT_EQ(hal::to_int(frame.camera), 0);
    EXPECT_EQ(frame.sequence, static_cast<std::uint64_t>(count));
    EXPECT_EQ(frame.depth.size(), 512u * 424u);
    EXPECT_GE(frame.received, frame.captured);
    if (count > 0) {
      EXPECT_NEAR(hal::seconds(frame.captured - last), 1.0 / 30, 0.002);
    }
    const auto seen = std::count_if(frame.depth.begin(), frame.depth.end(), [](auto d) { return d > 0; });
    EXPECT_GT(seen, 512 * 424 / 2);
    last = frame.captured;
    ++count;
  }
  EXPECT_EQ(status, ReadStatus::ended);
  EXPECT_EQ(camera.read(frame, 1s), ReadStatus::ended);
  EXPECT_EQ(count, kSceneFrames);
  const auto c = camera.counters();
  EXPECT_EQ(c.delivered, static_cast<std::uint64_t>(kSceneFrames));
  EXPECT_EQ(c.dropped + c.corrupt + c.restarts, 0u);
}

TEST_P(DepthCamera, KeepsItsOwnPace) {
  const auto source = open_live();
  auto& camera = *source.cameras[0];
  camera.start();
  hal::DepthFrame frame;
  ASSERT_EQ(camera.read(frame, 2s), ReadStatus::frame);
  const auto first = frame.captured;
  int timeouts = 0;
  ReadStatus status = ReadStatus::timeout;
  while (hal::seconds(frame.captured - first) < 0.3 && status != ReadStatus::ended) {
    status = camera.read(frame, 1ms);
    timeouts += status == ReadStatus::timeout;
    EXPECT_LE(frame.captured, drivers::SystemClock().now()) << "a frame was handed out before it was taken";
  }
  EXPECT_GT(timeouts, 5) << "between two frames there is nothing to read";
}

TEST_P(DepthCamera, CountsWhatALateReaderMisses) {
  const auto source = open_live();
  auto& camera = *source.cameras[0];
  camera.start();
  hal::DepthFrame frame;
  ASSERT_EQ(camera.read(frame, 2s), ReadStatus::frame);
  const auto first = frame.sequence;
  std::this_thread::sleep_for(800ms);  // 24 frames' time: an emulated sensor on a busy machine comes to fewer
  ASSERT_EQ(camera.read(frame, 2s), ReadStatus::frame);
  EXPECT_GE(frame.sequence, first + 5);
  const auto c = camera.counters();
  EXPECT_EQ(c.delivered, 2u);
  EXPECT_EQ(c.delivered + c.dropped, frame.sequence - first + 1);
}

TEST_P(DepthCamera, StopWakesABlockedRead) {
  const auto source = open(Pace::own, std::make_shared<FrozenClock>());
  auto& camera = *source.cameras[0];
  camera.start();
  auto reader = std::async(std::launch::async, [&] {
    hal::DepthFrame frame;
    ReadStatus status = ReadStatus::frame;
    while (status == ReadStatus::frame) status = camera.read(frame, 1h);
    return status;
  });
  EXPECT_EQ(reader.wait_for(50ms), std::future_status::timeout) << "read() should be waiting";
  camera.stop();
  ASSERT_EQ(reader.wait_for(2s), std::future_status::ready);
  EXPECT_EQ(reader.get(), ReadStatus::ended);
}

TEST_P(DepthCamera, FastCamerasStayTogetherAndStopWakesThemToo) {
  const auto source = open_fast();
  for (const auto& camera : source.cameras) camera->start();
  hal::DepthFrame frame;
  int ahead = 0;
  while (source.cameras[0]->read(frame, 1ms) == ReadStatus::frame) ++ahead;
  EXPECT_GE(ahead, 1);
  EXPECT_LE(ahead, 4) << "one camera ran away from the other";
  auto reader = std::async(std::launch::async, [&] {
    hal::DepthFrame mine;
    return source.cameras[0]->read(mine, 1h);
  });
  EXPECT_EQ(reader.wait_for(30ms), std::future_status::timeout);
  source.cameras[0]->stop();
  ASSERT_EQ(reader.wait_for(2s), std::future_status::ready);
  EXPECT_EQ(reader.get(), ReadStatus::ended);
}

TEST_P(DepthCamera, GoesOnAfterARestart) {
  const auto source = open_fast();
  auto& camera = *source.cameras[0];
  hal::DepthFrame frame;
  EXPECT_EQ(camera.read(frame, 1ms), ReadStatus::ended) << "before start()";
  camera.start();
  for (int i = 0; i < 3; ++i) ASSERT_EQ(camera.read(frame, 1s), ReadStatus::frame);
  const auto before = frame;
  camera.stop();
  camera.stop();
  EXPECT_EQ(camera.read(frame, 1s), ReadStatus::ended);
  camera.start();
  ASSERT_EQ(camera.read(frame, 1s), ReadStatus::frame);
  EXPECT_GT(frame.captured, before.captured);
  EXPECT_GT(frame.sequence, before.sequence);
  EXPECT_EQ(camera.counters().restarts, 1u);
  EXPECT_EQ(camera.last_error(), "");
}

TEST_P(DepthCamera, AllocatesNothingAfterTheFirstFrame) {
  if (!AllocationCount::supported()) GTEST_SKIP() << "skipped: the sanitizer brings its own malloc";
  const auto source = open_fast();
  auto& camera = *source.cameras[0];
  camera.start();
  hal::DepthFrame frame;
  ASSERT_EQ(camera.read(frame, 1s), ReadStatus::frame);
  // What reads files takes memory for itself; boothd's own code does not.
  const AllocationCount count({"libpng", "libz.", "libzstd", "libsqlite3", "libc.so"});
  for (int i = 0; i < 10; ++i) ASSERT_EQ(camera.read(frame, 1s), ReadStatus::frame);
  EXPECT_EQ(count.so_far(), 0u);
}

TEST_P(DepthCamera, TheSameSeedGivesTheSameBits) {
  const auto a = open_fast(), b = open_fast(), other = open_fast(8);
  hal::DepthFrame fa, fb, fo;
  for (const auto* s : {&a, &b, &other}) s->cameras[kFront]->start();
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(a.cameras[kFront]->read(fa, 1s), ReadStatus::frame);
    ASSERT_EQ(b.cameras[kFront]->read(fb, 1s), ReadStatus::frame);
    ASSERT_EQ(other.cameras[kFront]->read(fo, 1s), ReadStatus::frame);
    EXPECT_EQ(fa.captured, fb.captured);
    EXPECT_TRUE(fa.depth == fb.depth);
    EXPECT_FALSE(fa.depth == fo.depth);
  }
}

TEST_P(DepthCamera, ShowsTheRaisedLeftArmOnTheLeft) {
  const auto source = open_fast();
  auto& camera = *source.cameras[kFront];
  ASSERT_EQ(source.background.size(), 2u);
  const auto& background = source.background[kFront];
  ASSERT_EQ(hal::to_int(background.camera), kFront);
  camera.start();
  hal::DepthFrame frame;
  ASSERT_EQ(camera.read(frame, 1s), ReadStatus::frame);
  int top = 1000, top_u = 0, count = 0, high_left = 0, high_right = 0;
  double sum_u = 0;
  for_each_person_pixel(frame, background, 512, 424, [&](int u, int v, std::uint16_t counts) {
    sum_u += u;
    ++count;
    if (v < top) top = v, top_u = u;
    const Eigen::Vector3d p = world_point(camera.description(), u, v, counts);
    if (p.z() > 1.75) ++(p.y() > 0.1 ? high_left : high_right);
  });
  ASSERT_GT(count, 1000);
  EXPECT_GT(top_u, sum_u / count + 10) << "he faces the camera, so his left hand is on the right of an image that is not mirrored";
  EXPECT_GT(high_left, 50) << "above the head there is only the hand, at +y";
  EXPECT_LT(high_right, 5);
}

TEST_P(DepthCamera, AgreesWithTheTruth) {
  const auto source = open_fast();
  ASSERT_NE(source.truth, nullptr);
  EXPECT_EQ(source.truth->body_name(), "capsule");
  EXPECT_EQ(source.truth->sex(), "men");
  source.cameras[kCorner]->start();
  hal::DepthFrame frame;
  for (int i = 0; i < 3; ++i) ASSERT_EQ(source.cameras[kCorner]->read(frame, 1s), ReadStatus::frame);
  const auto truth = source.truth->at(frame.captured);
  ASSERT_TRUE(truth.has_value());
  EXPECT_GT(truth->joints[15][1], 0.1);  // left wrist: to the left ...
  EXPECT_GT(truth->joints[15][2], 1.7);  // ... and up
  EXPECT_LT(truth->joints[19][2], 1.0);  // the right one hangs
  EXPECT_FALSE(source.truth->at(frame.captured + 10min).has_value());

  const auto surface = source.truth->surface(frame.captured);
  ASSERT_EQ(surface.size(), static_cast<std::size_t>(scene_person().rest.cols()));
  EXPECT_EQ(source.truth->faces().size(), static_cast<std::size_t>(scene_person().model->data().faces.cols()));
  // Every seen point lies on the true surface, noise and the size of the capsule man's triangles aside.
  double sum = 0;
  int count = 0;
  for_each_person_pixel(frame, source.background[kCorner], 512, 424, [&](int u, int v, std::uint16_t counts) {
    const Eigen::Vector3f p = world_point(source.cameras[kCorner]->description(), u, v, counts).cast<float>();
    float nearest = 1e9f;
    for (const auto& s : surface) nearest = std::min(nearest, (Eigen::Vector3f(s.data()) - p).norm());
    sum += nearest;
    ++count;
  });
  ASSERT_GT(count, 1000);
  EXPECT_LT(sum / count, 0.035);
}

#ifdef BOOTHD_EMULATOR
constexpr std::array kKinds{Kind::synthetic, Kind::folder, Kind::rosbag2, Kind::kinect2};
#else
constexpr std::array kKinds{Kind::synthetic, Kind::folder, Kind::rosbag2};
#endif
INSTANTIATE_TEST_SUITE_P(Sources, DepthCamera, testing::ValuesIn(kKinds), [](const auto& kind) { return std::string(name_of(kind.param)); });

/// A recording loses nothing of what it recorded.
class Recording : public testing::TestWithParam<Kind> {};

TEST_P(Recording, KeepsEveryCountAndInstant) {
  const ScratchFolder scratch;
  const auto live = open_scene(scratch, Kind::synthetic, Pace::fast, std::make_shared<drivers::ManualClock>());
  const auto recorded = open_scene(scratch, GetParam(), Pace::fast, std::make_shared<drivers::ManualClock>());
  hal::DepthFrame a, b;
  for (std::size_t i = 0; i < 2; ++i) {
    live.cameras[i]->start();
    recorded.cameras[i]->start();
    EXPECT_TRUE(live.background[i].depth == recorded.background[i].depth);
    hal::Nanoseconds shift{};
    for (int k = 0; k < 3; ++k) {
      ASSERT_EQ(live.cameras[i]->read(a, 1s), ReadStatus::frame);
      ASSERT_EQ(recorded.cameras[i]->read(b, 1s), ReadStatus::frame);
      EXPECT_TRUE(a.depth == b.depth);
      if (k == 0) shift = a.captured - b.captured;
      EXPECT_EQ(a.captured - b.captured, shift);
    }
    live.cameras[i]->stop();
    recorded.cameras[i]->stop();
  }
}

INSTANTIATE_TEST_SUITE_P(Layouts, Recording, testing::Values(Kind::folder, Kind::rosbag2), [](const auto& kind) { return std::string(name_of(kind.param)); });

}  // namespace
}  // namespace booth::tests
