#include "base/object_pool.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace fiducap {
namespace {

TEST(ObjectPool, GivesTheSameObjectAgainWithItsMemory) {
  ObjectPool<std::vector<int>> pool;
  const std::vector<int>* first = nullptr;
  {
    auto object = pool.acquire();
    object->resize(1000);
    first = object.get();
  }
  const auto again = pool.acquire();
  EXPECT_EQ(again.get(), first);
  EXPECT_GE(again->capacity(), 1000u);
}

TEST(ObjectPool, GivesTwoObjectsToTwoReaders) {
  ObjectPool<int> pool;
  const auto a = pool.acquire();
  const auto b = pool.acquire();
  EXPECT_NE(a.get(), b.get());
}

TEST(ObjectPool, MayDieBeforeItsObjects) {
  std::shared_ptr<std::vector<int>> survivor;
  {
    ObjectPool<std::vector<int>> pool;
    survivor = pool.acquire();
  }
  survivor->push_back(1);
  EXPECT_EQ(survivor->size(), 1u);
}

TEST(ObjectPool, ServesSeveralThreads) {
  ObjectPool<std::vector<int>> pool;
  std::vector<std::jthread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&pool] {
      for (int i = 0; i < 1000; ++i) pool.acquire()->assign(8, i);
    });
  }
}

}  // namespace
}  // namespace fiducap
