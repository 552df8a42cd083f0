// Recordings solved as a whole: poses with their covariance against the truth.
#include <gmock/gmock.h>

#include <cmath>
#include <iostream>
#include <random>
#include <set>
#include <stdexcept>

#include "base/pose.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "simulation/filter_run.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

constexpr double kRecording_s = 25;

struct OfflineRobot {
  std::unique_ptr<simulation::SimulatedSource> source;
  OfflineSetup setup;
  std::vector<RecordedTag> tags;
  Instant start{};
};

/// Normal random numbers.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  double one() { return normal_(random_); }
  Eigen::Vector3d operator()(double sigma) { return {sigma * one(), sigma * one(), sigma * one()}; }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

enum class Corners { kOfRenderedImages, kWithWhiteNoise };

/// @param day  at which its clock begins
OfflineRobot robot(const std::string& preset, std::uint64_t seed, int day, bool has_imu,
                   Corners corners) {
  simulation::RoomConfig room;
  room.preset = preset;
  simulation::SimulatedBodyConfig body;
  CameraMount camera = forward_mount();
  camera.time_shift_sigma_s = 0;
  body.cameras = {camera};
  body.has_imu = has_imu;
  body.camera.corner_noise_px = 0.4;
  body.camera.images = corners == Corners::kOfRenderedImages;
  body.trajectory.kind = preset == "hall" ? "survey" : preset;
  body.trajectory.duration_s = kRecording_s;
  body.trajectory.seed = seed;
  body.seed = seed;
  OfflineRobot out;
  out.tags = simulation::tags_of(room);
  out.start = instant_from_ns(1'600'000'000'000'000'000 + day * 86'400'000'000'000LL);
  out.source = value_of(simulation::make_simulated_source(room, body, out.start, nullptr));
  Draw draw(seed);  // errors of the extrinsics, by their sigmas
  camera.X_BV.p += draw(camera.position_sigma_m);
  camera.X_BV.q = (camera.X_BV.q * exp_so3(draw(camera.rotation_sigma_rad))).normalized();
  out.setup.sensors.cameras = {camera};
  if (has_imu) out.setup.sensors.imu = body.imu.noise;
  out.setup.tags.size_m = out.tags.front().edge_m;
  for (const RecordedTag& tag : out.tags)
    if (tag.edge_m != out.setup.tags.size_m) out.setup.tags.sizes_m[tag.tag_id] = tag.edge_m;
  return out;
}

/// At 10 Hz, drifting as configured, in approximately level axes.
std::shared_ptr<const Odometry> odometry_of(const OfflineRobot& robot, std::uint64_t seed) {
  constexpr Duration kPeriod = std::chrono::milliseconds(100);
  Odometry out;
  Draw draw(seed);
  const double root = std::sqrt(to_seconds(kPeriod));
  Instant at = robot.start;
  // Its vertical is off as that of phones (ChainStart::up_B).
  constexpr double kUp_rad = 0.005;
  Pose X_OW;
  X_OW.q = exp_so3({kUp_rad * draw.one(), kUp_rad * draw.one(), 0});
  out.poses.push_back({at, X_OW * robot.source->truth(at).X_WB});
  for (; to_seconds(at - robot.start) < kRecording_s; at += kPeriod) {
    const Pose moved =
        robot.source->truth(at).X_WB.inverse() * robot.source->truth(at + kPeriod).X_WB;
    const Pose drift{exp_so3(draw(root * out.turn_noise_rad)), draw(root * out.move_noise_m)};
    out.poses.push_back({at + kPeriod, out.poses.back().X_WB * (moved * drift)});
  }
  return std::make_shared<const Odometry>(std::move(out));
}

/// Error of the odometry and the report expected; nullptr: none.
struct WrongOdometry {
  const char* name;
  const char* reports;
  void (*spoil)(Odometry& odometry, Instant start);
  bool is_consistent{true};  ///< Errors of poses are as their sigmas.
};

const WrongOdometry kWrongOdometry[] = {
    {"scale_3_percent", nullptr,
     [](Odometry& odometry, Instant) {
       for (StampedPose& pose : odometry.poses) pose.X_WB.p *= 1.03;
     }},
    {"stamps_50_ms", "differs from the motion",
     [](Odometry& odometry, Instant) {
       for (StampedPose& pose : odometry.poses) pose.at += std::chrono::milliseconds(50);
     }},
    {"drift_times_5", "differs from the motion",
     [](Odometry& odometry, Instant) {
       odometry.move_noise_m /= 5;
       odometry.turn_noise_rad /= 5;
     }},
    {"jump_1_m", "differs from the motion",
     [](Odometry& odometry, Instant start) {
       for (StampedPose& pose : odometry.poses)
         if (pose.at - start > std::chrono::seconds(12)) pose.X_WB.p.x() += 1;
     }},
    {"hole_5_s", nullptr,
     [](Odometry& odometry, Instant start) {
       std::erase_if(odometry.poses, [&](const StampedPose& pose) {
         return pose.at - start > std::chrono::seconds(10) &&
                pose.at - start < std::chrono::seconds(15);
       });
     }},
    {"turned_5_degrees_on_the_body", "from its configured pose",
     [](Odometry& odometry, Instant) {
       const Pose X_BB{exp_so3({0.05, 0.06, 0.04}), Eigen::Vector3d::Zero()};
       for (StampedPose& pose : odometry.poses) pose.X_WB = pose.X_WB * X_BB;
     },
     false},
    {"of_another_clock", "covers none",
     [](Odometry& odometry, Instant) {
       for (StampedPose& pose : odometry.poses) pose.at += std::chrono::hours(1);
     },
     false},
};

OfflineSession resolve(const OfflineRobot& one, bool resolve = true) {
  OfflineMap map;
  map.resolve = resolve;
  return value_of(run_together({{1, "robot", one.setup, one.source.get()}}, map));
}

/// Place and heading of all tags, as W is defined: the fit of the truth to the map.
Pose map_over_truth(const TagMap& map, const std::vector<RecordedTag>& tags) {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const RecordedTag& tag : tags)
    if (const MapTag* entry = map.find(tag.tag_id))
      points.emplace_back(tag.X_WT.p, entry->tag.X_WT.p);
  return fit_yaw_and_shift(points);
}

struct PosesScore {
  double nees{};  ///< Per degree of freedom.
  double rms_m{};
  double live_m{};  ///< Of the filter, at the same instants.
  double covered{};
};

PosesScore poses_score(const OfflineSession& session, const OfflineRobot& robot) {
  const OfflineResult& result = session.bodies.front();
  const Pose over = map_over_truth(session.map, robot.tags);
  PosesScore score;
  double squares = 0;
  double live = 0;
  std::size_t both = 0;
  for (std::size_t i = 0; i < result.trajectory.size(); ++i) {
    const StampedPose& pose = result.trajectory[i];
    const Pose truth = over * robot.source->truth(pose.at).X_WB;
    const Vector6d e = pose_error(pose.X_WB, truth);
    score.nees += normalised(e, result.covariances[i].covariance) / 6;
    for (const StampedPose& then : result.live) {
      if (then.at != pose.at) continue;
      live += (then.X_WB.p - truth.p).squaredNorm();
      squares += e.head<3>().squaredNorm();
      ++both;
    }
  }
  const auto n = static_cast<double>(result.trajectory.size());
  score.nees /= n;
  score.rms_m = std::sqrt(squares / static_cast<double>(both));
  score.live_m = std::sqrt(live / static_cast<double>(both));
  score.covered = n / result.statistics.frames;
  return score;
}

struct ResolveCase {
  const char* name;
  const char* room;
  bool has_imu;
  bool has_odometry{false};
};

class ResolveSimulation : public testing::TestWithParam<ResolveCase> {};

// Errors of all poses of a run are correlated (camera on the body, tilt of the map): a run's mean
// is that of some three numbers, and the mean of ten runs scatters by a quarter of it, 1-sigma.
constexpr double kScatter = 0.26;
constexpr double kSigmas = 2;

TEST_P(ResolveSimulation, PosesAreConsistentAndBetterThanTheFilters) {
  constexpr int kSeeds = 10;
  double nees = 0;
  double squares = 0;
  double live = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    OfflineRobot one = robot(GetParam().room, static_cast<std::uint64_t>(seed), 0,
                             GetParam().has_imu, Corners::kOfRenderedImages);
    if (GetParam().has_odometry)
      one.setup.odometry = odometry_of(one, static_cast<std::uint64_t>(seed));
    const OfflineSession session = resolve(one);
    EXPECT_TRUE(session.solved.last.is_at_rest);
    const PosesScore of_run = poses_score(session, one);
    nees += of_run.nees / kSeeds;
    squares += of_run.rms_m * of_run.rms_m / kSeeds;
    live += of_run.live_m * of_run.live_m / kSeeds;
  }
  std::cout << GetParam().name << ": NEES " << nees << ", RMS " << 1e3 * std::sqrt(squares)
            << " mm, live " << 1e3 * std::sqrt(live) << " mm\n";
  EXPECT_GT(nees, 1 - kSigmas * kScatter);
  EXPECT_LT(nees, 1 + kSigmas * kScatter);
  EXPECT_LT(squares, live);
}

INSTANTIATE_TEST_SUITE_P(OfRobots, ResolveSimulation,
                         testing::Values(ResolveCase{"table", "table", true},
                                         ResolveCase{"loop", "loop", true},
                                         ResolveCase{"no_imu", "table", false},
                                         ResolveCase{"odometry_sparse", "sparse", false, true},
                                         ResolveCase{"odometry_hall", "hall", false, true}),
                         [](const auto& one) { return std::string(one.param.name); });

class WrongOdometryTest : public testing::TestWithParam<WrongOdometry> {};

// Images decide, and the error is reported. It is also reported where the mounting of the odometry
// or that of the camera may be wrong, or where the vertical is unknown.
TEST_P(WrongOdometryTest, IsIgnoredOrReported) {
  constexpr int kSeeds = 3;
  const WrongOdometry& wrong = GetParam();
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    OfflineRobot one = robot("sparse", seed, 0, false, Corners::kOfRenderedImages);
    Odometry odometry = *odometry_of(one, seed);
    wrong.spoil(odometry, one.start);
    one.setup.odometry = std::make_shared<const Odometry>(std::move(odometry));
    const OfflineSession session = resolve(one);
    const OfflineResult& result = session.bodies.front();
    if (wrong.reports != nullptr) {
      EXPECT_THAT(result.doubts, testing::Contains(testing::HasSubstr(wrong.reports))) << seed;
    } else {
      EXPECT_THAT(result.doubts, testing::IsEmpty()) << seed;
    }
    if (!wrong.is_consistent) continue;
    nees += poses_score(session, one).nees / kSeeds;
  }
  EXPECT_LT(nees, 2.0);  // 0 of inconsistent ones
}

INSTANTIATE_TEST_SUITE_P(OfRobots, WrongOdometryTest, testing::ValuesIn(kWrongOdometry),
                         [](const auto& one) { return std::string(one.param.name); });

/// The tag that comes into view last defines W.
void define_by_latest_tag(OfflineRobot& one, OfflineRobot same) {
  std::set<int> seen;
  while (auto sample = same.source->next({}).value()) {
    const auto* image = std::get_if<CornerFrame>(&*sample);
    if (image == nullptr || to_seconds(image->exposed_at - one.start) > kRecording_s / 2) continue;
    for (const TagSighting& tag : image->tags)
      if (seen.insert(tag.tag_id).second) one.setup.gauge.reference_tag = tag.tag_id;
  }
}

/// Mean NEES of the poses before an instant, per degree of freedom.
double nees_before(Instant end, const OfflineSession& session, const OfflineRobot& robot) {
  const OfflineResult& result = session.bodies.front();
  const Pose over = map_over_truth(session.map, robot.tags);
  double sum = 0;
  std::size_t i = 0;
  for (; i < result.trajectory.size() && result.trajectory[i].at < end; ++i) {
    const StampedPose& pose = result.trajectory[i];
    const Vector6d e = pose_error(pose.X_WB, over * robot.source->truth(pose.at).X_WB);
    sum += normalised(e, result.covariances[i].covariance) / 6;
  }
  return sum / static_cast<double>(i);
}

class BeforeAnchoring : public testing::Test {
 protected:
  static OfflineRobot late_robot(std::uint64_t seed) {
    const auto same = [&] { return robot("sparse", seed, 0, true, Corners::kWithWhiteNoise); };
    OfflineRobot one = same();
    define_by_latest_tag(one, same());
    return one;
  }
  static Instant anchored_at(const OfflineResult& result) {
    for (const BodyEvent& event : result.events)
      if (event.kind == BodyEvent::Kind::kAnchored) return event.at;
    throw std::runtime_error("never anchored");
  }
  static constexpr int kRuns = 3, kFrames = 20;  // a second without the tag that defines W
};

TEST_F(BeforeAnchoring, PosesAreLeftOutAndCounted) {
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    OfflineRobot one = late_robot(seed);
    const OfflineSession session = resolve(one, false);
    const OfflineResult& result = session.bodies.front();
    ASSERT_FALSE(result.trajectory.empty());
    EXPECT_EQ(result.trajectory.front().at, anchored_at(result));
    EXPECT_GT(result.statistics.frames_before_anchoring, kFrames);
    EXPECT_EQ(result.statistics.frames_with_pose, static_cast<int>(result.trajectory.size()));
  }
}

TEST_F(BeforeAnchoring, ResolvedPosesAreConsistent) {
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    OfflineRobot one = late_robot(seed);
    const OfflineSession session = resolve(one);
    const OfflineResult& result = session.bodies.front();
    ASSERT_FALSE(result.live.empty());
    EXPECT_LT(result.trajectory.front().at, anchored_at(result));
    EXPECT_EQ(result.live.front().at, anchored_at(result));
    EXPECT_EQ(result.statistics.frames_before_anchoring, 0);
    nees += nees_before(anchored_at(result), session, one) / kRuns;
  }
  EXPECT_LT(nees, 2.0);  // a short stretch of three runs
}

/// NEES of all tags per number, without place and heading of the whole.
double nees_of(const TagMap& map, const std::vector<RecordedTag>& tags) {
  const Pose over = map_over_truth(map, tags);
  double sum = 0;
  int numbers = -4;  // place and heading
  for (const RecordedTag& tag : tags) {
    const MapTag* entry = map.find(tag.tag_id);
    if (entry == nullptr) continue;
    const Vector6d e = pose_error(entry->tag.X_WT, over * tag.X_WT);
    sum += normalised(e, entry->tag.covariance);
    numbers += 6;
  }
  return sum / numbers;
}

// With rendered images it is 0.3 to 0.5, as their corners are better than configured.
TEST(MapOfTwoRobotsOnTwoDays, IsConsistent) {
  constexpr int kSeeds = 10;
  double nees = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::vector<OfflineRobot> robots;
    std::vector<OfflineBody> bodies;
    for (int day = 0; day < 2; ++day)
      robots.push_back(robot("hall", static_cast<std::uint64_t>(100 * day + seed), day, true,
                             Corners::kWithWhiteNoise));
    for (std::size_t k = 0; k < robots.size(); ++k)
      bodies.push_back({static_cast<int>(k) + 1, "robot", robots[k].setup, robots[k].source.get()});
    OfflineMap map;
    map.resolve = true;
    const auto session = value_of(run_together(bodies, map));
    nees += nees_of(session.map, robots.front().tags) / kSeeds;
  }
  std::cout << "NEES of the map " << nees << "\n";
  EXPECT_GT(nees, 1 - kSigmas * kScatter);
  EXPECT_LT(nees, 1 + kSigmas * kScatter);
}

}  // namespace
}  // namespace fiducap
