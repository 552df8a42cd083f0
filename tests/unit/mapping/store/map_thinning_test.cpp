// Thinning of a store by age; correlations of tags in it, and migration of older stores.
#include <gmock/gmock.h>

#include <algorithm>
#include <random>
#include <set>

#include "mapping/store/map_repair.hpp"
#include "mapping/store/map_store.hpp"
#include "mapping/store/sqlite_file.hpp"
#include "support/fault_disk.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/map_fixture.hpp"
#include "unit/mapping/store/old_stores.hpp"

namespace fiducap {
namespace {

constexpr const char* kPath = "hall.map";

class ThinnedStoreTest : public testing::Test {
 protected:
  static MapStore open() { return value_of(MapStore::open(kPath)); }
  /// A commit every ten seconds, as a server does it.
  void run(MapStore& store, int commits, const std::string& comment = kAutomaticComment) {
    for (int i = 0; i < commits; ++i) {
      map_.created_utc_ns += 10'000'000'000;
      map_.tags[0].tag.X_WT.p.x() += 0.001;
      map_ = *store.commit(map_, comment);
      const auto thinned = value_of(store.thin());
      thinned_ += thinned;
    }
  }
  test::FaultDisk disk_;  // faster than a real one
  TagMap map_{make_map({1, 2, 3, 4, 5, 6, 7, 8})};
  int thinned_{0};
};

TEST_F(ThinnedStoreTest, StopsGrowing) {
  auto store = open();
  run(store, 400);
  const auto after_an_hour = disk_.content(kPath).size();
  run(store, 400);
  EXPECT_LT(static_cast<double>(disk_.content(kPath).size()),
            1.2 * static_cast<double>(after_an_hour));
}

TEST_F(ThinnedStoreTest, ShrinksAnOldStoreInSteps) {
  auto store = open();
  map_ = make_map(first_ids(400));
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

TEST_F(ThinnedStoreTest, KeepsADamagedVersion) {
  auto store = open();
  run(store, 5);
  ASSERT_TRUE(SqliteFile::open(kPath)->execute("UPDATE tag SET px = 77 WHERE version = 3"));
  run(store, 200);
  EXPECT_THAT(*store.log(), testing::Contains(testing::Field(&MapVersionInfo::version, 3)));
}

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kMinute = 60 * kSecond;
constexpr std::int64_t kHour = 60 * kMinute;
constexpr std::int64_t kDay = 24 * kHour;
constexpr std::int64_t kStart = 1'700'000'000 * kSecond;

/// A store whose server commits every ten seconds and thins out after each commit.
class History final {
 public:
  void commit(std::int64_t utc_ns, bool automatic = true) {
    newest_first_.insert(newest_first_.begin(), {++number_, utc_ns, automatic});
    const auto old = versions_to_thin(newest_first_);
    const std::set<std::int64_t> gone(old.begin(), old.end());
    std::erase_if(newest_first_, [&](const VersionAge& one) { return gone.contains(one.version); });
  }
  void run(std::int64_t from, std::int64_t length, std::int64_t period) {
    for (std::int64_t t = 0; t < length; t += period) commit(from + t);
  }
  [[nodiscard]] std::size_t between(std::int64_t youngest, std::int64_t oldest) const {
    const auto now = newest_first_.front().created_utc_ns;
    return static_cast<std::size_t>(
        std::count_if(newest_first_.begin(), newest_first_.end(), [&](const VersionAge& one) {
          const auto age = now - one.created_utc_ns;
          return age >= youngest && age < oldest;
        }));
  }
  [[nodiscard]] const std::vector<VersionAge>& versions() const { return newest_first_; }

 private:
  std::vector<VersionAge> newest_first_;
  std::int64_t number_{0};
};

TEST(MapThinning, KeepsAFewHundredVersionsOfADay) {
  History history;
  history.run(kStart, kDay, 10 * kSecond);  // 8640 commits
  EXPECT_EQ(history.between(0, 10 * kMinute), 60u) << "all of the last ten minutes";
  EXPECT_NEAR(static_cast<double>(history.between(10 * kMinute, kHour)), 50, 1);
  EXPECT_NEAR(static_cast<double>(history.between(kHour, kDay)), 23 * 6, 1);
  EXPECT_LE(history.versions().size(), 252u);
}

TEST(MapThinning, LimitsTheVersionsOfYears) {
  History history;
  for (std::int64_t day = 0; day < 3 * 365; ++day)
    history.run(kStart + day * kDay, kDay, 20 * kMinute);
  EXPECT_NEAR(static_cast<double>(history.between(kDay, 7 * kDay)), 6 * 24, 1);
  EXPECT_NEAR(static_cast<double>(history.between(7 * kDay, 365 * kDay)), 358, 1);
  EXPECT_NEAR(static_cast<double>(history.between(365 * kDay, 4 * 365 * kDay)), 730.0 / 30, 2);
}

TEST(MapThinning, LimitsGapsByAge) {
  History history;
  history.run(kStart, 2 * kDay, 10 * kSecond);
  const auto& versions = history.versions();
  const auto now = versions.front().created_utc_ns;
  for (std::size_t i = 1; i < versions.size(); ++i) {
    const auto age = now - versions[i].created_utc_ns;
    const auto gap = versions[i - 1].created_utc_ns - versions[i].created_utc_ns;
    // Two neighbours may be the first and the last of what was in their spans.
    const auto span = age < 10 * kMinute ? 10 * kSecond
                      : age < kHour      ? kMinute
                      : age < kDay       ? 10 * kMinute
                                         : kHour;
    EXPECT_LE(gap, 2 * span) << "at age " << age / kSecond << " s";
  }
}

TEST(MapThinning, KeepsNamedVersionsAndTheNewest) {
  History history;
  history.commit(kStart, false);
  history.run(kStart + kSecond, kDay, 10 * kSecond);
  history.commit(kStart + kDay, false);
  history.run(kStart + kDay + kSecond, kDay, 10 * kSecond);
  const auto named = std::count_if(history.versions().begin(), history.versions().end(),
                                   [](const VersionAge& one) { return !one.automatic; });
  EXPECT_EQ(named, 2);
  const std::vector<VersionAge> two{{9, kStart + kDay, true}, {1, kStart + kDay - kHour, true}};
  EXPECT_TRUE(versions_to_thin(two).empty());
  EXPECT_TRUE(versions_to_thin({}).empty());
}

TEST(MapThinning, KeepsVersionsWhenTheClockIsSetBack) {
  std::vector<VersionAge> versions;
  for (int i = 0; i < 100; ++i) versions.push_back({100 - i, kStart + kDay + i * kSecond, true});
  versions.front().created_utc_ns = 0;  // a machine without a battery
  EXPECT_TRUE(versions_to_thin(versions).empty());
}

TEST(MapThinning, KeepsTheNewestForAnyTimes) {
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<VersionAge> versions;
    for (int i = 0; i < 50; ++i)
      versions.push_back({50 - i, static_cast<std::int64_t>(random()), random() % 4 != 0});
    for (const std::int64_t gone : versions_to_thin(versions)) {
      EXPECT_NE(gone, 50);
      EXPECT_TRUE(versions[static_cast<std::size_t>(50 - gone)].automatic);
    }
  }
}

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
