// A tag that is moved while robots map: pipelines, builder and refiner as in the server, in virtual
// time.
#include <gmock/gmock.h>

#include "base/pose.hpp"
#include "simulation/filter_run.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

constexpr double kTagMovedAt_s = 20;
const Eigen::Vector3d kTagMovedBy(0.2, -0.2, 0.1);

/// Two robots that walk the same part of the ring.
class MovedTagSimulation : public testing::Test {
 protected:
  MovedTagSimulation() {
    moved_ = most_seen_tag(simulate(setup(0)));
    for (std::uint64_t k = 0; k < 2; ++k) {
      SimulatedDataSetup one = setup(k);
      one.faults.moved_tag = moved_;
      one.faults.moved_at_s = kTagMovedAt_s;
      one.faults.moved_by_m = kTagMovedBy;
      robots_.push_back(simulate(one));
    }
    for (EstimationData& robot : robots_) robot.reference_tag = robots_.front().reference_tag;
  }

  static SimulatedDataSetup setup(std::uint64_t k) {
    return {.world = "ring",
            .seconds = 40,
            .seed = 5 + 100 * k,
            .from = 0.05 * static_cast<double>(k),
            .share = 0.12};
  }

  [[nodiscard]] std::vector<MapEvent> verdicts(const TogetherRun& run) const {
    std::vector<MapEvent> out;
    for (const MapEvent& event : run.map_events) {
      if (event.kind == MapEvent::Kind::kTagQuarantined ||
          event.kind == MapEvent::Kind::kTagMoved || event.kind == MapEvent::Kind::kTagDisputed)
        out.push_back(event);
    }
    return out;
  }

  /// Of a tag in the map; squared, per degree of freedom. @pre not the reference tag
  [[nodiscard]] double nees(const TagMap& map, int tag_id) const {
    Pose truth = robots_.front().tag(tag_id)->X_WT;
    if (tag_id == moved_) truth.p += kTagMovedBy;
    const KnownTag& tag = map.find(tag_id)->tag;
    return normalised(pose_error(tag.X_WT, workspace_of(robots_.front()) * truth), tag.covariance) /
           6;
  }

  std::vector<EstimationData> robots_;
  FilterChoice choice_{.filter = "world", .live = true};
  int moved_{};
};

TEST_F(MovedTagSimulation, IsNoticedWithinSecondsAndFoundAgain) {
  const Instant moved_at = time_of(robots_.front().samples.front()) + from_seconds(kTagMovedAt_s);
  std::optional<Instant> sighted;
  std::optional<Instant> noticed;
  choice_.listen = [&](std::size_t, const BodyUpdate& update, const TagMap&) {
    const bool sees = std::any_of(update.seen.tags.begin(), update.seen.tags.end(),
                                  [&](const auto& t) { return t.tag_id == moved_; });
    if (sees && !sighted && update.seen.exposed_at > moved_at) sighted = update.seen.exposed_at;
  };
  choice_.hear = [&](const MapEvent& event, Instant at) {
    if (event.kind == MapEvent::Kind::kTagQuarantined && !noticed) noticed = at;
  };
  const TogetherRun run = run_together(robots_, choice_);
  ASSERT_TRUE(sighted && noticed);
  EXPECT_LT(to_seconds(*noticed - *sighted), 5);
  const auto said = verdicts(run);
  ASSERT_EQ(said.size(), 2U);
  EXPECT_EQ(said[0].kind, MapEvent::Kind::kTagQuarantined);
  EXPECT_EQ(said[1].kind, MapEvent::Kind::kTagMoved);
  EXPECT_THAT(said[1].text, HasSubstr("was moved by 30"));
  for (const MapEvent& event : said) EXPECT_EQ(event.tag_id, moved_);
  ASSERT_NE(run.map.known->find(moved_), nullptr);
  EXPECT_LT(nees(run.map, moved_), 9);
  for (const MapTag& tag : run.map.tags) {
    if (tag.tag.tag_id == robots_.front().reference_tag) continue;
    EXPECT_LT(nees(run.map, tag.tag.tag_id), 9) << tag.tag.tag_id;
  }
}

TEST_F(MovedTagSimulation, WrongLensRemovesNoTagFromTheMap) {
  robots_[0] = simulate(setup(0));
  robots_[1] = simulate(setup(1));
  robots_[1].reference_tag = robots_[0].reference_tag;
  robots_[1].camera.model.fu *= 1.1;
  robots_[1].camera.model.fv *= 1.1;
  const TogetherRun run = run_together(robots_, choice_);
  EXPECT_TRUE(verdicts(run).empty()) << verdicts(run).front().text;
  for (const MapTag& tag : run.map.tags) EXPECT_NE(tag.state, TagState::kQuarantined);
}

}  // namespace
}  // namespace fiducap
