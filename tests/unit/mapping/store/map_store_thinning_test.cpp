#include <gtest/gtest.h>

#include <algorithm>

#include "mapping/store/map_store.hpp"
#include "mapping/store/sqlite_file.hpp"
#include "support/fault_disk.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

constexpr const char* kPath = "hall.map";

class ThinnedStoreTest : public testing::Test {
 protected:
  static MapStore open() {
    auto store = MapStore::open(kPath);
    EXPECT_TRUE(store) << store.error().text();
    return std::move(*store);
  }
  /// A commit every ten seconds, as a server does it.
  void run(MapStore& store, int commits, const std::string& comment = kAutomaticComment) {
    for (int i = 0; i < commits; ++i) {
      map_.created_utc_ns += 10'000'000'000;
      map_.tags[0].tag.X_WT.p.x() += 0.001;
      map_ = *store.commit(map_, comment);
      const auto thinned = store.thin();
      ASSERT_TRUE(thinned) << thinned.error().text();
      thinned_ += *thinned;
    }
  }
  test::FaultDisk disk_;  // that waits for nothing
  TagMap map_{make_map({1, 2, 3, 4, 5, 6, 7, 8})};
  int thinned_{0};
};

TEST_F(ThinnedStoreTest, KeepsWhatWasNamedAndTheChainOfParents) {
  auto store = open();
  run(store, 1, "survey of May");
  run(store, 400);
  const auto log = *store.log();
  EXPECT_EQ(log.size() + static_cast<std::size_t>(thinned_), 401u);
  EXPECT_LT(log.size(), 130u);
  EXPECT_EQ(log.front().version, 401);
  EXPECT_EQ(log.back().comment, "survey of May");
  for (std::size_t i = 0; i + 1 < log.size(); ++i) EXPECT_EQ(log[i].parent, log[i + 1].version);
  for (const auto& one : log) EXPECT_TRUE(store.load(one.version));
}

TEST_F(ThinnedStoreTest, TheFileStopsGrowing) {
  auto store = open();
  run(store, 400);
  const auto after_an_hour = disk_.content(kPath).size();
  run(store, 400);
  EXPECT_LT(static_cast<double>(disk_.content(kPath).size()),
            1.2 * static_cast<double>(after_an_hour));
}

TEST_F(ThinnedStoreTest, AnOldStoreShrinksStepByStep) {
  std::vector<int> many;
  for (int id = 0; id < 400; ++id) many.push_back(id);
  auto store = open();
  map_ = make_map(many);
  for (int i = 0; i < 300; ++i) {  // before there was any thinning
    map_.created_utc_ns += 1'000'000'000;
    map_ = *store.commit(map_, kAutomaticComment);
  }
  const auto pages = [&] { return *SqliteFile::open(kPath)->integer("PRAGMA page_count"); };
  const auto before = pages();
  map_.created_utc_ns += 7'200'000'000'000;
  map_ = *store.commit(map_, kAutomaticComment);
  int steps = 0;
  for (int went = 1; went > 0; ++steps) {
    went = *store.thin();
    EXPECT_LE(went, 16);
  }
  EXPECT_GT(steps, 10);
  EXPECT_LE(store.log()->size(), 3u);
  EXPECT_LT(pages(), before * 2 / 3);
}

TEST_F(ThinnedStoreTest, ADamagedVersionIsNotThinnedOut) {
  auto store = open();
  run(store, 5);
  ASSERT_TRUE(SqliteFile::open(kPath)->execute("UPDATE tag SET px = 77 WHERE version = 3"));
  run(store, 200);
  const auto log = *store.log();
  EXPECT_TRUE(
      std::any_of(log.begin(), log.end(), [](const auto& one) { return one.version == 3; }));
}

}  // namespace
}  // namespace fiducap
