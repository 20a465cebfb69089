// The counter counts: operator new and malloc, by kind of thread, with the place, and what an excused library takes apart.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>

#include <cstdlib>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include "tests/support/allocation_count.hpp"

namespace booth::tests {
namespace {

void allocate_on_thread(const char* name) {
  std::thread([name] {
    ::pthread_setname_np(::pthread_self(), name);
    std::vector<int> one(1000);
    void* volatile two = std::malloc(100);
    std::free(two);
    one[0] = two != nullptr;
  }).join();
}

struct Counted : ::testing::Test {
  void SetUp() override {
    if (!AllocationCount::supported()) GTEST_SKIP() << "skipped: the sanitizer brings its own malloc";
  }
};

/// Neither may the compiler know what comes, nor leave it out.
void* kept(void* p) {
  static void* volatile last;
  last = p;
  return last;
}

TEST_F(Counted, EveryWayToTheHeap) {
  const AllocationCount count;
  std::free(kept(std::realloc(kept(std::malloc(10)), 100000)));
  std::free(kept(std::calloc(3, 5)));
  std::free(kept(std::aligned_alloc(64, 128)));
  delete static_cast<int*>(kept(new int(3)));
  EXPECT_EQ(count.so_far(), 5u);
}

TEST_F(Counted, FrameThreadsByTheirNames) {
  const AllocationCount count;
  allocate_on_thread("other");
  EXPECT_EQ(count.on_frame_threads(), 0u);
  EXPECT_EQ(count.first_places(), "");
  allocate_on_thread("frame-test");
  EXPECT_EQ(count.on_frame_threads(), 2u);
  EXPECT_EQ(count.on_camera_threads(), 0u);
  allocate_on_thread("frame-cam-3");
  EXPECT_EQ(count.on_camera_threads(), 2u);
  EXPECT_THAT(count.first_places(), ::testing::HasSubstr("frame-test:\n"));
  EXPECT_GE(count.so_far(), 6u);
}

TEST_F(Counted, AnExcusedLibraryApart) {
  const AllocationCount count({"libc.so"});
  std::free(::strdup("by the C library"));
  EXPECT_EQ(count.so_far(), 0u);
  std::free(kept(std::malloc(10)));
  EXPECT_EQ(count.so_far(), 1u);
}

}  // namespace
}  // namespace booth::tests
