#include "base/newest_value.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace fiducap {
namespace {

TEST(NewestValue, HasNothingBeforeTheFirstOffer) {
  NewestValue<int> place;
  place.writing() = 3;
  EXPECT_FALSE(place.fetch());
  place.offer();
  ASSERT_TRUE(place.fetch());
  EXPECT_EQ(place.reading(), 3);
  EXPECT_FALSE(place.fetch()) << "once is enough";
}

TEST(NewestValue, TheNewestReplacesWhatWasNotFetched) {
  NewestValue<int> place;
  for (int i = 1; i <= 5; ++i) {
    place.writing() = i;
    place.offer();
  }
  ASSERT_TRUE(place.fetch());
  EXPECT_EQ(place.reading(), 5);
}

TEST(NewestValue, ValuesKeepTheirMemory) {
  NewestValue<std::vector<int>> place;
  for (int i = 0; i < 4; ++i) {
    place.writing().assign(100, i);
    place.offer();
    ASSERT_TRUE(place.fetch());
  }
  EXPECT_GE(place.writing().capacity(), 100u);
}

TEST(NewestValue, WhoReadsIsNeverTheLastOwner) {
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
  EXPECT_EQ(owned.use_count(), 1) << "it came back to the writer, who lets go of it";
}

TEST(NewestValue, BetweenTwoThreadsValuesComeWholeAndInOrder) {
  constexpr int kValues = 20'000;
  NewestValue<std::vector<int>> place;
  const std::jthread writer([&] {
    for (int i = 1; i <= kValues; ++i) {
      place.writing().assign(8, i);
      place.offer();
    }
  });
  int last = 0;
  while (last < kValues) {
    if (!place.fetch()) {
      std::this_thread::yield();
      continue;
    }
    const std::vector<int>& read = place.reading();
    ASSERT_EQ(read, std::vector<int>(8, read.front()));
    ASSERT_GT(read.front(), last);
    last = read.front();
  }
}

}  // namespace
}  // namespace fiducap
