#include "daemon/map_keeper.hpp"

#include <gtest/gtest.h>

#include <sys/resource.h>

#include <csignal>
#include <future>
#include <mutex>
#include <thread>

#include "mapping/store/sqlite_file.hpp"
#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"
#include "support/fault_disk.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/solution_fixture.hpp"

namespace fiducap {
namespace {

class MapKeeperTest : public testing::Test {
 protected:
  MapKeeperTest() { build(); }
  void build(MapMode mode = MapMode::kMapping) {
    keeper_.reset();
    MapConfig config;
    config.mode = mode;
    map_ = std::make_unique<MapBuilder>(config, TagMap{});
    keeper_ = std::make_unique<MapKeeper>(value_of(MapStore::open(file_)), *map_, 10.0, clock_,
                                          events_, [this] { return learned_; });
  }
  void run_stopped() {
    std::stop_source stop;
    stop.request_stop();
    keeper_->run(stop.get_token());
  }
  void see(int id, double x = 1.0) {
    map_->adopt(solution_with(graph_estimate(id, x, 0, 1e-4)), kNow_utc_ns);
  }
  void commit_with(int id, double x = 1.0) {
    see(id, x);
    keeper_->commit();
  }
  template <class Request>
  void commit_request(const Request& request) {
    ASSERT_TRUE(keeper_->request(request));
    keeper_->commit();
  }
  [[nodiscard]] std::vector<MapVersionInfo> stored() const {
    auto store = MapStore::open(file_);
    return store ? store->log().value() : std::vector<MapVersionInfo>{};
  }

  TemporaryFolder folder_;
  std::string file_{folder_.file("map.sqlite")};
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
  std::vector<LearnedBody> learned_;
  std::unique_ptr<MapBuilder> map_;
  std::unique_ptr<MapKeeper> keeper_;
};

TEST_F(MapKeeperTest, StoresAChangedMapOnce) {
  commit_with(4);
  keeper_->commit();
  ASSERT_EQ(stored().size(), 1u);
  EXPECT_EQ(stored().front().tags, 1);
  commit_with(5);
  EXPECT_EQ(stored().size(), 2u);
}

TEST_F(MapKeeperTest, StoresNoEmptyMapAndNothingWhileItIsFrozen) {
  keeper_->commit();
  EXPECT_TRUE(stored().empty());
  build(MapMode::kFrozen);
  commit_with(4);
  EXPECT_TRUE(stored().empty());
}

TEST_F(MapKeeperTest, StoresTagsFromBeforeTheMapWasFrozen) {
  see(4);
  map_->set_mode(MapMode::kFrozen);
  keeper_->commit();
  ASSERT_EQ(stored().size(), 1u);
  EXPECT_EQ(stored().front().tags, 1);
}

TEST_F(MapKeeperTest, ReportsARequestedCommit) {
  commit_with(4, 1.0);
  EXPECT_TRUE(events_.after(0).empty()) << "without a request";
  commit_request(CommitVersion{"before the fair"});
  ASSERT_FALSE(events_.after(0).empty());
  EXPECT_EQ(events_.after(0).back().kind, "version_stored");
  EXPECT_EQ(events_.after(0).back().text, "is stored as version 2");
  commit_request(CommitVersion{});
  EXPECT_EQ(events_.after(0).back().text, "is stored already, as version 2");
}

TEST_F(MapKeeperTest, MakesARollBackTheNewestVersion) {
  commit_with(4, 1.0);
  see(5);
  commit_request(RollBack{1});
  const auto log = stored();
  ASSERT_EQ(log.size(), 3u) << "the served map is stored, too";
  EXPECT_EQ(log[0].comment, "rolled back to version 1");
  EXPECT_EQ(log[0].parent, 1);
  EXPECT_EQ(log[0].tags, 1);
  EXPECT_EQ(log[1].tags, 2);
  EXPECT_EQ(map_->snapshot()->version, 3);
  EXPECT_EQ(map_->snapshot()->hash, log[0].hash);
  EXPECT_EQ(map_->snapshot()->tags.size(), 1u);
  EXPECT_FALSE(map_->changed());
  EXPECT_EQ(events_.after(0).back().text, "was rolled back to version 1, stored as 3 with 1 tags");
}

TEST_F(MapKeeperTest, KeepsTheOriginAtARollBack) {
  commit_with(4, 1.0);
  const Pose X_RW{Eigen::Quaterniond::Identity(), {5, 4, 0}};
  map_->align(X_RW, 1);
  commit_request(RollBack{1});
  EXPECT_EQ(map_->snapshot()->X_RW.p, X_RW.p);
  EXPECT_EQ(map_->snapshot()->tags.size(), 1u);
}

TEST_F(MapKeeperTest, KeepsTheMapWhenARollBackFails) {
  commit_with(4);
  commit_request(RollBack{12});
  EXPECT_EQ(stored().size(), 1u);
  EXPECT_EQ(events_.after(0).back().kind, "refused");
  map_->set_mode(MapMode::kFrozen);
  commit_request(RollBack{1});
  EXPECT_EQ(stored().size(), 1u);
  EXPECT_NE(events_.after(0).back().text.find("the map is frozen"), std::string::npos);
}

TEST_F(MapKeeperTest, StoresWithANameAndNamesVersions) {
  commit_with(4);
  ASSERT_TRUE(keeper_->request(NameVersion{1, "before the move"}));
  commit_request(CommitVersion{"after it"});
  const auto log = stored();
  ASSERT_EQ(log.size(), 2u) << "without a change";
  EXPECT_EQ(log[0].comment, "after it");
  EXPECT_EQ(log[1].comment, "before the move");
  keeper_->update_cache();
  EXPECT_EQ(keeper_->versions().log()->front().comment, "after it");
}

TEST_F(MapKeeperTest, ReadsVersionsInTheBackground) {
  commit_with(4);
  keeper_->update_cache();
  auto content = keeper_->versions().version(1);
  ASSERT_TRUE(content);
  EXPECT_EQ(*content, nullptr) << "is being read";
  std::jthread thread([&](const std::stop_token& stop) { keeper_->run(stop); });
  while (*content == nullptr) {
    clock_.advance(std::chrono::seconds(1));
    std::this_thread::yield();
    content = keeper_->versions().version(1);
  }
  EXPECT_EQ((*content)->tags.size(), 1u);
  EXPECT_EQ(keeper_->versions().version(2).error().code, ErrorCode::kNotFound);
}

TEST_F(MapKeeperTest, LimitsWaitingRequests) {
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(keeper_->request(CommitVersion{}));
  EXPECT_EQ(keeper_->request(CommitVersion{}).error().code, ErrorCode::kUnavailable);
}

TEST_F(MapKeeperTest, StoresWhatWasLearnedAtTheEndWithoutAChangeOfTheMap) {
  ExtrinsicsEstimate camera{Pose{Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3}}, {}};
  camera.clock = {.shift_s = 0.02, .shift_sigma_s = 1e-4, .readout_s = 0.0, .readout_sigma_s = 0.0};
  ExtrinsicsEstimate other = camera;
  other.clock.shift_sigma_s = 0.01;
  other.lens.offset = {0.01, {0.5, -3.0}, 0.02};
  other.lens.focal_sigma = 1e-3;
  other.lens.centre_sigma_px = {0.4, 0.4};  // of u: noise
  learned_ = {{"robot", {camera, other}, {std::chrono::milliseconds(30)}}};
  run_stopped();
  const auto stored = value_of(value_of(MapStore::open(file_)).extrinsics());
  ASSERT_EQ(stored.size(), 2U);
  EXPECT_EQ(stored[0].body, "robot");
  EXPECT_EQ(stored[0].X_BV.p.z(), 0.3);
  ASSERT_TRUE(stored[0].clock);
  EXPECT_NEAR(stored[0].clock->shift_s, 0.05, 1e-12) << "with the configured part";
  EXPECT_FALSE(stored[1].clock);
  const StoredLens& lens = stored[1].lens;
  EXPECT_EQ(lens.focal, 0.01);
  EXPECT_EQ(lens.centre_u_px, std::nullopt);
  EXPECT_EQ(lens.centre_v_px, -3.0);
  EXPECT_EQ(lens.k1, std::nullopt) << "as configured";
}

/// While it lives, files of this process cannot grow, as on a full disk.
class FullDisk final {
 public:
  FullDisk() {
    ::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit none{0, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &none);
  }
  ~FullDisk() { ::setrlimit(RLIMIT_FSIZE, &before_); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
};

TEST_F(MapKeeperTest, SurvivesAFullDiskAndKeepsTheNameOfARequest) {
  commit_with(4);
  see(5);
  {
    const FullDisk full;
    EXPECT_NO_THROW(keeper_->commit());
    EXPECT_NO_THROW(keeper_->commit());
    ASSERT_EQ(events_.standing().size(), 1u);
    EXPECT_EQ(events_.standing().front().subject, "map");
    EXPECT_EQ(events_.standing().front().kind, "not_stored");
    EXPECT_FALSE(events_.standing().front().remedy.empty());
    EXPECT_EQ(events_.after(0).size(), 1u) << "one event";
    keeper_->request_commit();
    keeper_->commit();
  }
  ASSERT_EQ(stored().size(), 1u) << "the stored map is unchanged";
  EXPECT_EQ(stored().front().tags, 1);
  keeper_->commit();
  ASSERT_EQ(stored().size(), 2u);
  EXPECT_EQ(stored().front().tags, 2);
  EXPECT_EQ(stored().front().comment, "stored by an operator");
  EXPECT_TRUE(events_.standing().empty());
}

TEST_F(MapKeeperTest, SurvivesFailedAllocations) {
  learned_ = {{"robot", {{Pose{}, Matrix6d::Identity()}}}};
  AllocationFault::reach_this_thread();
  std::size_t versions = 0;
  bool has_failed = true;
  for (int nth = 1; has_failed; ++nth) {
    see(4, nth);
    keeper_->request_commit();
    AllocationFault::arm(nth);
    EXPECT_NO_THROW(keeper_->commit());
    has_failed = AllocationFault::disarm();
    keeper_->commit();
    EXPECT_FALSE(map_->changed()) << nth;
    EXPECT_TRUE(events_.standing().empty()) << nth;
    ASSERT_GT(stored().size(), versions) << nth;
    versions = stored().size();
  }
  EXPECT_GT(versions, 20u);
}

TEST_F(MapKeeperTest, StoresTheMapWhenCamerasAreNotStored) {
  see(4);
  ASSERT_TRUE(SqliteFile::open(file_)->execute("ALTER TABLE extrinsics RENAME TO elsewhere"));
  learned_ = {{"robot", {{Pose{}, Matrix6d::Identity()}}}};
  keeper_->commit();
  EXPECT_FALSE(map_->changed());
  ASSERT_EQ(events_.standing().size(), 1u);
  EXPECT_EQ(events_.standing().front().kind, "cameras_not_stored");
  ASSERT_TRUE(SqliteFile::open(file_)->execute("ALTER TABLE elsewhere RENAME TO extrinsics"));
  keeper_->commit();
  EXPECT_TRUE(events_.standing().empty()) << "tried again without a change of the map";
}

/// A slow disk delays the keeper only.
TEST_F(MapKeeperTest, DoesNotBlockTheMapOnASlowDisk) {
  test::FaultDisk disk;
  file_ = "map.sqlite";
  build();
  see(4);
  std::promise<void> busy;
  std::promise<void> free;
  std::once_flag first;
  disk.on_sync([&] {
    std::call_once(first, [&] {
      busy.set_value();
      free.get_future().wait();
    });
  });
  std::jthread keeping([&] { keeper_->commit(); });
  busy.get_future().wait();
  see(5);
  EXPECT_EQ(map_->snapshot()->tags.size(), 2u);
  free.set_value();
  keeping.join();
  EXPECT_TRUE(map_->changed()) << "the new tag is in no version yet";
  keeper_.reset();
}

}  // namespace
}  // namespace fiducap
