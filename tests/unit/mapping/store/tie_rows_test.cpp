// Correlations of tags in a store, and migration of older stores.
#include <gtest/gtest.h>

#include "mapping/store/map_repair.hpp"
#include "mapping/store/map_store.hpp"
#include "mapping/store/sqlite_file.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/map_fixture.hpp"
#include "unit/mapping/store/old_stores.hpp"

namespace fiducap {
namespace {

class TieRowsTest : public testing::Test {
 protected:
  [[nodiscard]] MapStore open() const { return value_of(MapStore::open(path_)); }
  [[nodiscard]] std::int64_t count() const {
    return *SqliteFile::open(path_)->integer("SELECT count(*) FROM tie");
  }

  TemporaryFolder folder_;
  std::string path_{folder_.file("hall.map")};
};

void expect_same(const KnownMap& a, const KnownMap& b) {
  ASSERT_EQ(a.tags.size(), b.tags.size());
  for (std::size_t i = 0; i < a.tags.size(); ++i) {
    EXPECT_EQ(a.tags[i].tag_id, b.tags[i].tag_id);
    EXPECT_TRUE(a.tags[i].covariance.isApprox(b.tags[i].covariance, 1e-14));
  }
  ASSERT_EQ(a.pairs.size(), b.pairs.size());
  for (std::size_t i = 0; i < a.pairs.size(); ++i) {
    EXPECT_EQ(a.pairs[i].first_id, b.pairs[i].first_id);
    EXPECT_EQ(a.pairs[i].second_id, b.pairs[i].second_id);
    EXPECT_EQ(a.pairs[i].covariance, b.pairs[i].covariance);
  }
}

TEST_F(TieRowsTest, AreReturnedExactly) {
  const TagMap map = with_ties(make_map({3, 5, 9, 12}));
  ASSERT_TRUE(open().commit(map, "calibrated"));
  const auto loaded = value_of(open().newest());
  ASSERT_NE(loaded.known, nullptr);
  expect_same(*loaded.known, *map.known);
  EXPECT_GT(loaded.known->revision, 0U) << "a filter takes it over";
}

TEST_F(TieRowsTest, KeepWrongPrintsAndReadOlderRows) {
  TagMap map = with_ties(make_map({3, 5, 9}));
  KnownMap known = *map.known;
  known.wrong_prints = {KnownMap::kAllPrints, 5};
  map.known = std::make_shared<const KnownMap>(known);
  ASSERT_TRUE(open().commit(map, "calibrated"));
  EXPECT_EQ(open().newest()->known->wrong_prints, known.wrong_prints);
  {
    auto file = SqliteFile::open(path_);
    auto row = file->prepare("SELECT content FROM tie");
    ASSERT_TRUE(*row.step());
    std::vector<std::byte> bytes = row.blob(0);
    bytes.resize(bytes.size() - 12);
    auto update = file->prepare("UPDATE tie SET content = ?, hash = ?");
    ASSERT_TRUE(update.bind(bytes).bind(hash_of(bytes)).run());
  }
  const auto loaded = value_of(open().newest());
  expect_same(*loaded.known, known);
  EXPECT_TRUE(loaded.known->wrong_prints.empty());
}

TEST_F(TieRowsTest, KeepErrorsOfALens) {
  auto store = open();
  ASSERT_TRUE(store.save_extrinsics({"rover", 1, Pose{}, {}, {.focal = 0.012, .k1 = -0.03}}));
  ASSERT_TRUE(store.save_extrinsics({"rover", 0, Pose{}, StoredClock{0.01, 0}}));
  const auto learned = value_of(store.extrinsics());
  ASSERT_EQ(learned.size(), 2U);
  EXPECT_TRUE(learned.at(0).lens.is_none());
  EXPECT_EQ(learned.at(1).lens.focal, 0.012);
  EXPECT_EQ(learned.at(1).lens.centre_u_px, std::nullopt);
  EXPECT_EQ(learned.at(1).lens.k1, -0.03);
  ASSERT_TRUE(store.save_extrinsics({"rover", 1, Pose{}}));
  EXPECT_TRUE(store.extrinsics()->at(1).lens.is_none());
}

TEST_F(TieRowsTest, AreMigratedWithoutLenses) {
  {
    auto store = open();
    ASSERT_TRUE(store.commit(with_ties(make_map({3, 5, 9})), "of an old server"));
    ASSERT_TRUE(store.save_extrinsics({"rover", 0, Pose{}, StoredClock{0.01, 0}}));
  }
  ASSERT_TRUE(make_old(path_, 2));
  const auto reader = value_of(MapStore::open_to_read(path_));
  EXPECT_EQ(reader.extrinsics()->at(0).clock->shift_s, 0.01);
  auto store = open();
  EXPECT_NE(store.newest()->known, nullptr);
  ASSERT_TRUE(store.save_extrinsics({"rover", 0, Pose{}, {}, {.centre_u_px = 3.0}}));
  EXPECT_EQ(open().extrinsics()->at(0).lens.centre_u_px, 3.0);
}

TEST_F(TieRowsTest, AreNoneOfAMapWithoutCorrelations) {
  ASSERT_TRUE(open().commit(make_map({3, 5}), "calibrated"));
  EXPECT_EQ(open().newest()->known, nullptr);
  EXPECT_EQ(count(), 0);
}

TEST_F(TieRowsTest, ExcludeQuarantinedTags) {
  TagMap map = with_ties(make_map({3, 5, 9}));
  map.tags[1].state = TagState::kQuarantined;
  ASSERT_TRUE(open().commit(map, "calibrated"));
  const auto loaded = value_of(open().newest());
  EXPECT_EQ(loaded.known->tags.size(), 2U);
  EXPECT_EQ(loaded.known->find(5), nullptr);
}

TEST_F(TieRowsTest, AreKeptByTheNewestAndByNamedVersions) {
  auto store = open();
  const TagMap map = with_ties(make_map({3, 5, 9}));
  ASSERT_TRUE(store.commit(map, kAutomaticComment));
  ASSERT_TRUE(store.commit(map, "before the demo"));
  ASSERT_TRUE(store.commit(map, kAutomaticComment));
  ASSERT_TRUE(store.commit(map, kAutomaticComment));
  EXPECT_EQ(store.load(1)->known, nullptr);
  EXPECT_NE(store.load(2)->known, nullptr);
  EXPECT_EQ(store.load(3)->known, nullptr);
  EXPECT_NE(store.load(4)->known, nullptr);
}

TEST_F(TieRowsTest, AreCheckedForDamage) {
  ASSERT_TRUE(open().commit(with_ties(make_map({3, 5, 9})), "one"));
  ASSERT_TRUE(open().commit(with_ties(make_map({3, 5, 9, 11})), "two"));
  ASSERT_TRUE(SqliteFile::open(path_)->execute(
      "UPDATE tie SET content = zeroblob(length(content)) WHERE version = 2"));
  const auto loaded = open().load(2);
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, ErrorCode::kInvalid);
  EXPECT_NE(loaded.error().text().find("ties"), std::string::npos);
  const auto sound = value_of(open().newest_sound());
  EXPECT_EQ(sound.map.version, 1);
}

TEST_F(TieRowsTest, AreRefusedWithAWrongCount) {
  // A valid hash, but a wrong number of pairs.
  ASSERT_TRUE(open().commit(with_ties(make_map({3, 5, 9})), "one"));
  const std::vector<std::byte> bytes(8, std::byte{0xff});
  {
    auto file = SqliteFile::open(path_);
    auto update = file->prepare("UPDATE tie SET content = ?, hash = ?");
    ASSERT_TRUE(update.bind(bytes).bind(hash_of(bytes)).run());
  }
  const auto loaded = open().load(1);
  ASSERT_FALSE(loaded);
  EXPECT_NE(loaded.error().code, ErrorCode::kNotFound);
}

TEST_F(TieRowsTest, AreMigratedFromTheFirstSchema) {
  ASSERT_TRUE(open().commit(make_map({3, 5, 9}), "of an old server"));
  ASSERT_TRUE(make_old(path_, 1));
  {
    // Reading changes nothing.
    const auto reader = value_of(MapStore::open_to_read(path_));
    EXPECT_EQ(reader.newest()->tags.size(), 3U);
    EXPECT_EQ(
        *SqliteFile::open(path_, SqliteFile::Access::kSalvage)->integer("PRAGMA user_version"), 1);
  }
  auto store = open();
  EXPECT_EQ(store.newest()->tags.size(), 3U);
  EXPECT_EQ(store.newest()->comment, "of an old server");
  ASSERT_TRUE(store.commit(with_ties(make_map({3, 5, 9})), "new"));
  EXPECT_NE(open().newest()->known, nullptr);
}

TEST_F(TieRowsTest, AreKeptByARepair) {
  const TagMap map = with_ties(make_map({3, 5, 9}));
  ASSERT_TRUE(open().commit(map, "one"));
  ASSERT_TRUE(open().commit(with_ties(make_map({3, 5, 9, 11})), "two"));
  ASSERT_TRUE(SqliteFile::open(path_)->execute("DELETE FROM tag WHERE version = 2 AND tag_id = 5"));
  ASSERT_TRUE(repair_map_store(path_));
  const auto loaded = value_of(open().newest());
  ASSERT_NE(loaded.known, nullptr);
  expect_same(*loaded.known, *map.known);
}

}  // namespace
}  // namespace fiducap
