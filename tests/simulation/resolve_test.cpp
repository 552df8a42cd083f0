// Recordings that are solved for as a whole: poses with their covariance against the truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>
#include <set>
#include <stdexcept>

#include "base/pose.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {
namespace {

constexpr double kSeconds = 25;

struct Robot {
  std::unique_ptr<simulation::SimulatedSource> source;
  OfflineSetup setup;
  std::vector<RecordedTag> tags;
  Instant start{};
};

enum class Corners {
  kOfRenderedImages,
  kWithWhiteNoise  ///< As the filters think of them, but for what lasts.
};

/// @param day  its clock begins there
Robot robot(const std::string& preset, std::uint64_t seed, int day, bool has_imu, Corners corners) {
  simulation::RoomConfig room;
  room.preset = preset;
  simulation::SimulatedBodyConfig body;
  CameraMount camera;
  camera.model = {752, 480, 460, 460, 376, 240, Distortion::kNone, {}};
  camera.X_BV = simulation::forward_camera();
  camera.time_shift_sigma_s = 0;
  body.cameras = {camera};
  body.has_imu = has_imu;
  body.camera.corner_noise_px = 0.4;
  body.camera.images = corners == Corners::kOfRenderedImages;
  body.trajectory.kind = preset == "hall" ? "survey" : preset;
  body.trajectory.duration_s = kSeconds;
  body.trajectory.seed = seed;
  body.seed = seed;
  Robot out;
  out.tags = simulation::tags_of(room);
  out.start = instant_from_ns(1'600'000'000'000'000'000 + day * 86'400'000'000'000LL);
  auto source = simulation::make_simulated_source(room, body, out.start, nullptr);
  if (!source) throw std::runtime_error(source.error().text());
  out.source = std::move(*source);
  // Extrinsics are off as far as they say.
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto draw = [&](double sigma) -> Eigen::Vector3d {
    return {sigma * normal(random), sigma * normal(random), sigma * normal(random)};
  };
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
std::shared_ptr<const Odometry> odometry_of(const Robot& robot, std::uint64_t seed) {
  constexpr Duration kPeriod = std::chrono::milliseconds(100);
  Odometry out;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto draw = [&](double sigma) -> Eigen::Vector3d {
    return {sigma * normal(random), sigma * normal(random), sigma * normal(random)};
  };
  const double root = std::sqrt(to_seconds(kPeriod));
  Instant at = robot.start;
  // What it takes for up is off by what phones are off (ChainStart::up_B).
  constexpr double kUp_rad = 0.005;
  Pose X_OW;
  X_OW.q = exp_so3({kUp_rad * normal(random), kUp_rad * normal(random), 0});
  out.poses.push_back({at, X_OW * robot.source->truth(at).X_WB});
  for (; to_seconds(at - robot.start) < kSeconds; at += kPeriod) {
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
  const char* says;
  void (*spoil)(Odometry& odometry, Instant start);
  bool is_honest{true};  ///< Poses are as far off as they say.
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
    {"turned_5_degrees_on_the_body", "camera 0 sits",
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

/// Place and heading of all tags, as W is defined: what brings the truth over the map.
Pose map_over_truth(const TagMap& map, const std::vector<RecordedTag>& tags) {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const RecordedTag& tag : tags)
    if (const MapTag* entry = map.find(tag.tag_id))
      points.emplace_back(tag.X_WT.p, entry->tag.X_WT.p);
  return fit_yaw_and_shift(points);
}

Vector6d error_of(const Pose& X, const Pose& truth) {
  Vector6d e;
  e << X.p - truth.p, log_so3(X.q * truth.q.conjugate());
  return e;
}

struct Score {
  double nees{};  ///< Per degree of freedom.
  double rms_m{};
  double live_m{};  ///< Of the filter, at the same instants.
  double covered{};
};

Score score(const OfflineSession& session, const Robot& robot) {
  const OfflineResult& result = session.bodies.front();
  const Pose over = map_over_truth(session.map, robot.tags);
  Score score;
  double squares = 0;
  double live = 0;
  std::size_t both = 0;
  for (std::size_t i = 0; i < result.trajectory.size(); ++i) {
    const StampedPose& pose = result.trajectory[i];
    const Pose truth = over * robot.source->truth(pose.at).X_WB;
    const Vector6d e = error_of(pose.X_WB, truth);
    score.nees += e.dot(result.covariances[i].covariance.ldlt().solve(e)) / 6;
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

struct Case {
  const char* name;
  const char* room;
  bool has_imu;
  bool has_odometry{false};
};

class ResolveSimulation : public testing::TestWithParam<Case> {};

// Errors of all poses of a run hang together (camera on the body, tilt of the map): a run's mean is
// that of some three numbers, and the mean of ten runs scatters by a quarter of it, 1-sigma.
constexpr double kScatter = 0.26;
constexpr double kSigmas = 2;

TEST_P(ResolveSimulation, PosesAreAsFarOffAsTheySayAndNearerThanTheFilters) {
  constexpr int kSeeds = 10;
  double nees = 0;
  double squares = 0;
  double live = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    Robot one = robot(GetParam().room, static_cast<std::uint64_t>(seed), 0, GetParam().has_imu,
                      Corners::kOfRenderedImages);
    if (GetParam().has_odometry)
      one.setup.odometry = odometry_of(one, static_cast<std::uint64_t>(seed));
    OfflineMap map;
    map.resolve = true;
    map.config.refine_period_s = GetParam().has_imu ? 2 : 0;
    const auto session = run_together({{1, "robot", one.setup, one.source.get()}}, map);
    ASSERT_TRUE(session) << session.error().text();
    EXPECT_TRUE(session->is_at_rest);
    const Score of_run = score(*session, one);
    std::cout << GetParam().name << " seed " << seed << ": NEES " << of_run.nees << ", RMS "
              << 1e3 * of_run.rms_m << " mm, live " << 1e3 * of_run.live_m << " mm, covered "
              << of_run.covered << "\n";
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
                         testing::Values(Case{"table", "table", true}, Case{"loop", "loop", true},
                                         Case{"no_imu", "table", false},
                                         Case{"odometry_sparse", "sparse", false, true},
                                         Case{"odometry_hall", "hall", false, true}),
                         [](const auto& one) { return std::string(one.param.name); });

class OdometryThatIsWrong : public testing::TestWithParam<WrongOdometry> {};

// Images decide, and it is reported. It is also reported where either of two may be wrong (mounting
// of the odometry or of the camera) or where the vertical is unknown.
TEST_P(OdometryThatIsWrong, IsNotBelievedOrIsToldOf) {
  constexpr int kSeeds = 3;
  const WrongOdometry& wrong = GetParam();
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Robot one = robot("sparse", seed, 0, false, Corners::kOfRenderedImages);
    Odometry odometry = *odometry_of(one, seed);
    wrong.spoil(odometry, one.start);
    one.setup.odometry = std::make_shared<const Odometry>(std::move(odometry));
    OfflineMap map;
    map.resolve = true;
    map.config.refine_period_s = 0;
    const auto session = run_together({{1, "robot", one.setup, one.source.get()}}, map);
    ASSERT_TRUE(session) << session.error().text();
    const OfflineResult& result = session->bodies.front();
    if (wrong.says != nullptr) {
      EXPECT_THAT(result.doubts, testing::Contains(testing::HasSubstr(wrong.says))) << seed;
    } else {
      EXPECT_THAT(result.doubts, testing::IsEmpty()) << seed;
    }
    if (!wrong.is_honest) continue;
    const Score of_run = score(*session, one);
    std::cout << wrong.name << " seed " << seed << ": NEES " << of_run.nees << ", RMS "
              << 1e3 * of_run.rms_m << " mm\n";
    nees += of_run.nees / kSeeds;
  }
  EXPECT_LT(nees, 2.0);  // of those that are not honest nothing was added
}

INSTANTIATE_TEST_SUITE_P(OfRobots, OdometryThatIsWrong, testing::ValuesIn(kWrongOdometry),
                         [](const auto& one) { return std::string(one.param.name); });

/// The tag that comes into view last becomes the one that defines W.
void define_by_latest_tag(Robot& one, Robot same) {
  std::set<int> seen;
  while (auto sample = same.source->next({}).value()) {
    const auto* image = std::get_if<CornerFrame>(&*sample);
    if (image == nullptr || to_seconds(image->exposed_at - one.start) > kSeconds / 2) continue;
    for (const TagSighting& tag : image->tags)
      if (seen.insert(tag.tag_id).second) one.setup.gauge.reference_tag = tag.tag_id;
  }
}

/// Mean NEES of the poses before an instant, per degree of freedom.
double nees_before(Instant end, const OfflineSession& session, const Robot& robot) {
  const OfflineResult& result = session.bodies.front();
  const Pose over = map_over_truth(session.map, robot.tags);
  double sum = 0;
  std::size_t i = 0;
  for (; i < result.trajectory.size() && result.trajectory[i].at < end; ++i) {
    const StampedPose& pose = result.trajectory[i];
    const Vector6d e = error_of(pose.X_WB, over * robot.source->truth(pose.at).X_WB);
    sum += e.dot(result.covariances[i].covariance.ldlt().solve(e)) / 6;
  }
  return sum / static_cast<double>(i);
}

class BeforeAnchoring : public testing::Test {
 protected:
  static Robot late_robot(std::uint64_t seed) {
    const auto same = [&] { return robot("sparse", seed, 0, true, Corners::kWithWhiteNoise); };
    Robot one = same();
    define_by_latest_tag(one, same());
    return one;
  }
  static OfflineSession run(Robot& one, bool resolve) {
    OfflineMap map;
    map.resolve = resolve;
    map.config.refine_period_s = resolve ? 2 : 0;
    auto session = run_together({{1, "robot", one.setup, one.source.get()}}, map);
    if (!session) throw std::runtime_error(session.error().text());
    return std::move(*session);
  }
  static Instant anchored_at(const OfflineResult& result) {
    for (const BodyEvent& event : result.events)
      if (event.kind == BodyEvent::Kind::kAnchored) return event.at;
    throw std::runtime_error("never anchored");
  }
  static constexpr int kSeeds = 3, kImages = 20;  // a second without the tag that defines W
};

TEST_F(BeforeAnchoring, PosesAreLeftOutAndCounted) {
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Robot one = late_robot(seed);
    const OfflineSession session = run(one, false);
    const OfflineResult& result = session.bodies.front();
    ASSERT_FALSE(result.trajectory.empty());
    EXPECT_EQ(result.trajectory.front().at, anchored_at(result));
    EXPECT_GT(result.statistics.frames_before_anchoring, kImages);
    EXPECT_EQ(result.statistics.frames_with_pose, static_cast<int>(result.trajectory.size()));
  }
}

TEST_F(BeforeAnchoring, PosesThatAreSolvedForAreAsFarOffAsTheySay) {
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Robot one = late_robot(seed);
    const OfflineSession session = run(one, true);
    const OfflineResult& result = session.bodies.front();
    ASSERT_FALSE(result.live.empty());
    EXPECT_LT(result.trajectory.front().at, anchored_at(result));
    EXPECT_EQ(result.live.front().at, anchored_at(result));
    EXPECT_EQ(result.statistics.frames_before_anchoring, 0);
    nees += nees_before(anchored_at(result), session, one) / kSeeds;
  }
  EXPECT_LT(nees, 2.0);  // a short stretch of three runs
}

/// NEES per number of what all tags are off, place and heading of the whole taken out.
double nees_of(const TagMap& map, const std::vector<RecordedTag>& tags) {
  const Pose over = map_over_truth(map, tags);
  double sum = 0;
  int numbers = -4;  // that are taken out
  for (const RecordedTag& tag : tags) {
    const MapTag* entry = map.find(tag.tag_id);
    if (entry == nullptr) continue;
    const Vector6d e = error_of(entry->tag.X_WT, over * tag.X_WT);
    sum += e.dot(entry->tag.covariance.ldlt().solve(e));
    numbers += 6;
  }
  return sum / numbers;
}

// Corners of rendered images are better than configured, as some of their errors may persist while
// a tag is in view: there it is 0.3 to 0.5.
TEST(MapOfTwoRobotsOnTwoDays, IsAsFarOffAsItSays) {
  constexpr int kSeeds = 10;
  double nees = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::vector<Robot> robots;
    std::vector<OfflineBody> bodies;
    for (int day = 0; day < 2; ++day)
      robots.push_back(robot("hall", static_cast<std::uint64_t>(100 * day + seed), day, true,
                             Corners::kWithWhiteNoise));
    for (std::size_t k = 0; k < robots.size(); ++k)
      bodies.push_back({static_cast<int>(k) + 1, "robot", robots[k].setup, robots[k].source.get()});
    OfflineMap map;
    map.resolve = true;
    map.config.refine_period_s = 2;
    const auto session = run_together(bodies, map);
    ASSERT_TRUE(session) << session.error().text();
    const double of_run = nees_of(session->map, robots.front().tags);
    std::cout << "seed " << seed << ": NEES of the map " << of_run << "\n";
    nees += of_run / kSeeds;
  }
  std::cout << "NEES of the map " << nees << "\n";
  EXPECT_GT(nees, 1 - kSigmas * kScatter);
  EXPECT_LT(nees, 1 + kSigmas * kScatter);
}

}  // namespace
}  // namespace fiducap
