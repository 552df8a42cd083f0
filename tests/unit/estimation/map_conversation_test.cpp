// Data exchange of a filter and the map: which of them defines the workspace, which tags are used
// as known, and what happens when one of them moves.
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "example_room.hpp"

namespace fiducap {
namespace {

// Six tags of 60 px at 2 m with 0.3 px: a pose is good to some millimetres.
constexpr double kGood_m = 0.02;
// Past the seconds in which a filter may take its start back.
constexpr int kStartImages = 160;
const Eigen::Vector3d kMoved(0.5, 0, 0);

class MapConversation : public testing::TestWithParam<std::string> {
 protected:
  static ExampleRoom::Setup setup() {
    ExampleRoom::Setup out;
    out.filter = GetParam();
    return out;
  }
};

INSTANTIATE_TEST_SUITE_P(BothFilters, MapConversation, testing::Values("robocentric", "world"),
                         [](const auto& one) { return one.param; });

/// Shows images until the filter has defined its own workspace, and longer.
void settle(ExampleRoom& room, int images = kStartImages) {
  for (int i = 0; i < images; ++i) room.next_image({});
  ASSERT_TRUE(room.filter->running());
  ASSERT_TRUE(room.filter->estimate().anchored);
}

std::vector<KnownTag> known_of(const ExampleRoom& room) {
  std::vector<TagBelief> beliefs;
  room.filter->tag_beliefs(beliefs);
  std::vector<KnownTag> out;
  for (const TagBelief& belief : beliefs) out.push_back(belief.tag);
  return out;
}

TEST_P(MapConversation, AMovedReferenceTagDoesNotMoveTheWorkspace) {
  ExampleRoom room(setup());
  settle(room);
  const std::vector<KnownTag> map = known_of(room);  // the map has the tags of this body
  ASSERT_EQ(map.size(), 6u);
  const Pose X_WR = room.filter->estimate().X_WB * room.truth().inverse();
  const int first = std::min_element(map.begin(), map.end(), [](const auto& a, const auto& b) {
                      return a.covariance.trace() < b.covariance.trace();
                    })->tag_id;  // nothing is surer than what is so by definition
  room.tags[first].p += kMoved;
  double worst_m = 0;
  bool is_dropped = false;
  for (int i = 0; i < 100; ++i) {  // the map is slow to notice
    const UpdateReport report = room.next_image({map});
    EXPECT_FALSE(report.gauge_shift) << "image " << i;
    is_dropped = is_dropped || names(report, first);
    worst_m = std::max(worst_m, (room.filter->estimate().X_WB.p - (X_WR * room.truth()).p).norm());
  }
  EXPECT_TRUE(is_dropped);
  EXPECT_LT(worst_m, kGood_m);
  std::vector<KnownTag> without = map;
  std::erase_if(without, [&](const KnownTag& tag) { return tag.tag_id == first; });
  for (int i = 0; i < 60; ++i) {
    const UpdateReport report = room.next_image({without});
    EXPECT_FALSE(report.gauge_shift) << "image " << i;
    worst_m = std::max(worst_m, (room.filter->estimate().X_WB.p - (X_WR * room.truth()).p).norm());
  }
  EXPECT_LT(worst_m, kGood_m);
  const auto again = room.belief(first);
  ASSERT_TRUE(again) << "a tag like any other: learned anew where it stands now";
  EXPECT_LT((again->tag.X_WT.p - (X_WR * room.tags[first]).p).norm(), kGood_m);
}

TEST_P(MapConversation, AFilterWithItsOwnWorkspaceUsesTagsOfTheMap) {
  ExampleRoom room(setup());
  for (int i = 0; i < kStartImages; ++i) room.next_image({}, {0, 1, 2});
  ASSERT_TRUE(room.filter->estimate().anchored);
  const Pose X_WR = room.filter->estimate().X_WB * room.truth().inverse();
  std::vector<KnownTag> map;
  for (const int id : {3, 4, 5}) map.push_back(room.known(id, X_WR * room.tags[id], kGood_m));
  for (int i = 0; i < 40; ++i) {
    const UpdateReport report = room.next_image({map}, {3, 4, 5});
    EXPECT_EQ(report.tags_used, 3) << "image " << i;
    EXPECT_EQ(report.tags_added, 0) << "image " << i;
  }
}

/// Far from the origin of a known room: it is the prints beside the body that bend.
TEST_P(MapConversation, WithoutImuTheSigmaFollowsTheNearTagsNotTheDistanceToTheOrigin) {
  for (const double sigma_m : {0.0, 0.001}) {  // exact tags are not in the state, others are
    ExampleRoom::Setup without_imu = setup();
    without_imu.has_imu = false;
    ExampleRoom room(without_imu);
    const Pose X_WR{Eigen::Quaterniond::Identity(), {200, 0, 0}};
    std::vector<KnownTag> map;
    for (int id = 0; id < 6; ++id) map.push_back(room.known(id, X_WR * room.tags[id], sigma_m));
    for (int i = 0; i < 60; ++i) room.next_image({map});
    ASSERT_TRUE(room.filter->running());
    const BodyEstimate body = room.filter->estimate();
    EXPECT_LT((body.X_WB.p - (X_WR * room.truth()).p).norm(), kGood_m);
    const double position_sigma_m = std::sqrt(body.covariance.topLeftCorner<3, 3>().trace());
    EXPECT_GT(position_sigma_m, 0.003 * 1.4) << "two metres from a print";
    EXPECT_LT(position_sigma_m, 0.05);
  }
}

class KnownTagMoves : public testing::TestWithParam<std::tuple<std::string, double>> {};

TEST_P(KnownTagMoves, IsReportedAndEstimatedAgainWhenTheMapWithdrawsIt) {
  const auto& [filter, sigma] = GetParam();
  ExampleRoom::Setup setup;
  setup.filter = filter;
  ExampleRoom room(setup);
  std::vector<KnownTag> map = room.known_all(sigma);
  for (int i = 0; i < kStartImages; ++i) room.next_image({map});
  ASSERT_TRUE(room.filter->estimate().anchored);
  room.tags[2].p += kMoved;
  int said_after = -1;
  for (int i = 0; i < 40 && said_after < 0; ++i) {
    if (names(room.next_image({map}), 2)) said_after = i;
  }
  EXPECT_GE(said_after, 0) << "a tag that contradicts the map is told to the map";
  std::erase_if(map, [](const KnownTag& tag) { return tag.tag_id == 2; });
  for (int i = 0; i < 60; ++i) {
    const UpdateReport report = room.next_image({map});
    EXPECT_GE(report.tags_used, 5) << "image " << i;
    EXPECT_FALSE(names(report, 2)) << "image " << i;
  }
  EXPECT_LT((room.filter->estimate().X_WB.p - room.truth().p).norm(), kGood_m);
  const auto again = room.belief(2);
  ASSERT_TRUE(again);
  EXPECT_LT((again->tag.X_WT.p - room.tags[2].p).norm(), kGood_m);
}

INSTANTIATE_TEST_SUITE_P(HeldAndExact, KnownTagMoves,
                         testing::Combine(testing::Values("robocentric", "world"),
                                          testing::Values(0.0, 2e-3)),
                         [](const auto& one) {
                           return std::get<0>(one.param) +
                                  (std::get<1>(one.param) > 0 ? "Held" : "Exact");
                         });

TEST_P(MapConversation, WithoutPermissionToDefineTheWorkspaceAFilterWaitsForATagOfTheMap) {
  ExampleRoom room(setup());
  for (int i = 0; i < kStartImages; ++i) {
    room.next_image({.tags = {}, .may_define_workspace = false}, {0, 1, 2});
    const bool is_anchored = room.filter->running() && room.filter->estimate().anchored;
    EXPECT_FALSE(is_anchored) << "image " << i;
  }
  const std::vector<KnownTag> map{room.known(4, room.tags[4], 1e-3)};
  int anchored_after = -1;
  for (int i = 0; i < 40 && anchored_after < 0; ++i) {
    room.next_image({.tags = map, .may_define_workspace = false});
    if (room.filter->running() && room.filter->estimate().anchored) anchored_after = i;
  }
  ASSERT_GE(anchored_after, 0);
  EXPECT_LT((room.filter->estimate().X_WB.p - room.truth().p).norm(), 5 * kGood_m);
}

TEST_P(MapConversation, APriorDoesNotDefineASecondWorkspace) {
  ExampleRoom room(setup());
  KnownTag prior = room.known(1, room.tags[1], 1e-2);
  prior.X_WT.p += Eigen::Vector3d(7, 0, 0);  // given in its own workspace
  room.filter->set_tag_priors({prior});
  for (int i = 0; i < kStartImages; ++i) {
    room.next_image({.tags = {}, .may_define_workspace = false}, {0, 1, 2});
    const bool is_anchored = room.filter->running() && room.filter->estimate().anchored;
    ASSERT_FALSE(is_anchored) << "image " << i;
  }
  const std::vector<KnownTag> map{room.known(4, room.tags[4], 1e-3)};
  for (int i = 0; i < 40; ++i) room.next_image({.tags = map, .may_define_workspace = false});
  ASSERT_TRUE(room.filter->estimate().anchored);
  EXPECT_LT((room.filter->estimate().X_WB.p - room.truth().p).norm(), 5 * kGood_m);
}

/// A body that knows its tags since long, in axes of its own.
void wander_unanchored(ExampleRoom& room) {
  for (int i = 0; i < kStartImages; ++i)
    room.next_image({.tags = {}, .may_define_workspace = false});
  ASSERT_TRUE(room.filter->running());
  ASSERT_FALSE(room.filter->estimate().anchored);
}

TEST_P(MapConversation, ABodyWithEarlierTagsThanTheMapIsAnchoredAtOnce) {
  ExampleRoom room(setup());
  wander_unanchored(room);
  const Pose before = room.filter->estimate().X_WB;
  const Pose truth_before = room.truth();
  const std::vector<KnownTag> map{room.known(1, room.tags[1], 1e-3),
                                  room.known(4, room.tags[4], 1e-3)};
  const UpdateReport report = room.next_image({.tags = map, .may_define_workspace = false});
  ASSERT_TRUE(room.filter->estimate().anchored);
  ASSERT_TRUE(report.gauge_shift);
  EXPECT_LT(((*report.gauge_shift * before).p - truth_before.p).norm(), kGood_m)
      << "poses given out before are moved along";
  EXPECT_LT((room.filter->estimate().X_WB.p - room.truth().p).norm(), kGood_m);
  EXPECT_LT(angle_between(room.filter->estimate().X_WB.q, room.truth().q), 0.02);
  double sum = 0;
  constexpr int kImages = 100;
  for (int i = 0; i < kImages; ++i) {
    room.next_image({.tags = map, .may_define_workspace = false});
    const BodyEstimate e = room.filter->estimate();
    Eigen::Matrix<double, 6, 1> error;
    error << e.X_WB.p - room.truth().p, log_so3(e.X_WB.q * room.truth().q.conjugate());
    sum += error.dot((e.covariance.topLeftCorner<6, 6>().inverse() * error)) / 6 / kImages;
  }
  EXPECT_LT(sum, 3.0) << "NEES per degree of freedom of one run";
  for (const int id : {0, 2, 3, 5}) {
    const auto own = room.belief(id);
    ASSERT_TRUE(own);
    EXPECT_LT((own->tag.X_WT.p - room.tags[id].p).norm(), kGood_m);
  }
}

TEST_P(MapConversation, OneMisreadTagDoesNotAnchorABodyWrongly) {
  for (int wrong = 0; wrong < 4; ++wrong) {
    ExampleRoom room(setup());
    wander_unanchored(room);
    std::vector<KnownTag> map;
    for (int id = 0; id < 4; ++id) map.push_back(room.known(id, room.tags[id], 1e-3));
    map[static_cast<std::size_t>(wrong)].X_WT.p += Eigen::Vector3d(-0.6, 0.3, 0.4);
    for (int i = 0; i < 3; ++i) room.next_image({.tags = map, .may_define_workspace = false});
    ASSERT_TRUE(room.filter->estimate().anchored);
    EXPECT_LT((room.filter->estimate().X_WB.p - room.truth().p).norm(), kGood_m)
        << "wrong tag " << wrong;
  }
}

TEST_P(MapConversation, AnEarlierTagOfABodyIsGivenToTheMap) {
  ExampleRoom room(setup());
  wander_unanchored(room);
  std::vector<TagBelief> beliefs;
  room.filter->tag_beliefs(beliefs);
  ASSERT_EQ(beliefs.size(), 6u);
  for (const TagBelief& belief : beliefs) EXPECT_EQ(belief.component, TagBelief::kOwnAxes);
  for (int i = 0; i < 5; ++i) room.next_image({.tags = {}, .may_define_workspace = false});
  EXPECT_FALSE(room.filter->estimate().anchored);
  const std::vector<KnownTag> map{room.known(2, room.tags[2], 1e-3)};
  room.next_image({.tags = map, .may_define_workspace = false});
  EXPECT_TRUE(room.filter->estimate().anchored);
  room.filter->tag_beliefs(beliefs);
  ASSERT_EQ(beliefs.size(), 5u);
  for (const TagBelief& belief : beliefs) EXPECT_EQ(belief.component, TagBelief::kWorkspace);
}

/// Moves the published poses along with the workspace, as any user of poses does.
/// @return distance of the newest pose from the last one moved in this way
class Follower {
 public:
  double jump_m(const ExampleRoom& room, const UpdateReport& report) {
    if (!room.filter->running()) return 0;
    const Pose X_WB = room.filter->estimate().X_WB;
    double jump = 0;
    if (has_last_ && report.generation == generation_) {
      const Pose moved = report.gauge_shift.value_or(Pose{}) * last_;
      jump = (X_WB.p - (moved * (truth_.inverse() * room.truth())).p).norm();
    }
    last_ = X_WB;
    has_last_ = true;
    truth_ = room.truth();
    generation_ = report.generation;
    return jump;
  }

 private:
  bool has_last_{false};
  Pose last_;
  Pose truth_;
  int generation_{0};
};

TEST_P(MapConversation, TheShiftIsReportedAlsoWhenTheStartIsReplacedAtTheSameImage) {
  // The reference tag comes into view so that it joins with one of the images of 1.9 … 2.6 s.
  for (int first_image = 34; first_image < 50; ++first_image) {
    ExampleRoom::Setup setup = MapConversation::setup();
    setup.gauge.reference_tag = 5;
    ExampleRoom room(setup);
    Follower follower;
    double worst_m = 0;
    for (int i = 0; i < kStartImages; ++i) {
      const bool sees_reference = i >= first_image;
      const UpdateReport report =
          room.next_image({}, sees_reference ? std::vector<int>{} : std::vector<int>{0, 1, 2, 3});
      worst_m = std::max(worst_m, follower.jump_m(room, report));
    }
    ASSERT_TRUE(room.filter->estimate().anchored);
    // A start that is lived again corrects a pose by some centimetres; metres are another room.
    EXPECT_LT(worst_m, 0.3) << "reference tag in view from image " << first_image << " on";
  }
}

TEST_P(MapConversation, PosesFromBeforeAResetAreNotMoved) {
  ExampleRoom room(setup());
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
    if (report.generation != generation && !has_reset) {
      has_reset = true;
      EXPECT_FALSE(report.gauge_shift);
    }
  }
  EXPECT_TRUE(has_reset);
  EXPECT_TRUE(room.filter->estimate().anchored);
}

TEST_P(MapConversation, RelocalisationByASingleTagIsReported) {
  const std::vector<int> nothing{-1};
  for (const double blind_s : {0.2, 9.0, 12.0}) {  // short; without position; lost
    for (const std::vector<int>& visible : {std::vector<int>{2}, std::vector<int>{1, 2, 3}}) {
      ExampleRoom room(setup());
      settle(room);
      while (room.t_s < 0.05 * kStartImages + blind_s) room.next_image({}, nothing);
      UpdateReport back;
      for (int i = 0; i < 60 && back.tags_used == 0; ++i) {
        back = room.next_image({}, visible);
        if (back.tags_used == 0) {
          EXPECT_FALSE(back.relocalised_by_one_tag);
        }
      }
      ASSERT_GT(back.tags_used, 0);
      const bool is_lost = blind_s > 1;
      EXPECT_EQ(back.relocalised_by_one_tag, is_lost && visible.size() == 1) << blind_s;
      EXPECT_FALSE(room.next_image({}, visible).relocalised_by_one_tag);
    }
  }
}

/// Of the body's pose, per degree of freedom, in a known map.
double pose_nees(const ExampleRoom& room) {
  const BodyEstimate body = room.filter->estimate();
  Vector6d off;
  off << room.truth().p - body.X_WB.p, log_so3(room.truth().q * body.X_WB.q.conjugate());
  return off.dot(body.covariance.topLeftCorner<6, 6>().ldlt().solve(off)) / 6;
}

TEST_P(MapConversation, SigmaAfterADistantRelocalisationIsConsistent) {
  constexpr int kRuns = 20;
  double nees = 0;
  for (int run = 0; run < kRuns; ++run) {
    ExampleRoom::Setup sharp = setup();
    sharp.seed = static_cast<std::uint64_t>(run + 1);
    sharp.pixel_sigma = 0.03;
    sharp.estimator.corner_noise_px = 0.03;
    ExampleRoom room(sharp);
    const std::vector<KnownTag> map = room.known_all(1e-4);
    for (int i = 0; i < kStartImages; ++i) room.next_image({map});
    for (int i = 0; i < 60; ++i) room.next_image({map}, {-1});
    UpdateReport back;
    for (int i = 0; i < 3 && back.tags_used == 0; ++i) back = room.next_image({map}, {2});
    EXPECT_EQ(back.tags_used, 1) << run;
    nees += pose_nees(room) / kRuns;
  }
  EXPECT_LT(nees, 1.4) << "by one linear step it is 2.1";
}

}  // namespace
}  // namespace fiducap
