// Without an IMU: the vertical by tags on the floor; only the images decide which of a tag's two
// poses is right, and before there is no pose.
#include "estimation/filter/heading_rule.hpp"

#include <gtest/gtest.h>

#include <array>

#include "base/pose.hpp"
#include "example_room.hpp"
#include "example_tags.hpp"

namespace fiducap {
namespace {

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / ExampleRoom::kQuarterTurn / 2;
}

const Eigen::Vector3d kUp = Eigen::Vector3d(0.3, -0.9, 0.4).normalized();

/// A tag that lies on the floor, its face tilted by the angle.
Pose lying(const Eigen::Vector3d& place,
           const Eigen::Vector3d& tilt_rad = Eigen::Vector3d::Zero()) {
  const auto q = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), kUp);
  return {q * exp_so3(tilt_rad), q * place};
}

TEST(Floor, DefinesTheVertical) {
  struct Case {
    const char* what;
    std::vector<Pose> tags;
  };
  const Case cases[] = {
      {"the normal of one tag", {lying({1, 2, 0}, {0, 0, 1.1})}},
      {"the positions of three tags",
       {lying({0, 0, 0}, {0.1, 0, 0.4}), lying({2, 0, 0}, {0.1, 0.05, -2}),
        lying({0.5, 1.5, 0}, {0.08, 0, 1})}},
      {"normals, with a tag on a table",
       {lying({0, 0, 0}), lying({2, 0, 0}), lying({0.5, 1.5, 0.8})}},
      {"normals of tags in a row", {lying({0, 0, 0}), lying({2, 0, 0}), lying({4, 0.1, 0.1})}}};
  for (const auto& [what, tags] : cases)
    EXPECT_LT(degrees_between(*up_by_floor(tags), kUp), 1e-6) << what;
}

TEST(Floor, NoTagAndOppositeNormalsDefineNothing) {
  EXPECT_FALSE(up_by_floor({}));
  EXPECT_FALSE(up_by_floor(std::array{lying({0, 0, 0}), lying({2, 0, 0}, {3.1, 0, 0})}));
}

TEST(Floor, ATagIsUprightWithItsOwnHeading) {
  const Eigen::Quaterniond q_AT = exp_so3({0.4, 1.0, -0.6});
  const Eigen::Quaterniond q_WT = upright_attitude(q_AT, kUp);
  EXPECT_LT(degrees_between(q_WT * q_AT.conjugate() * kUp, Eigen::Vector3d::UnitZ()), 1e-6);
  EXPECT_NEAR((q_WT * Eigen::Vector3d::UnitX()).y(), 0, 1e-9);
}

/// A wall of tags with three more on a board before it, without an IMU.
class FloorInARoom : public testing::Test {
 protected:
  ExampleRoom room(std::vector<int> floor_tags) {
    ExampleRoom room(
        {.gauge = {.reference_tag = {}, .X_WT = {}, .floor_tags = floor_tags}, .has_imu = false});
    for (int i = 0; i < 3; ++i)
      room.tags[10 + i] = {exp_so3({0, 0, 0.3 * i}), {-0.5 + 0.5 * i, 1.6 + 0.35 * (i % 2), 0.5}};
    return room;
  }
  static double tilt_deg(const ExampleRoom& room) {
    return degrees_between(room.X_WR().q * Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ());
  }
};

TEST_F(FloorInARoom, ConfiguredFloorTagsMakeTheWorkspaceUpright) {
  ExampleRoom upright = room({10, 11, 12});
  upright.images(200);
  ASSERT_TRUE(upright.is_anchored());
  // Three tags half a metre apart, each known to a centimetre when W is defined.
  EXPECT_LT(tilt_deg(upright), 3);

  ExampleRoom unconfigured = room({});
  unconfigured.images(200, {}, {0, 1, 2, 3, 4, 5});
  ASSERT_TRUE(unconfigured.is_anchored());
  EXPECT_GT(tilt_deg(unconfigured), 45) << "a tag on the wall is no floor";
}

TEST_F(FloorInARoom, NoPoseIsInTheWorkspaceBeforeTheFloorIsSeen) {
  ExampleRoom waiting = room({10, 11});
  waiting.images(100, {}, {0, 1, 2, 3, 4, 5, 10});
  ASSERT_TRUE(waiting.filter->running());
  EXPECT_FALSE(waiting.is_anchored());
  waiting.images(60);
  EXPECT_TRUE(waiting.is_anchored());
}

// So far away that four corners do not decide, at some 10 px of edge and 0.4 px of noise …
constexpr double kFar_m = 6.0;
constexpr double kEdge_m = 0.13;
// … and so near that they do.
constexpr double kNear_m = 0.8;
constexpr double kNoise_px = 0.3;
// The other branch is turned by twice as much; the second image alone separates no better.
constexpr double kSameBranch_rad = 0.45;
constexpr double kSigmas = 4.0;
const Eigen::Quaterniond kOblique = exp_so3({0, 0.5, 0}) * exp_so3({3.0, 0.1, 0});

/// Of the corners' noise: the same draws in every test.
std::mt19937_64 random_engine;

BodySensors rig_of(int cameras) {
  BodySensors sensors;
  for (int k = 0; k < cameras; ++k) {
    CameraMount mount;
    mount.model = example_camera();
    mount.X_BV.q = exp_so3({0, 1.5 * k, 0});
    sensors.cameras.push_back(mount);
  }
  return sensors;
}

TagObservations image_of(const BodySensors& sensors, int camera, double t_s, int tag_id,
                         const Pose& X_BT) {
  const CameraMount& mount = sensors.cameras[static_cast<std::size_t>(camera)];
  TagObservations seen;
  seen.camera = camera;
  seen.exposed_at = ExampleRoom::at(t_s);
  seen.tags.push_back(noisy_observation(tag_id, kEdge_m, mount.X_BV.inverse() * X_BT, mount.model,
                                        kNoise_px, random_engine));
  return seen;
}

/// The tag in front of the camera, on its axis.
Pose before(const BodySensors& sensors, int camera, double distance_m,
            const Eigen::Quaterniond& q_VT) {
  return sensors.cameras[static_cast<std::size_t>(camera)].X_BV *
         Pose{q_VT, {0.1, 0.05, distance_m}};
}

KnownTag known(int tag_id, const Pose& X_WT) { return {tag_id, kEdge_m, X_WT, Matrix6d::Zero()}; }

class UndecidedBranch : public testing::Test {
 protected:
  void SetUp() override { random_engine.seed(5); }
  static std::unique_ptr<BodyFilter> filter_of(const BodySensors& sensors) {
    return make_body_filter("world", sensors, {}, {});
  }
};

TEST_F(UndecidedBranch, GivesNoPoseForAnyNumberOfSightings) {
  const BodySensors sensors = rig_of(1);
  const auto filter = filter_of(sensors);
  const Pose X_BT = before(sensors, 0, kFar_m, kOblique);
  for (int i = 0; i < 200; ++i) {
    const UpdateReport report = filter->update(image_of(sensors, 0, 0.05 * i, 1, X_BT), {{}, true});
    EXPECT_EQ(report.tags_pending, 1);
    EXPECT_FALSE(filter->running()) << i;
  }
}

TEST_F(UndecidedBranch, GivesAPoseAtOnceForANearTag) {
  const BodySensors sensors = rig_of(1);
  const auto filter = filter_of(sensors);
  const Pose X_BT = before(sensors, 0, kNear_m, kOblique);
  (void)filter->update(image_of(sensors, 0, 0.0, 1, X_BT), {{}, true});
  ASSERT_TRUE(filter->running());
  const Pose X_TB = filter->estimate().X_WB;  // the tag is the workspace
  constexpr double kNearAngle_rad = 0.05;     // by one view of 75 px
  EXPECT_LT(angle_between(X_TB.q, X_BT.inverse().q), kNearAngle_rad);
}

/// A body without a pose that knows two tags.
struct Returning {
  explicit Returning(const BodySensors& rig, std::unique_ptr<BodyFilter> a_filter)
      : sensors(rig), filter(std::move(a_filter)) {
    X_WT1 = before(sensors, 0, kFar_m, kOblique);
    X_WT2 = before(sensors, 1, kFar_m, exp_so3({0.4, -0.3, 0.2}) * kOblique);
    // Anchored by a near tag; then the motion is lost.
    const Pose X_WT3 = before(sensors, 0, kNear_m, kOblique);
    const std::vector<KnownTag> near{known(3, X_WT3)};
    for (int i = 0; i < 5; ++i)
      (void)filter->update(image_of(sensors, 0, 0.05 * i, 3, X_WT3), {near, false});
    EXPECT_TRUE(filter->running());
    filter->lose_motion();
  }

  /// One image of both cameras; the body is at W.
  void look(double t_s, bool second_camera) {
    const std::vector<KnownTag> one{known(1, X_WT1)};
    const std::vector<KnownTag> two{known(2, X_WT2)};
    (void)filter->update(image_of(sensors, 0, t_s, 1, X_WT1), {one, false});
    if (second_camera) (void)filter->update(image_of(sensors, 1, t_s, 2, X_WT2), {two, false});
  }

  BodySensors sensors;
  std::unique_ptr<BodyFilter> filter;
  Pose X_WT1, X_WT2;
};

TEST_F(UndecidedBranch, OfASingleKnownTagDoesNotRelocaliseABody) {
  const BodySensors sensors = rig_of(2);
  Returning body(sensors, filter_of(sensors));
  for (int i = 0; i < 100; ++i) {
    body.look(1 + 0.05 * i, false);
    ASSERT_FALSE(body.filter->running()) << i;
  }
}

TEST_F(UndecidedBranch, IsDecidedByTheOtherCameraOfTheRig) {
  constexpr int kRuns = 40;
  constexpr int kMostImages = 25;  // of each camera: corners are noisy, some pairs do not decide
  const BodySensors sensors = rig_of(2);
  int at_once = 0;
  for (int run = 0; run < kRuns; ++run) {
    SCOPED_TRACE(run);
    Returning body(sensors, filter_of(sensors));
    int images = 0;
    while (!body.filter->running() && images < kMostImages) body.look(1 + 0.05 * images++, true);
    ASSERT_TRUE(body.filter->running());
    at_once += images == 1 ? 1 : 0;
    const BodyEstimate now = body.filter->estimate();
    EXPECT_LT(angle_between(now.X_WB.q, Eigen::Quaterniond::Identity()), kSameBranch_rad);
    const double sigma_m = std::sqrt(now.covariance.topLeftCorner<3, 3>().trace());
    EXPECT_LT(now.X_WB.p.norm(), kSigmas * sigma_m);
  }
  EXPECT_GT(at_once, 0) << "one image of each may be enough";
}

}  // namespace
}  // namespace fiducap
