// Data exchange of a filter and the map: which of them defines the workspace, which tags are used
// as known, and what happens when one of them moves.
#include <gtest/gtest.h>

#include "base/pose.hpp"
#include "estimation/world/workspace_axes.hpp"
#include "example_room.hpp"

namespace fiducap {
namespace {

// Six tags of 60 px at 2 m with 0.3 px: a pose is good to some millimetres.
constexpr double kGood_m = 0.02;
// Past the seconds in which a filter may take its start back.
constexpr int kStartImages = 160;
const Eigen::Vector3d kMoved(0.5, 0, 0);

/// Shows images until the filter has defined its own workspace, and longer.
void settle(ExampleRoom& room) {
  room.images(kStartImages);
  ASSERT_TRUE(room.is_anchored());
}

/// The map's knowledge, for a body that may not define the workspace.
MapKnowledge waiting(std::span<const KnownTag> map) {
  return {.tags = map, .may_define_workspace = false};
}

std::vector<KnownTag> known_of(const ExampleRoom& room) {
  std::vector<KnownTag> out;
  for (const TagBelief& belief : room.beliefs()) out.push_back(belief.tag);
  return out;
}

TEST(MapConversation, AMovedReferenceTagDoesNotMoveTheWorkspace) {
  ExampleRoom room(ExampleRoom::Setup{});
  settle(room);
  std::vector<KnownTag> map = known_of(room);  // the map has the tags of this body
  ASSERT_EQ(map.size(), 6u);
  const Pose X_WR = room.X_WR();
  // The reference tag is certain by definition.
  const int first = std::ranges::min_element(map, {}, [](const KnownTag& tag) {
                      return tag.covariance.trace();
                    })->tag_id;
  room.tags[first].p += kMoved;
  bool is_dropped = false;
  for (int i = 0; i < 160; ++i) {
    if (i == 100) erase_tag(map, first);  // the map notices late
    const UpdateReport report = room.next_image({map});
    EXPECT_FALSE(report.gauge_shift) << "image " << i;
    is_dropped = is_dropped || (i < 100 && names(report, first));
    EXPECT_LT(room.error_m(X_WR), kGood_m) << "image " << i;
  }
  EXPECT_TRUE(is_dropped);
  room.expect_belief(first, kGood_m, X_WR);  // estimated again like any other tag
}

// A map of the body's own data is an older estimate of the same tags.
TEST(MapConversation, ABodyThatAloneHasMadeTheMapKeepsItsTags) {
  ExampleRoom room(ExampleRoom::Setup{});
  settle(room);
  KnownMap whole;
  whole.uncorrelated = known_of(room);
  for (KnownTag& tag : whole.uncorrelated) tag.X_WT.p.z() += kGood_m;
  whole.revision = 1;
  whole.made_by = 1;
  const MapKnowledge map{whole.uncorrelated, false, &whole, 1};
  UpdateReport report = room.next_image(map);
  EXPECT_FALSE(report.map_shift);
  EXPECT_EQ(report.named_fitting().size(), 6u) << "the map is reported to be right";
  EXPECT_EQ(room.beliefs().size(), 6u);
  whole.made_by.reset();  // another body has contributed
  report = room.next_image(map);
  ASSERT_TRUE(report.map_shift);
  EXPECT_NEAR(report.map_shift->p.z(), kGood_m, 0.2 * kGood_m);
  EXPECT_TRUE(room.beliefs().empty()) << "the tags are held";
}

TEST(MapConversation, AFilterWithItsOwnWorkspaceUsesTagsOfTheMap) {
  ExampleRoom room(ExampleRoom::Setup{});
  room.images(kStartImages, {}, {0, 1, 2});
  ASSERT_TRUE(room.is_anchored());
  const Pose X_WR = room.X_WR();
  std::vector<KnownTag> map;
  for (const int id : {3, 4, 5}) map.push_back(room.known(id, X_WR * room.tags[id], kGood_m));
  for (int i = 0; i < 40; ++i) {
    const UpdateReport report = room.next_image({map}, {3, 4, 5});
    EXPECT_EQ(report.tags_used, 3) << "image " << i;
    EXPECT_EQ(report.tags_added, 0) << "image " << i;
  }
}

// Far from the origin of a known room the bend of the nearest prints counts.
TEST(MapConversation, WithoutImuTheSigmaIsOfTheTagsNotOfTheOrigin) {
  for (const double sigma_m : {0.0, 0.001}) {  // exact tags are not in the state, others are
    ExampleRoom::Setup without_imu;
    without_imu.has_imu = false;
    ExampleRoom room(without_imu);
    const Pose X_WR{Eigen::Quaterniond::Identity(), {200, 0, 0}};
    std::vector<KnownTag> map;
    for (int id = 0; id < 6; ++id) map.push_back(room.known(id, X_WR * room.tags[id], sigma_m));
    room.images(60, {map});
    ASSERT_TRUE(room.filter->running());
    EXPECT_LT(room.error_m(X_WR), kGood_m);
    EXPECT_GT(room.sigma_m(), 0.003 * 1.4) << "two metres from a print";
    EXPECT_LT(room.sigma_m(), 0.05);
  }
}

TEST(PrintBend, TurnsTheBodyAboutThePrint) {
  const Matrix6d P = bend_of_print({4, 0, 0});
  EXPECT_NEAR(P(0, 0), 0, 1e-15) << "along the line to the print";
  EXPECT_NEAR(std::sqrt(P(1, 1)), 4 * 0.003, 1e-12);
  EXPECT_NEAR(std::sqrt(P(5, 5)), 0.003, 1e-12);
  // A turn to the left (about z) moves a body that is ahead (along x) to the left (along y).
  EXPECT_NEAR(P(1, 5), 4 * 0.003 * 0.003, 1e-12);
}

class KnownTagMoves : public testing::TestWithParam<double> {};

TEST_P(KnownTagMoves, IsReportedAndEstimatedAgainOnceTheMapHasItNoMore) {
  ExampleRoom room(ExampleRoom::Setup{});
  std::vector<KnownTag> map = room.known_all(GetParam());
  room.images(kStartImages, {map});
  ASSERT_TRUE(room.is_anchored());
  room.tags[2].p += kMoved;
  bool is_reported = false;
  for (int i = 0; i < 40 && !is_reported; ++i) is_reported = names(room.next_image({map}), 2);
  EXPECT_TRUE(is_reported);
  erase_tag(map, 2);
  for (int i = 0; i < 60; ++i) {
    const UpdateReport report = room.next_image({map});
    EXPECT_GE(report.tags_used, 5) << "image " << i;
    EXPECT_FALSE(names(report, 2)) << "image " << i;
  }
  EXPECT_LT(room.error_m(), kGood_m);
  room.expect_belief(2, kGood_m);
}

INSTANTIATE_TEST_SUITE_P(HeldAndExact, KnownTagMoves, testing::Values(0.0, 2e-3),
                         [](const auto& one) { return one.param > 0 ? "Held" : "Exact"; });

TEST(MapConversation, AFilterThatMayNotDefineTheWorkspaceWaitsForTheMap) {
  for (const bool has_prior : {false, true}) {
    SCOPED_TRACE(has_prior);
    ExampleRoom room(ExampleRoom::Setup{});
    KnownTag prior = room.known(1, 1e-2);
    prior.X_WT.p += Eigen::Vector3d(7, 0, 0);  // given in its own workspace
    if (has_prior) room.filter->set_tag_priors({prior});
    for (int i = 0; i < kStartImages; ++i) {
      room.next_image(waiting({}), {0, 1, 2});
      ASSERT_FALSE(room.is_anchored()) << "image " << i;
    }
    const std::vector<KnownTag> map{room.known(4, 1e-3)};
    for (int i = 0; i < 40 && (has_prior || !room.is_anchored()); ++i)
      room.next_image(waiting(map));
    ASSERT_TRUE(room.is_anchored());
    EXPECT_LT(room.error_m(), 5 * kGood_m);
  }
}

/// The body knows its tags for long, in axes of its own.
void wander_unanchored(ExampleRoom& room) {
  room.images(kStartImages, waiting({}));
  ASSERT_TRUE(room.filter->running());
  ASSERT_FALSE(room.is_anchored());
}

TEST(MapConversation, ABodyWithTagsOfItsOwnIsAnchoredByTwoOfTheMap) {
  ExampleRoom room(ExampleRoom::Setup{});
  wander_unanchored(room);
  const Pose before = room.filter->estimate().X_WB;
  const Pose truth_before = room.truth();
  const std::vector<KnownTag> map{room.known(1, 1e-3), room.known(4, 1e-3)};
  const UpdateReport report = room.next_image(waiting(map));
  ASSERT_TRUE(room.is_anchored());
  ASSERT_TRUE(report.gauge_shift);
  EXPECT_LT(((*report.gauge_shift * before).p - truth_before.p).norm(), kGood_m)
      << "earlier poses move along";
  EXPECT_LT(room.error_m(), kGood_m);
  EXPECT_LT(angle_between(room.filter->estimate().X_WB.q, room.truth().q), 0.02);
  double nees = 0;
  constexpr int kImages = 100;
  for (int i = 0; i < kImages; ++i) {
    room.next_image(waiting(map));
    nees += room.pose_nees() / kImages;
  }
  EXPECT_LT(nees, 3.0) << "of one run";
  for (const int id : {0, 2, 3, 5}) room.expect_belief(id, kGood_m);
}

TEST(MapConversation, OneMisreadTagDoesNotAnchorABodyWrongly) {
  for (std::size_t wrong = 0; wrong < 4; ++wrong) {
    ExampleRoom room(ExampleRoom::Setup{});
    wander_unanchored(room);
    std::vector<KnownTag> map;
    for (int id = 0; id < 4; ++id) map.push_back(room.known(id, 1e-3));
    map[wrong].X_WT.p += Eigen::Vector3d(-0.6, 0.3, 0.4);
    room.images(3, waiting(map));
    ASSERT_TRUE(room.is_anchored());
    EXPECT_LT(room.error_m(), kGood_m) << "wrong tag " << wrong;
  }
}

TEST(MapConversation, TagsOfABodyAreGivenToTheMap) {
  ExampleRoom room(ExampleRoom::Setup{});
  wander_unanchored(room);
  const auto components = [&] {
    std::vector<int> out;
    for (const TagBelief& belief : room.beliefs()) out.push_back(belief.component);
    return out;
  };
  EXPECT_EQ(components(), std::vector<int>(6, TagBelief::kOwnAxes));
  room.images(5, waiting({}));
  EXPECT_FALSE(room.is_anchored());
  const std::vector<KnownTag> map{room.known(2, 1e-3)};
  room.next_image(waiting(map));
  EXPECT_TRUE(room.is_anchored());
  EXPECT_EQ(components(), std::vector<int>(5, TagBelief::kWorkspace));
}

/// Moves the published poses along with the workspace, as any user of poses does.
class Follower {
 public:
  /// @return distance of the newest pose from the last one moved in this way
  double jump_m(const ExampleRoom& room, const UpdateReport& report) {
    if (!room.filter->running()) return 0;
    const Pose X_WR = room.X_WR();
    double jump = 0;
    if (X_WR_ && report.generation == generation_)
      jump = room.error_m(report.gauge_shift.value_or(Pose{}) * *X_WR_);
    X_WR_ = X_WR;
    generation_ = report.generation;
    return jump;
  }

 private:
  std::optional<Pose> X_WR_;  ///< At the last image.
  int generation_{0};
};

TEST(MapConversation, AShiftIsReportedAlsoWhenTheStartIsReplacedThen) {
  // The reference tag comes into view so that it joins with one of the images of 1.9 … 2.6 s.
  for (int first_image = 34; first_image < 50; ++first_image) {
    ExampleRoom::Setup setup;
    setup.gauge.reference_tag = 5;
    ExampleRoom room(setup);
    Follower follower;
    double worst_m = 0;
    for (int i = 0; i < kStartImages; ++i) {
      const UpdateReport report =
          room.next_image({}, i >= first_image ? std::vector<int>{} : std::vector<int>{0, 1, 2, 3});
      worst_m = std::max(worst_m, follower.jump_m(room, report));
    }
    ASSERT_TRUE(room.is_anchored());
    // A replaced start corrects a pose by some centimetres; metres are another workspace.
    EXPECT_LT(worst_m, 0.3) << "reference tag in view from image " << first_image << " on";
  }
}

TEST(MapConversation, AResetDoesNotReportAShift) {
  ExampleRoom room(ExampleRoom::Setup{});
  settle(room);
  const int generation = room.next_image({}).generation;
  // All tags are at other places: no known tag fits any more.
  double index = 0;
  for (auto& [id, X_RT] : room.tags) {
    X_RT.p += Eigen::Vector3d(0.3 * std::cos(2.0 * index), 0.2, 0.3 * std::sin(3.0 * index));
    index += 1.0;
  }
  bool has_reset = false;
  for (int i = 0; i < 400; ++i) {
    const UpdateReport report = room.next_image({});
    if (report.generation == generation || has_reset) continue;
    has_reset = true;
    EXPECT_FALSE(report.gauge_shift);
  }
  EXPECT_TRUE(has_reset);
  EXPECT_TRUE(room.is_anchored());
}

TEST(MapConversation, RelocalisationByASingleTagIsReported) {
  for (const double blind_s : {0.2, 9.0, 12.0}) {  // short; without position; lost
    for (const std::vector<int>& visible : {std::vector<int>{2}, std::vector<int>{1, 2, 3}}) {
      ExampleRoom room(ExampleRoom::Setup{});
      settle(room);
      while (room.t_s < 0.05 * kStartImages + blind_s) room.next_image({}, {-1});
      UpdateReport back;
      for (int i = 0; i < 60 && back.tags_used == 0; ++i) {
        back = room.next_image({}, visible);
        if (back.tags_used == 0) {
          EXPECT_FALSE(back.relocalised_by_one_tag);
        }
      }
      ASSERT_GT(back.tags_used, 0);
      EXPECT_EQ(back.relocalised_by_one_tag, blind_s > 1 && visible.size() == 1) << blind_s;
      EXPECT_FALSE(room.next_image({}, visible).relocalised_by_one_tag);
    }
  }
}

TEST(MapConversation, SigmaAfterADistantRelocalisationIsConsistent) {
  constexpr int kRuns = 20;
  double nees = 0;
  for (int run = 0; run < kRuns; ++run) {
    ExampleRoom::Setup sharp;
    sharp.seed = static_cast<std::uint64_t>(run + 1);
    sharp.pixel_sigma = sharp.estimator.corner_noise_px = 0.03;
    ExampleRoom room(sharp);
    const std::vector<KnownTag> map = room.known_all(1e-4);
    room.images(kStartImages, {map});
    room.images(60, {map}, {-1});
    UpdateReport back;
    for (int i = 0; i < 3 && back.tags_used == 0; ++i) back = room.next_image({map}, {2});
    EXPECT_EQ(back.tags_used, 1) << run;
    nees += room.pose_nees() / kRuns;
  }
  EXPECT_LT(nees, 1.4) << "by one linear step it is 2.1";
}

/// A body whose only visible tag, number 2, is moved after the start.
struct MovedTag {
  MovedTag() {
    settle(room);
    move(kMoved);
  }
  void move(const Eigen::Vector3d& by) { room.tags[2].p += by; }
  UpdateReport images(int count) { return room.images(count, {}, {2}); }
  ExampleRoom room{{}};
};

TEST(MovedTagAlone, IncreasesTheSigmaByItsOffset) {
  MovedTag body;
  const UpdateReport report = body.images(15);
  ASSERT_TRUE(report.ambiguous_place);
  EXPECT_EQ(report.ambiguous_place->tag_id, 2);
  EXPECT_NEAR(report.ambiguous_place->by_m, kMoved.norm(), 0.1 * kMoved.norm());
  EXPECT_GT(body.room.sigma_m(), kMoved.norm() / 4) << "4 sigma of the mixture";
  EXPECT_TRUE(body.images(30).ambiguous_place) << "dropped meanwhile";
  EXPECT_FALSE(body.room.next_image({}, {2, 3}).ambiguous_place) << "another tag decides";
  const Eigen::Vector3d variance = body.room.filter->estimate().covariance.diagonal().head<3>();
  EXPECT_LT(variance.cwiseSqrt().sum(), 3 * kGood_m);
}

TEST(MovedTagAlone, IsAcceptedAlthoughOneImageDidNotFit) {
  MovedTag body;
  EXPECT_TRUE(body.images(500).ambiguous_place);
  body.move(kMoved);
  EXPECT_EQ(body.images(1).tags_used, 0) << "rejected";
  body.move(-kMoved);
  EXPECT_FALSE(body.images(300).ambiguous_place);
}

}  // namespace
}  // namespace fiducap
