// An operator changes the map of a running server over its sockets: three simulated robots in real
// time.
#include <gtest/gtest.h>

#include <cmath>

#include "mapping/store/map_store.hpp"
#include "support/running_server.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

constexpr int kRobots = 3;
constexpr double kElsewhere_m = 0.5;  // shift of the other version's map
constexpr double kClose_m = 0.15;     // of tags or robots in the mean: decimetres at first

/// The same room with shifted axes, as from another day.
TagMap moved(TagMap map) {
  for (MapTag& tag : map.tags) tag.tag.X_WT.p.x() += kElsewhere_m;
  if (!map.known) return map;
  KnownMap known = *map.known;
  for (KnownTag& tag : known.tags) tag.X_WT.p.x() += kElsewhere_m;
  map.known = std::make_shared<const KnownMap>(std::move(known));
  return map;
}

double mean_x_between(const TagMap& a, const TagMap& b) {
  double sum = 0;
  int both = 0;
  for (const MapTag& tag : a.tags) {
    const MapTag* other = b.find(tag.tag.tag_id);
    if (other == nullptr) continue;
    sum += tag.tag.X_WT.p.x() - other->tag.X_WT.p.x();
    ++both;
  }
  return both == 0 ? 1e9 : sum / both;
}

class OperatorMapTest : public testing::Test {
 protected:
  void SetUp() override {
    config_ = corner_demo();
    config_.map.store = folder_.file("hall.map");
    config_.map.builder.refine_period_s = 1.0;
    config_.map.builder.commit_period_s = 0.5;
    config_.operators.token = "correct horse";
    serve();
  }
  void TearDown() override { end(); }

  void serve() {
    server_.emplace(config_);
    ControlOptions options = server_->control_options(config_.operators.token);
    options.timeout = 10s;
    control_.emplace(options);
    client_.emplace(server_->client_options());
    robots_ = simulated_robots(config_, (*server_)->simulation_start());
  }
  void end() {
    client_.reset();
    control_.reset();
    server_.reset();
  }

  [[nodiscard]] bool are_tracked() {
    return client_->latest(frame_) && all_tracked(frame_, kRobots);
  }
  /// Mean offset of published robots from the truth, along x. @pre are_tracked()
  [[nodiscard]] double robots_x_off_m() {
    double sum = 0;
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      const Pose X_WP =
          robots_[i]->truth(instant_from_ns(frame_.at_server_ns)).X_WB * config_.bodies[i].pivot;
      sum += frame_.bodies[i].position_m[0] - X_WP.p.x();
    }
    return sum / kRobots;
  }
  [[nodiscard]] bool robots_are_at(double x_off_m) {
    return wait_until(
        [&] { return are_tracked() && std::abs(robots_x_off_m() - x_off_m) < kClose_m; });
  }
  [[nodiscard]] std::int64_t served_version() {
    ControlState state;
    const Outcome outcome = control_->list(state);
    EXPECT_TRUE(outcome) << outcome.problem;
    return state.map_version;
  }

  [[nodiscard]] TagMap newest() const {
    return MapStore::open_to_read(config_.map.store).value().newest().value();
  }
  /// @return nullopt: there is none
  [[nodiscard]] std::optional<MapVersionInfo> version_called(const std::string& comment) const {
    const auto log = MapStore::open_to_read(config_.map.store).value().log().value();
    const auto found =
        std::find_if(log.begin(), log.end(), [&](const auto& v) { return v.comment == comment; });
    return found == log.end() ? std::nullopt : std::optional(*found);
  }

  TemporaryFolder folder_;
  ServerConfig config_;
  std::optional<RunningServer> server_;
  std::optional<Control> control_;
  std::optional<Client> client_;
  Frame frame_;
  std::vector<std::unique_ptr<simulation::SimulatedSource>> robots_;
};

TEST_F(OperatorMapTest, RolledBackMapIsServedAndRefined) {
  ASSERT_TRUE(wait_until([&] { return are_tracked() && newest().tags.size() >= 12; }));
  end();
  const TagMap here = newest();
  const TagMap elsewhere = moved(here);
  std::int64_t old_version = 0;
  {
    auto store = MapStore::open(config_.map.store).value();
    old_version = store.commit(elsewhere, "elsewhere").value().version;
    ASSERT_TRUE(store.commit(here, "here"));
  }
  serve();
  ASSERT_TRUE(robots_are_at(0));

  const Outcome rolled = control_->roll_back(old_version);
  ASSERT_TRUE(rolled) << rolled.problem;
  const std::string comment = "rolled back to version " + std::to_string(old_version);
  ASSERT_TRUE(wait_until([&] { return version_called(comment).has_value(); }));
  EXPECT_EQ(version_called(comment)->parent, old_version);
  EXPECT_TRUE(robots_are_at(kElsewhere_m)) << "now " << robots_x_off_m();

  // The map is refined, and neither bodies nor graph restore the old one.
  const std::int64_t version = version_called(comment)->version;
  ASSERT_TRUE(wait_until([&] { return served_version() >= version + 6; }));
  EXPECT_NEAR(mean_x_between(newest(), here), kElsewhere_m, kClose_m);
  EXPECT_TRUE(robots_are_at(kElsewhere_m)) << "now " << robots_x_off_m();
}

TEST_F(OperatorMapTest, ForgottenTagIsMappedAgain) {
  ASSERT_TRUE(wait_until([&] { return are_tracked() && newest().tags.size() >= 12; }));
  const TagMap before = newest();
  const MapTag& most_seen =
      *std::max_element(before.tags.begin() + 1, before.tags.end(),
                        [](const auto& a, const auto& b) { return a.sightings < b.sightings; });
  const int tag_id = most_seen.tag.tag_id;
  ASSERT_TRUE(control_->set_mapping(false));
  const Outcome frozen = control_->forget_tag(tag_id);
  EXPECT_NE(frozen.problem.find("the map is frozen"), std::string::npos) << frozen.problem;
  EXPECT_FALSE(control_->roll_back(1));
  ASSERT_TRUE(control_->set_mapping(true));
  const Outcome forgotten = control_->forget_tag(tag_id);
  ASSERT_TRUE(forgotten) << forgotten.problem;
  EXPECT_TRUE(wait_until([&] { return newest().find(tag_id) == nullptr; }));
  int sightings = 0;
  ASSERT_TRUE(wait_until([&] { return newest().find(tag_id) != nullptr; })) << "seen again";
  const auto all = MapStore::open_to_read(config_.map.store).value();
  const auto log = all.log().value();
  for (const MapVersionInfo& version : log) {  // the first one after it was gone
    const TagMap map = all.load(version.version).value();
    if (map.find(tag_id) == nullptr) break;
    sightings = map.find(tag_id)->sightings;
  }
  EXPECT_LT(sightings, most_seen.sightings);
}

TEST_F(OperatorMapTest, VersionsAreStoredWithNamesAndRenamed) {
  ASSERT_TRUE(wait_until([&] { return newest().version > 0; }));
  ASSERT_TRUE(control_->commit_map("as it was on monday"));
  ASSERT_TRUE(wait_until([&] { return version_called("as it was on monday").has_value(); }));
  const auto version = version_called("as it was on monday")->version;
  ASSERT_TRUE(control_->name_version(version, "monday"));
  ASSERT_TRUE(wait_until([&] { return version_called("monday").has_value(); }));
  EXPECT_EQ(version_called("monday")->version, version);
  EXPECT_NE(control_->name_version(version + 1000, "x").problem.find("there is no version"),
            std::string::npos);
}

}  // namespace
}  // namespace fiducap
