#include "base/handover.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace fiducap {
namespace {

using Numbers = std::vector<int>;

TEST(ObjectPool, ReusesReleasedObjectsWithTheirMemory) {
  ObjectPool<Numbers> pool;
  auto object = pool.acquire();
  object->resize(1000);
  const Numbers* first = object.get();
  const auto other = pool.acquire();
  EXPECT_NE(other.get(), first) << "it is still used";
  object.reset();
  const auto again = pool.acquire();
  EXPECT_EQ(again.get(), first);
  EXPECT_GE(again->capacity(), 1000u);
}

TEST(ObjectPool, ObjectsOutliveIt) {
  std::shared_ptr<Numbers> survivor;
  {
    ObjectPool<Numbers> pool;
    survivor = pool.acquire();
  }
  survivor->push_back(1);
  EXPECT_EQ(survivor->size(), 1u);
}

TEST(ObjectPool, ServesSeveralThreads) {
  ObjectPool<Numbers> pool;
  std::vector<std::jthread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&pool] {
      for (int i = 0; i < 1000; ++i) pool.acquire()->assign(8, i);
    });
}

TEST(NewestValue, IsFetchedOnceAndTheNewestReplacesOthers) {
  NewestValue<int> place;
  place.writing() = 3;
  EXPECT_FALSE(place.fetch());
  place.offer();
  ASSERT_TRUE(place.fetch());
  EXPECT_EQ(place.reading(), 3);
  EXPECT_FALSE(place.fetch());
  for (int i = 1; i <= 5; ++i) {
    place.writing() = i;
    place.offer();
  }
  ASSERT_TRUE(place.fetch());
  EXPECT_EQ(place.reading(), 5);
}

TEST(NewestValue, ValuesKeepTheirMemory) {
  NewestValue<Numbers> place;
  for (int i = 0; i < 4; ++i) {
    place.writing().assign(100, i);
    place.offer();
    ASSERT_TRUE(place.fetch());
  }
  EXPECT_GE(place.writing().capacity(), 100u);
}

TEST(NewestValue, ReaderIsNeverTheLastOwner) {
  NewestValue<std::shared_ptr<int>> place;
  const auto owned = std::make_shared<int>(7);
  place.writing() = owned;
  place.offer();
  ASSERT_TRUE(place.fetch());
  EXPECT_FALSE(place.fetch());
  EXPECT_EQ(owned.use_count(), 2) << "it stays in the reader's place";
  for (int i = 0; i < 2; ++i) {
    place.offer();
    ASSERT_TRUE(place.fetch());
  }
  place.writing().reset();
  EXPECT_EQ(owned.use_count(), 1) << "the writer has it again and releases it";
}

TEST(NewestValue, ThreadReadsWholeValuesInOrder) {
  constexpr int kValues = 20'000;
  NewestValue<Numbers> place;
  const std::jthread writer([&] {
    for (int i = 1; i <= kValues; ++i) {
      place.writing().assign(8, i);
      place.offer();
    }
  });
  for (int last = 0; last < kValues;) {
    if (!place.fetch()) {
      std::this_thread::yield();
      continue;
    }
    const Numbers& read = place.reading();
    ASSERT_EQ(read, Numbers(8, read.front()));
    ASSERT_GT(read.front(), last);
    last = read.front();
  }
}

}  // namespace
}  // namespace fiducap
