#include "daemon/map_start.hpp"

#include <gmock/gmock.h>

#include <filesystem>

#include "mapping/store/sqlite_file.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

class MapStartTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
  /// A store with two versions. @return its path
  std::string two_versions() {
    settings_.store = folder_.file("map.sqlite");
    auto store = MapStore::open(settings_.store);
    TagMap map;
    map.tags.push_back(make_map({4}).tags.front());
    EXPECT_TRUE(store->commit(map, "first"));
    map.tags.push_back(make_map({5}).tags.front());
    EXPECT_TRUE(store->commit(map, "second"));
    return settings_.store;
  }
  [[nodiscard]] Expected<StartMap> open() { return open_start_map(settings_, tags_, events_); }
  [[nodiscard]] std::vector<Event> rolled_back() const {
    auto all = events_.after(0);
    std::erase_if(all,
                  [](const Event& e) { return e.subject != "map" || e.kind != "rolled_back"; });
    return all;
  }

  EventBoard events_{[] { return std::int64_t{0}; }};
  MapSettings settings_;
  TagSetConfig tags_;
};

TEST_F(MapStartTest, IsEmptyWithoutStoreAndFile) {
  settings_.reference_tag = 3;
  const auto start = value_of(open());
  EXPECT_TRUE(start.map.tags.empty());
  EXPECT_EQ(start.map.reference_tag, 3);
  EXPECT_FALSE(start.store.has_value());
}

TEST_F(MapStartTest, ImportsASurveyOnce) {
  settings_.store = folder_.file("map.sqlite");
  settings_.file =
      folder_.write("survey.csv", "id,size,px,py,pz,qw,qx,qy,qz\n4,0.16,1,2,3,1,0,0,0\n");
  {
    const auto first = value_of(open());
    ASSERT_EQ(first.map.tags.size(), 1u);
    EXPECT_EQ(first.map.version, 1);
    EXPECT_THAT(error_of(open()), HasSubstr("is in use by process"));
  }
  settings_.file = folder_.file("gone.csv");
  const auto second = value_of(open());
  EXPECT_EQ(second.map.version, 1);
  ASSERT_NE(second.map.find(4), nullptr);
  EXPECT_EQ(second.map.find(4)->tag.X_WT.p.y(), 2);
}

TEST_F(MapStartTest, RollsBackToTheLastSoundVersion) {
  const std::string path = two_versions();
  ASSERT_TRUE(SqliteFile::open(path)->execute("UPDATE tag SET px = 9 WHERE version = 2"));
  const auto start = value_of(open());
  EXPECT_EQ(start.map.version, 1);
  ASSERT_EQ(rolled_back().size(), 1u);
  EXPECT_THAT(rolled_back().front().text, testing::AllOf(HasSubstr("went back to version 1"),
                                                         HasSubstr("version 2 is damaged")));
  EXPECT_EQ(start.store->log()->size(), 2u) << "kept";
}

TEST_F(MapStartTest, RepairsADamagedFileAndKeepsIt) {
  const std::string path = two_versions();
  {
    auto store = MapStore::open(path);  // many pages
    TagMap map = *store->newest();
    for (int id = 6; id < 60; ++id) map.tags.push_back(make_map({id}).tags.front());
    ASSERT_TRUE(store->commit(map, "third"));
  }
  const auto size = std::filesystem::file_size(path);
  std::filesystem::resize_file(path, size - 4096);
  ASSERT_FALSE(MapStore::open(path));
  const auto start = value_of(open());
  EXPECT_EQ(start.map.version, 2);
  EXPECT_EQ(std::filesystem::file_size(path + ".damaged-1"), size - 4096);
  ASSERT_EQ(rolled_back().size(), 1u);
  EXPECT_THAT(rolled_back().front().text, HasSubstr("version 3"));
  EXPECT_THAT(rolled_back().front().remedy, HasSubstr(path + ".damaged-1"));
}

TEST_F(MapStartTest, RefusesAMapOfAnotherTagFamily) {
  settings_.file =
      folder_.write("survey.csv", "id,size,px,py,pz,qw,qx,qy,qz\n4,0.16,1,2,3,1,0,0,0\n");
  tags_.family = "tag25h9";
  EXPECT_THAT(error_of(open()), HasSubstr("tag25h9"));
}

TEST(UseLearned, UsesLearnedExtrinsicsUnlessTheyAreFarOffOrInvalid) {
  BodySensors sensors;
  sensors.cameras.resize(4);
  for (CameraMount& mount : sensors.cameras) mount.X_BV.p = {0.1, 0, 0};
  const Pose close{Eigen::Quaterniond::Identity(), {0.11, 0, 0}};
  const Pose far{Eigen::Quaterniond::Identity(), {0.5, 0, 0}};
  const Pose nowhere{Eigen::Quaterniond::Identity(), {std::nan(""), 0, 0}};
  const Pose bent{Eigen::Quaterniond(1, 0, 0, 0.01), {0.11, 0, 0}};
  use_learned({{"robot", 0, close},
               {"robot", 1, far},
               {"robot", 2, nowhere},
               {"robot", 3, bent},
               {"other", 0, far},
               {"robot", 9, close}},
              "robot", sensors);
  EXPECT_EQ(sensors.cameras[0].X_BV.p.x(), 0.11);
  for (const std::size_t k : {1u, 2u, 3u}) EXPECT_EQ(sensors.cameras[k].X_BV.p.x(), 0.1) << k;
}

TEST(UseLearned, UsesTheLearnedClockUnlessItIsExact) {
  BodySensors sensors;
  sensors.cameras.resize(3);
  sensors.cameras[0].readout_s = 0.01;
  sensors.cameras[0].readout_sigma_s = 0.005;
  sensors.cameras[1].time_shift_sigma_s = 0;
  const StoredClock clock{-0.03, 0.015};
  use_learned({{"robot", 0, Pose{}, clock}, {"robot", 1, Pose{}, clock}, {"robot", 2, Pose{}}},
              "robot", sensors);
  EXPECT_EQ(sensors.start_shifts_s, (std::vector<double>{-0.03, 0.0, 0.0}));
  EXPECT_EQ(sensors.cameras[0].readout_s, 0.015);
  EXPECT_EQ(sensors.cameras[1].readout_s, 0.0);
  sensors.cameras[0].time_shift = from_seconds(-0.03);
  use_learned({{"robot", 0, Pose{}, clock}}, "robot", sensors);
  EXPECT_NEAR(sensors.start_shifts_s[0], 0, 1e-12) << "configured by now, not added again";
}

TEST(DoubtLearnedLenses, NamesParametersByBodyAndCamera) {
  TagMap map = with_ties(make_map({3, 5}));
  doubt_learned_lenses({{"rover", 1, Pose{}, {}, {.focal = 0.01, .centre_v_px = 2.0}},
                        {"gone", 0, Pose{}, {}, {.focal = 0.01}},
                        {"drone", 0, Pose{}}},
                       {{"rover", 7}, {"drone", 8}}, map);
  ASSERT_EQ(map.known->wrong_lenses.size(), 2U);
  EXPECT_EQ(map.known->wrong_lenses[0].body_id, 7);
  EXPECT_EQ(map.known->wrong_lenses[0].camera, 1);
  EXPECT_EQ(map.known->wrong_lenses[0].kind, FoundMismatch::Kind::kFocalLength);
  EXPECT_EQ(map.known->wrong_lenses[1].kind, FoundMismatch::Kind::kCentreV);
  TagMap without = make_map({3, 5});
  doubt_learned_lenses({{"rover", 1, Pose{}, {}, {.focal = 0.01}}}, {{"rover", 7}}, without);
  EXPECT_EQ(without.known, nullptr) << "without correlations";
}

}  // namespace
}  // namespace fiducap
