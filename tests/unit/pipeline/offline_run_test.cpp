#include "pipeline/replay/offline_run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "simulation/simulation.hpp"
#include "support/memory_source.hpp"
#include "support/temporary_folder.hpp"
#include "tools/command_line.hpp"
#include "tools/replay/replay_inputs.hpp"
#include "tools/replay/replay_verbs.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

RecordingInfo info() {
  RecordingInfo info;
  info.name = "table";
  info.cameras.resize(1);
  info.cameras[0].model = {752, 480, 460, 460, 376, 240, Distortion::kNone, {}};
  info.tag_size_m = 0.25;
  info.tag_sizes_m = {{3, 0.5}};
  info.ignore_tags = {9};
  info.max_hamming = 2;
  info.reference_tag = 1;
  info.known_tags = {{1, 0.25, {Eigen::Quaterniond::Identity(), {1, 2, 3}}, 1e-4, 1e-5},
                     {2, 0.25, {Eigen::Quaterniond::Identity(), {4, 5, 6}}, 0.5, 0.1}};
  return info;
}

TEST(OfflineSetup, KnownTagsAreInputsWhenTightAndPriorsWhenLoose) {
  const OfflineSetup setup = offline_setup(info());
  ASSERT_EQ(setup.known.size(), 1u);
  EXPECT_EQ(setup.known[0].tag_id, 1);
  EXPECT_DOUBLE_EQ(setup.known[0].covariance(0, 0), 1e-8);
  EXPECT_DOUBLE_EQ(setup.known[0].covariance(5, 5), 1e-10);
  ASSERT_EQ(setup.priors.size(), 1u);
  EXPECT_DOUBLE_EQ(setup.priors[0].covariance(2, 2), 0.25);
  EXPECT_EQ(setup.gauge.reference_tag, 1);
  EXPECT_EQ(setup.gauge.X_WT->p, Eigen::Vector3d(1, 2, 3));
}

TEST(ReplaySetup, KeepsTheRecordingsValuesOfKeysThatAreNotGiven) {
  const TemporaryFolder folder;
  ReplayArguments arguments;
  arguments.config = folder.file("c.yaml");
  ASSERT_TRUE(write_whole_file(arguments.config,
                               "tags: {size_m: 0.3}\nestimator: {corner_noise_px: 0.7}\n"));
  arguments.sets = {"tags.ignore=[5]"};
  const auto setup = replay_setup(arguments, info());
  ASSERT_TRUE(setup) << setup.error().text();
  EXPECT_EQ(setup->tags.size_m, 0.3);
  EXPECT_EQ(setup->tags.sizes_m.at(3), 0.5);
  EXPECT_EQ(setup->tags.ignore, std::vector{5});
  EXPECT_EQ(setup->tags.max_hamming, 2);
  EXPECT_EQ(setup->estimator.corner_noise_px, 0.7);
  EXPECT_EQ(setup->gauge.reference_tag, 1);
}

TEST(ReplaySetup, TagsOfTheMapBecomeInputs) {
  const TemporaryFolder folder;
  ReplayArguments arguments;
  arguments.map = folder.file("m.csv");
  ASSERT_TRUE(
      write_whole_file(arguments.map, "id,size,px,py,pz,qw,qx,qy,qz\n2,0.25,7,8,9,1,0,0,0\n"));
  const auto setup = replay_setup(arguments, info());
  ASSERT_TRUE(setup) << setup.error().text();
  ASSERT_EQ(setup->known.size(), 2u);
  EXPECT_EQ(setup->known[1].X_WT.p, Eigen::Vector3d(7, 8, 9));
  EXPECT_TRUE(setup->priors.empty()) << "the map goes before the recording's loose knowledge";
}

TEST(ReplaySetup, RefusesUnknownKeys) {
  ReplayArguments arguments;
  arguments.sets = {"estimator.corner_niose_px=1"};
  const auto setup = replay_setup(arguments, info());
  ASSERT_FALSE(setup);
  EXPECT_THAT(setup.error().text(), HasSubstr("corner_niose_px"));
}

class LostSource final : public SensorSource {
 public:
  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    return fail(ErrorCode::kUnavailable, "unplugged", "camera");
  }
};

TEST(OfflineRun, CountsFramesWithoutTags) {
  std::vector<SensorSample> samples;
  for (int i = 1; i <= 5; ++i)
    samples.emplace_back(CornerFrame{0, instant_from_ns(i * 50'000'000), {}});
  MemorySource source(samples);
  const auto result = run_offline(offline_setup(info()), source);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->statistics.frames, 5);
  EXPECT_EQ(result->statistics.frames_with_tags, 0);
  EXPECT_TRUE(result->trajectory.empty());
  EXPECT_DOUBLE_EQ(result->statistics.data_s, 0.2);
}

TEST(OfflineRun, ALostSourceIsAnError) {
  LostSource source;
  const auto result = run_offline(offline_setup(info()), source);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().text(), "camera: unplugged");
}

struct Output {
  int code;
  std::string out;
  std::string err;
};
Output run_program(const std::vector<std::string>& arguments) {
  std::vector<const char*> argv{"fiducap"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  std::ostringstream out;
  std::ostringstream err;
  const int code = run_command_line(static_cast<int>(argv.size()), argv.data(), {out, err});
  return {code, out.str(), err.str()};
}

// Corner noise 0.4 px at about one metre with f = 460 px: a pose error of a few millimetres. Ten
// times that would be a wrong axis, a swapped corner or a wrong time stamp somewhere on the way.
constexpr double kSound_m = 0.03;
constexpr double kSound_deg = 1.5;

TEST(Verbs, SimulateReplayAndEvaluateWorkTogetherReproducibly) {
  const TemporaryFolder folder;
  const std::string table = folder.file("table");
  const auto succeed = [](const std::vector<std::string>& arguments) {
    const Output done = run_program(arguments);
    EXPECT_EQ(done.code, 0) << done.err;
    return done.out;
  };
  succeed({"simulate", "--out", table, "--room", "table", "--seconds", "15", "--seed", "3"});
  for (const char* run : {"a", "b"}) succeed({"replay", table, "--out", folder.file(run)});
  for (const char* name : {"table.tum", "map.csv", "extrinsics.yaml"})
    EXPECT_EQ(read_whole_file(folder.file("a/") + name).value(),
              read_whole_file(folder.file("b/") + name).value())
        << name;
  const std::string out = succeed({"evaluate", folder.file("a/table.tum"), table, "--json"});
  const auto figures = nlohmann::json::parse(out);
  EXPECT_EQ(figures["against"], "truth");
  EXPECT_GT(figures["pose"]["samples"], 190);
  EXPECT_LT(figures["pose"]["position_rmse_m"], kSound_m) << out;
  EXPECT_LT(figures["pose"]["orientation_rmse_deg"], kSound_deg) << out;
  EXPECT_EQ(figures["map"]["samples"], 2);
  EXPECT_LT(figures["map"]["position_rmse_m"], kSound_m) << out;
  EXPECT_GT(figures["coverage"]["share"], 0.95) << out;

  ASSERT_TRUE(write_whole_file(folder.file("a/table.tum"), "# no pose\n"));
  const Output failed = run_program({"evaluate", folder.file("a/table.tum"), table});
  EXPECT_EQ(failed.code, 1);
  EXPECT_THAT(failed.err, HasSubstr("no pose in it belongs to an image"));
}

}  // namespace
}  // namespace fiducap
