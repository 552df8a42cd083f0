#include "daemon/config/config_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "capture/imu_sample.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;
using testing::UnorderedElementsAre;

constexpr const char* kOneCamera = R"(
tags: {family: tag36h11, size_m: 0.2, sizes_m: {7: 0.4}, ignore: [13]}
bodies:
  - name: robot
    source: {type: camera, open: clip.mp4}
    cameras:
      - model: {width: 640, height: 480, fu: 500, fv: 500, cu: 319.5, cv: 239.5}
        X_BV: {p: [0.1, 0, 0], q_wxyz: [0.5, -0.5, 0.5, -0.5]}
        time_shift_s: -0.0025
streaming: {rate_hz: 250, vrpn: {up: "y"}}
)";

std::vector<std::string> faults_of(const std::string& text,
                                   const std::vector<std::string>& sets = {}) {
  const auto config = parse_config(text, "test.yaml", sets);
  std::vector<std::string> lines;
  if (!config) {
    for (const auto& fault : config.error()) lines.push_back(fault.text());
  }
  return lines;
}

TEST(ConfigFile, GravityIsToldOnce) {
  EXPECT_THAT(faults_of("site: {gravity_m_s2: 9.78, latitude_deg: 0}"),
              ElementsAre(HasSubstr("remove one of them")));
  EXPECT_THAT(faults_of("site: {height_m: 2240}"), ElementsAre(HasSubstr("needs latitude_deg")));
  EXPECT_THAT(faults_of("site: {gravity_m_s2: 1}"), ElementsAre(HasSubstr("site.gravity_m_s2")));
}

TEST(ConfigFile, ReadsWhatItSays) {
  const auto config = parse_config(kOneCamera, "test.yaml");
  ASSERT_TRUE(config) << config.error().front().text();
  EXPECT_EQ(config->tags.size_m, 0.2);
  EXPECT_EQ(config->tags.edge_of(7), 0.4);
  EXPECT_THAT(config->tags.ignore, ElementsAre(13));
  ASSERT_EQ(config->bodies.size(), 1u);
  const BodyConfig& body = config->bodies[0];
  EXPECT_EQ(body.name, "robot");
  EXPECT_EQ(body.id, 1);
  EXPECT_EQ(body.source.type, SourceType::kCamera);
  ASSERT_EQ(body.cameras.size(), 1u);
  EXPECT_EQ(body.cameras[0].mount.model.fu, 500);
  EXPECT_EQ(body.cameras[0].mount.X_BV.q.x(), -0.5);
  EXPECT_EQ(body.cameras[0].mount.time_shift, std::chrono::microseconds(-2500));
  EXPECT_EQ(config->streaming.rate_hz, 250);
  EXPECT_EQ(config->streaming.vrpn.up, UpAxis::kY);
}

TEST(ConfigFile, SaysHowFarALensMayBeOff) {
  const auto config =
      parse_config(kOneCamera, "test.yaml",
                   {"bodies.0.cameras.0.focal_sigma=0.1", "bodies.0.cameras.0.centre_sigma_px=20",
                    "bodies.0.cameras.0.k1_sigma=0.3", "estimator.refine_intrinsics=true"});
  ASSERT_TRUE(config) << config.error().front().text();
  EXPECT_EQ(config->bodies[0].cameras[0].mount.focal_sigma, 0.1);
  EXPECT_EQ(config->bodies[0].cameras[0].mount.centre_sigma_px, 20);
  EXPECT_EQ(config->bodies[0].cameras[0].mount.k1_sigma, 0.3);
  EXPECT_TRUE(config->estimator.refine_intrinsics);
  EXPECT_THAT(faults_of(kOneCamera, {"bodies.0.cameras.0.focal_sigma=10"}),
              ElementsAre(HasSubstr("focal_sigma = 10: must be in [0, 0.3]")));
  EXPECT_THAT(faults_of(kOneCamera, {"bodies.0.cameras.0.centre_sigma_px=-1"}),
              ElementsAre(HasSubstr("centre_sigma_px = -1: must be in [0, 1000]")));
  EXPECT_THAT(faults_of(kOneCamera, {"bodies.0.cameras.0.k1_sigma=2"}),
              ElementsAre(HasSubstr("k1_sigma = 2: must be in [0, 1]")));
}

constexpr const char* kTwoCameras = R"(
bodies:
  - name: robot
    cameras:
      - source: {type: camera, open: left.mp4}
        model: {width: 640, height: 480, fu: 500, fv: 500, cu: 319.5, cv: 239.5}
      - source: {type: ros, image: /right/image_raw}
)";

TEST(ConfigFile, GivesEachCameraASourceOfItsOwn) {
  const auto config = parse_config(kTwoCameras, "folder/test.yaml");
  ASSERT_TRUE(config) << config.error().front().text();
  const BodyConfig& body = config->bodies[0];
  EXPECT_EQ(body.source.type, SourceType::kSensors);
  ASSERT_EQ(body.cameras.size(), 2u);
  EXPECT_THAT(body.cameras[0].source->camera.open, EndsWith("folder/left.mp4"));
  EXPECT_EQ(body.cameras[1].source->ros.image, "/right/image_raw");
  const auto again = parse_config(print_config(*config), "test.yaml");
  ASSERT_TRUE(again) << again.error().front().text();
  EXPECT_EQ(print_config(*again), print_config(*config));
}

TEST(ConfigFile, GivesAnImuASourceOfItsOwnAndTheNoiseOfItsPart) {
  const std::string with_imu = std::string(kTwoCameras) +
                               "    imu_source: {type: mavlink, port: 14540}\n"
                               "    imu: {part: ICM-42688-P, gyro_walk_rad_s2_rtHz: 7.0e-5}\n";
  const auto config = parse_config(with_imu, "test.yaml");
  ASSERT_TRUE(config) << config.error().front().text();
  const BodyConfig& body = config->bodies[0];
  ASSERT_TRUE(body.imu_source && body.imu);
  EXPECT_EQ(body.imu_source->type, ImuSourceType::kMavlink);
  EXPECT_EQ(body.imu->gyro_noise_rad_s_rtHz,
            noise_of_part("icm-42688-p", 200)->gyro_noise_rad_s_rtHz);
  EXPECT_EQ(body.imu->gyro_walk_rad_s2_rtHz, 7.0e-5) << "what is written goes before the table";
  const auto again = parse_config(print_config(*config), "test.yaml");
  ASSERT_TRUE(again) << again.error().front().text();
  EXPECT_EQ(print_config(*again), print_config(*config));
  EXPECT_THAT(faults_of(with_imu, {"bodies.0.imu.part=icm-42689"}),
              ElementsAre(HasSubstr("bodies.0.imu.part = icm-42689: must be one of")));
}

TEST(ConfigFile, AnImuNeedsASourceAndOnlyOne) {
  EXPECT_THAT(faults_of(std::string(kTwoCameras) + "    imu: {rate_hz: 200}\n"),
              ElementsAre(HasSubstr("bodies.0.imu = {…}: has no source: set `imu_source`")));
  const std::string source = "imu_source: {type: line, device: /dev/ttyACM0}";
  EXPECT_THAT(
      faults_of("bodies: [{name: a, source: {type: recording, folder: x}, " + source + "}]"),
      ElementsAre(HasSubstr("bodies.0.imu_source = {…}: must not be given: a recording")));
  EXPECT_THAT(
      faults_of("bodies: [{name: a, source: {type: ros, images: [/c/i], imu: /imu}, cameras: "
                "[{}], " +
                source + "}]"),
      ElementsAre(
          HasSubstr("bodies.0.imu_source = {…}: must not be given together with source.imu")));
}

TEST(ConfigFile, SourcesOfCamerasAndOfTheirBodyExcludeEachOther) {
  EXPECT_THAT(faults_of(kTwoCameras, {"bodies.0.source.type=camera", "bodies.0.source.open=a.mp4"}),
              testing::Contains(HasSubstr("cameras.0.source = {…}: is given beside the `source`")));
  EXPECT_THAT(
      faults_of(kTwoCameras, {"bodies.0.cameras.1.source=~"}),
      testing::Contains(HasSubstr("cameras.1.source = nothing: must be set: the body has no")));
  EXPECT_THAT(
      faults_of("bodies: [{name: robot, source: {type: sensors}}]"),
      ElementsAre(HasSubstr("bodies.0.cameras = 0 entries: must have at least one camera")));
  EXPECT_THAT(
      faults_of(kTwoCameras, {"bodies.0.cameras.1.source.image=right"}),
      ElementsAre(HasSubstr("bodies.0.cameras.1.source.image = \"right\": must be a topic")));
}

TEST(ConfigFile, HasADefaultForEverything) {
  const auto config = parse_config("", "empty.yaml");
  ASSERT_TRUE(config) << config.error().front().text();
  EXPECT_EQ(config->streaming.rate_hz, StreamingConfig{}.rate_hz);
  EXPECT_THAT(config->bodies, IsEmpty());
}

TEST(ConfigFile, MeansARefinedMapWithSeveralBodiesUnlessItSaysOtherwise) {
  const std::string one = "bodies: [{name: a, source: {type: recording, folder: x}}]";
  const std::string two =
      "bodies: [{name: a, source: {type: recording, folder: x}},"
      " {name: b, source: {type: recording, folder: y}}]";
  const auto period = [](const std::string& text, const std::vector<std::string>& sets = {}) {
    const auto config = parse_config(text, "test.yaml", sets);
    return config ? config->map.builder.refine_period_s : -1;
  };
  EXPECT_EQ(period(one), 0);
  EXPECT_EQ(period(two), kRefinePeriod_s);
  EXPECT_EQ(period(two + "\nmap: {mode: mapping}"), kRefinePeriod_s);
  EXPECT_EQ(period(two + "\nmap: {refine_period_s: 0}"), 0);
  EXPECT_EQ(period(one, {"map.refine_period_s=1"}), 1);
  const auto config = parse_config(two, "test.yaml");
  ASSERT_TRUE(config);
  EXPECT_THAT(print_config(*config), HasSubstr("refine_period_s: 2"));
}

TEST(ConfigFile, TellsAllFaultsAtOnceWithPathValueRuleAndLine) {
  const auto faults = faults_of(R"(tags:
  size_m: -1
  colour: black
estimator:
  corner_noise_px: much
streaming:
  rate_hz: 5000
)");
  EXPECT_THAT(
      faults,
      UnorderedElementsAre(
          StartsWith("test.yaml:2: tags.size_m = -1: must be"),
          StartsWith("test.yaml:3: tags.colour = black: unknown key; known here are family"),
          "test.yaml:5: estimator.corner_noise_px = much: must be a number",
          "test.yaml:7: streaming.rate_hz = 5000: must be in [1, 1000]"));
}

TEST(ConfigFile, FindsUnknownKeysInsideLists) {
  EXPECT_THAT(faults_of(kOneCamera, {"bodies.0.cameras.0.focal=3"}),
              ElementsAre(StartsWith("--set: bodies.0.cameras.0.focal = 3: unknown key")));
}

TEST(ConfigFile, KnowsWhichKeysBelongToASource) {
  EXPECT_THAT(
      faults_of("bodies: [{name: a, source: {type: recording, folder: x, open: y}}]"),
      ElementsAre(HasSubstr(
          "bodies.0.source.open = y: unknown key; known here are type, folder, loop, speed")));
}

TEST(ConfigFile, RefusesAKeyGivenTwice) {
  EXPECT_THAT(faults_of("tags: {size_m: 0.1}\ntags: {size_m: 0.2}\n"),
              ElementsAre(EndsWith("is given twice")));
}

struct BadValue {
  std::string yaml;
  std::string fault;
};

class BadValueTest : public testing::TestWithParam<BadValue> {};

TEST_P(BadValueTest, IsNamedWithItsRule) {
  EXPECT_THAT(faults_of(GetParam().yaml), testing::Contains(HasSubstr(GetParam().fault)));
}

INSTANTIATE_TEST_SUITE_P(
    ConfigFile, BadValueTest,
    testing::Values(
        BadValue{"detector: {refine_edges: 1}", "detector.refine_edges = 1: must be true or false"},
        BadValue{"detector: {max_hamming: 1.5}",
                 "detector.max_hamming = 1.5: must be a whole number"},
        BadValue{"tags: {size_m: \"0.2\"}", "must be a number"},
        BadValue{"tags: {size_m: .nan}", "tags.size_m = .nan: must be a"},
        BadValue{"tags: {ignore: 13}", "tags.ignore = 13: must be a list of whole numbers"},
        BadValue{"tags: {sizes_m: [1]}", "must be a section of `id: number`"},
        BadValue{"tags: 5", "tags = 5: must be a section"},
        BadValue{"bodies: {}", "must be a list"},
        BadValue{"map: {mode: chilled}", "map.mode = chilled: must be one of mapping, frozen"},
        BadValue{"map: {reference_tag: 0, reference_pose: {p: [0, 0], q_wxyz: [1, 0, 0, 0]}}",
                 "map.reference_pose ="},
        BadValue{"map: {reference_tag: 0, reference_pose: {q_wxyz: [1, 1, 0, 0]}}",
                 "with a unit quaternion"},
        BadValue{"map: {correction_ramp_s: -1}", "map.correction_ramp_s = -1: must be finite"},
        BadValue{"map: {reference_pose: {p: [0, 0, 0]}}", "needs reference_tag"},
        BadValue{"map: {reference_tag: 0, reference_pose: {p: [0, 0, 0]}, floor_tags: [1]}",
                 "which defines the vertical"},
        BadValue{"streaming: {vrpn: {port: 70000}}",
                 "streaming.vrpn.port = 70000: must be a whole number in [0, 65535]"},
        BadValue{"streaming: {web: {rate_hz: 0}}", "streaming.web.rate_hz = 0: must be"},
        BadValue{"streaming: {optional: [telnet]}",
                 "streaming.optional = telnet: must be some of vrpn"},
        BadValue{"streaming: {natnet: {aliases: [drone]}}",
                 "must be a section of `name: other name`"},
        BadValue{"streaming: {natnet: {aliases: {ghost: RigidBody 1}}}",
                 "streaming.natnet.aliases.ghost = \"RigidBody 1\": must be an alias of one "
                 "of the bodies"},
        BadValue{"{streaming: {dds: {aliases: {a: \"\"}}}, bodies: [{name: a, source: {type: "
                 "recording, folder: x}}]}",
                 "streaming.dds.aliases.a = \"\": must not be empty"},
        BadValue{"bodies: [{name: a/b, source: {type: recording, folder: x}}]",
                 "bodies.0.name = \"a/b\": must not have /"},
        BadValue{"bodies: [{name: \"a\\u202Eb\", source: {type: recording, folder: x}}]",
                 "bodies.0.name = \"a\\u202eb\": must not have invisible characters"},
        BadValue{"bodies: [{name: a, source: {type: recording}}]",
                 "bodies.0.source.folder = \"\": must name"},
        BadValue{"bodies: [{name: a, source: {type: simulator}}]", "bodies.0.cameras = []"},
        BadValue{"bodies: [{name: a, source: {type: camera, open: x}}]", "exactly one camera"},
        BadValue{"bodies: [{name: a, filter: magic, source: {type: recording, folder: x}}]",
                 "bodies.0.filter = magic"},
        BadValue{"bodies: [{name: a, source: {type: recording, folder: x}}, {name: a, source: "
                 "{type: recording, folder: x}}]",
                 "bodies.1.name = \"a\": is taken by another body"},
        BadValue{"bodies: [{name: a, limits: {coast_after_s: -1}, source: {type: recording, "
                 "folder: x}}]",
                 "bodies.0.limits.coast_after_s = -1: must be"}));

TEST(ConfigFile, SaysWhereTextStopsBeingYaml) {
  EXPECT_THAT(faults_of("tags: {size_m: 0.1\nbodies: []\n"), ElementsAre(HasSubstr("is not YAML")));
  EXPECT_THAT(faults_of("- a\n- b\n"), ElementsAre(HasSubstr("must be a section of `key: value`")));
}

TEST(ConfigFile, IsNotFoundWithItsName) {
  const auto config = load_config("/nowhere/robot.yaml");
  ASSERT_FALSE(config);
  EXPECT_THAT(config.error().front().text(), HasSubstr("/nowhere/robot.yaml: no such file"));
}

TEST(ConfigOverride, GoesBeforeTheFile) {
  const auto config =
      parse_config(kOneCamera, "test.yaml",
                   {"bodies.0.source.open=other.mp4", "streaming.rate_hz=50", "tags.sizes_m.9=0.3",
                    "map.mode=frozen", "bodies.0.pivot={p: [0, 0, 1], q_wxyz: [1, 0, 0, 0]}"});
  ASSERT_TRUE(config) << config.error().front().text();
  EXPECT_THAT(config->bodies[0].source.camera.open, EndsWith("/other.mp4"));
  EXPECT_EQ(config->streaming.rate_hz, 50);
  EXPECT_EQ(config->tags.edge_of(9), 0.3);
  EXPECT_EQ(config->tags.edge_of(7), 0.4);
  EXPECT_EQ(config->map.builder.mode, MapMode::kFrozen);
  EXPECT_EQ(config->bodies[0].pivot.p.z(), 1);
}

TEST(ConfigFile, GivesABodyAnotherNameForTheClientsOfOneProtocol) {
  const auto config = parse_config(
      "bodies: [{name: drone, source: {type: recording, folder: x}}]", "test.yaml",
      {"streaming.natnet.aliases={drone: Rigid Body 1}", "streaming.vicon.aliases.drone=cf7"});
  ASSERT_TRUE(config) << config.error().front().text();
  EXPECT_EQ(config->streaming.natnet.aliases, (NameAliases{{"drone", "Rigid Body 1"}}));
  EXPECT_EQ(config->streaming.vicon.aliases, (NameAliases{{"drone", "cf7"}}));
  EXPECT_TRUE(config->streaming.qualisys.aliases.empty());
  EXPECT_THAT(print_config(*config), HasSubstr("aliases: {\"drone\": \"Rigid Body 1\"}"));
}

TEST(ConfigOverride, IsCheckedLikeTheFile) {
  EXPECT_THAT(faults_of(kOneCamera, {"streaming.rate_hz=0"}),
              ElementsAre("--set: streaming.rate_hz = 0: must be in [1, 1000]"));
}

TEST(ConfigOverride, SaysWhatIsWrongWithItsPath) {
  EXPECT_THAT(faults_of(kOneCamera, {"bodies.3.name=x"}),
              ElementsAre(HasSubstr("the list has 1 entries")));
  EXPECT_THAT(faults_of(kOneCamera, {"streaming.speed=1"}), ElementsAre(HasSubstr("unknown key")));
  EXPECT_THAT(faults_of(kOneCamera, {"streaming.rate_hz.fast=1"}),
              ElementsAre(HasSubstr("not a section")));
  EXPECT_THAT(faults_of(kOneCamera, {"streaming.rate_hz"}),
              ElementsAre(HasSubstr("path.to.key=value")));
  EXPECT_THAT(faults_of(kOneCamera, {"streaming.rate_hz=[1"}),
              ElementsAre(HasSubstr("is not YAML")));
}

TEST(ConfigPaths, AreRelativeToTheFileThatNamesThem) {
  const TemporaryFolder folder;
  const auto file = folder.write("robot.yaml", kOneCamera);
  const auto config = load_config(file, {"map.store=here.sqlite"});
  ASSERT_TRUE(config) << config.error().front().text();
  EXPECT_EQ(config->bodies[0].source.camera.open, folder.file("clip.mp4"));
  EXPECT_EQ(config->map.store, (std::filesystem::current_path() / "here.sqlite").string());
}

TEST(ConfigPaths, DevicesAndPipelinesStayAsTheyAre) {
  for (const std::string device :
       {"0", "/dev/video3", "v4l2src ! appsink", "rtsp://camera/stream"}) {
    const auto config = parse_config("bodies: [{name: a, source: {type: camera, open: \"" + device +
                                         "\"}, cameras: [{calibration: c.json}]}]",
                                     "a/test.yaml");
    ASSERT_TRUE(config) << config.error().front().text();
    EXPECT_EQ(config->bodies[0].source.camera.open, device);
  }
}

TEST(ConfigFile, BodiesThatContainThemselvesAreReportedWithPathAndRule) {
  EXPECT_THAT(faults_of("bodies: &a [*a, *a]\n"),
              ElementsAre("test.yaml:1: bodies.0 = an alias: repeats the list or section that "
                          "contains it"));
}

TEST(ConfigPrint, DoesNotShowTheTokenNorOneThatWorks) {
  const auto config = parse_config("operator: {token: \"open sesame\"}", "test.yaml");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->operators.token, "open sesame");
  const std::string printed = print_config(*config);
  EXPECT_THAT(printed, testing::Not(HasSubstr("sesame")));
  EXPECT_THAT(printed, HasSubstr("  token: \"\"  # set, not shown\n"));
  const auto again = parse_config(printed, "printed.yaml");
  ASSERT_TRUE(again) << again.error().front().text();
  EXPECT_EQ(again->operators.token, "") << "nobody is let in by what was printed";
  EXPECT_THAT(print_config(ServerConfig{}), HasSubstr("  token: \"\"\n"));
}

TEST(ConfigPrint, LoadsAgainToTheSame) {
  const auto config =
      parse_config(kOneCamera, "test.yaml",
                   {"map.reference_tag=3", "bodies.0.limits.coast_after_s=0.1234567890123",
                    "map.reference_pose={p: [1, 2, 3], q_wxyz: [0.7071, 0.7071, 0, 0]}"});
  ASSERT_TRUE(config) << config.error().front().text();
  const std::string printed = print_config(*config);
  const auto again = parse_config(printed, "elsewhere/printed.yaml");
  ASSERT_TRUE(again) << again.error().front().text() << "\n" << printed;
  EXPECT_EQ(print_config(*again), printed);
  EXPECT_EQ(again->bodies[0].limits.coast_after_s, 0.1234567890123);
  EXPECT_EQ(again->map.reference_pose->p, config->map.reference_pose->p);
}

TEST(ConfigPrint, ShowsEveryKeyAlsoThoseWithDefaults) {
  const auto config = parse_config(kOneCamera, "test.yaml");
  ASSERT_TRUE(config);
  for (const char* key :
       {"decimate:", "gate_probability:", "commit_period_s:", "correction_ramp_s:",
        "reference_tag: null", "minor_version:", "lose_after_s:", "q_wxyz"}) {
    EXPECT_THAT(print_config(*config), HasSubstr(key));
  }
}

}  // namespace
}  // namespace fiducap
