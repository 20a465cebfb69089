// The pool runs every task once, whatever the number of threads, and is quiet about memory.
#include "fit/parallel.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>

#include "tests/support/allocation_count.hpp"

namespace booth::fit {
namespace {

TEST(WorkerPool, RunsEachTaskExactlyOnce) {
  for (const int threads : {1, 2, 3, 8}) {
    WorkerPool pool(threads);
    EXPECT_EQ(pool.threads(), threads);
    for (const int tasks : {0, 1, 2, 7, 64, 1000}) {
      std::vector<int> count(static_cast<std::size_t>(tasks), 0);
      pool.run(tasks, [&](int task) { ++count[static_cast<std::size_t>(task)]; });
      for (const int c : count) ASSERT_EQ(c, 1) << threads << " threads, " << tasks << " tasks";
    }
  }
}

TEST(WorkerPool, ManyShortRunsInARowNeitherHangNorMixTheirTasks) {
  WorkerPool pool(4);
  std::vector<int> seen(16);
  for (int run = 1; run <= 20000; ++run) {
    const int tasks = 2 + run % 15;
    pool.run(tasks, [&, run](int task) { seen[static_cast<std::size_t>(task)] = run; });
    for (int task = 0; task < tasks; ++task) ASSERT_EQ(seen[static_cast<std::size_t>(task)], run);
  }
}

TEST(WorkerPool, SleepingWorkersWakeForTheNextRun) {
  WorkerPool pool(2);
  for (int run = 0; run < 5; ++run) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    // Two tasks that wait for each other end only when two threads run them.
    std::atomic<int> arrived{0};
    pool.run(2, [&](int) {
      arrived.fetch_add(1);
      while (arrived.load() < 2) std::this_thread::yield();
    });
    EXPECT_EQ(arrived.load(), 2);
  }
}

TEST(WorkerPool, RunAllocatesNothing) {
  WorkerPool pool(3);
  std::atomic<int> sum{0};
  const tests::AllocationCount guard;
  for (int i = 0; i < 100; ++i) pool.run(10, [&](int task) { sum.fetch_add(task); });
  EXPECT_EQ(guard.so_far(), 0u);
  EXPECT_EQ(sum.load(), 4500);
}

TEST(WorkerPool, RefusesSillyThreadCounts) {
  EXPECT_THROW(WorkerPool(0), std::invalid_argument);
  EXPECT_THROW(WorkerPool(-3), std::invalid_argument);
  EXPECT_THROW(WorkerPool(257), std::invalid_argument);
}

TEST(BlockRange, CoversAllItemsInOrder) {
  for (const int items : {0, 1, 5, 64, 1001}) {
    int next = 0;
    for (int block = 0; block < 7; ++block) {
      const Range r = block_range(items, 7, block);
      EXPECT_EQ(r.begin, next);
      EXPECT_LE(r.begin, r.end);
      next = r.end;
    }
    EXPECT_EQ(next, items);
  }
}

}  // namespace
}  // namespace booth::fit
