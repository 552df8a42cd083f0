#include "daemon/config/config_file.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <tuple>

#include "base/log.hpp"
#include "capture/imu_sample.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

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

TEST(ConfigFile, ReadsItsValues) {
  const auto config = value_of(parse_config(kOneCamera, "test.yaml"));
  EXPECT_EQ(config.tags.size_m, 0.2);
  EXPECT_EQ(config.tags.edge_of(7), 0.4);
  EXPECT_THAT(config.tags.ignore, ElementsAre(13));
  ASSERT_EQ(config.bodies.size(), 1u);
  const BodyConfig& body = config.bodies[0];
  EXPECT_EQ(body.name, "robot");
  EXPECT_EQ(body.id, 1);
  EXPECT_EQ(body.source.type, SourceType::kCamera);
  ASSERT_EQ(body.cameras.size(), 1u);
  EXPECT_EQ(body.cameras[0].mount.model.fu, 500);
  EXPECT_EQ(body.cameras[0].mount.X_BV.q.x(), -0.5);
  EXPECT_EQ(body.cameras[0].mount.time_shift, std::chrono::microseconds(-2500));
  EXPECT_EQ(config.streaming.rate_hz, 250);
  EXPECT_EQ(config.streaming.vrpn.up, UpAxis::kY);
}

constexpr const char* kTwoCameras = R"(
bodies:
  - name: robot
    cameras:
      - source: {type: camera, open: left.mp4}
        model: {width: 640, height: 480, fu: 500, fv: 500, cu: 319.5, cv: 239.5}
      - source: {type: ros, image: /right/image_raw}
)";

const std::string kImuOfTwoCameras =
    std::string(kTwoCameras) +
    "    imu_source: {type: mavlink, port: 14540}\n"
    "    imu: {part: ICM-42688-P, gyro_walk_rad_s2_rtHz: 7.0e-5}\n";

TEST(ConfigFile, GivesEachSensorASourceAndAnImuTheNoiseOfItsPart) {
  const auto config = value_of(parse_config(kImuOfTwoCameras, "folder/test.yaml"));
  const BodyConfig& body = config.bodies[0];
  EXPECT_EQ(body.source.type, SourceType::kSensors);
  ASSERT_EQ(body.cameras.size(), 2u);
  EXPECT_THAT(body.cameras[0].source->camera.open, EndsWith("folder/left.mp4"));
  EXPECT_EQ(body.cameras[1].source->ros.source.images.front(), "/right/image_raw");
  ASSERT_TRUE(body.imu_source && body.imu);
  EXPECT_EQ(body.imu_source->type, ImuSourceType::kMavlink);
  EXPECT_EQ(body.imu->gyro_noise_rad_s_rtHz,
            noise_of_part("icm-42688-p", 200)->gyro_noise_rad_s_rtHz);
  EXPECT_EQ(body.imu->gyro_walk_rad_s2_rtHz, 7.0e-5) << "the file has priority";
}

TEST(ConfigFile, IgnoresKeysOfEarlierVersionsWithAMessage) {
  const auto before = log::lines_after(0);
  const auto config = parse_config("estimator: {hand_over_above: 100}", "test.yaml", {});
  ASSERT_TRUE(config);
  const auto lines = log::lines_after(before.empty() ? 0 : before.back().number);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_THAT(lines[0].text, StartsWith("estimator.hand_over_above is not used any more: "));
  EXPECT_EQ(print_config(*config).find("hand_over_above"), std::string::npos);
}

TEST(ConfigFile, ReportsAllFaultsWithPathValueRuleAndLine) {
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
      testing::UnorderedElementsAre(
          StartsWith("test.yaml:2: tags.size_m = -1: must be"),
          StartsWith("test.yaml:3: tags.colour = black: unknown key; known here are family"),
          "test.yaml:5: estimator.corner_noise_px = much: must be a number",
          "test.yaml:7: streaming.rate_hz = 5000: must be in [1, 1000]"));
}

const std::pair<const char*, const char*> kBadValues[] = {
    {"detector: {refine_edges: 1}", "detector.refine_edges = 1: must be true or false"},
    {"detector: {max_hamming: 1.5}", "detector.max_hamming = 1.5: must be a whole number"},
    {"tags: {size_m: \"0.2\"}", "must be a number"},
    {"tags: {size_m: .nan}", "tags.size_m = .nan: must be a"},
    {"tags: {ignore: 13}", "tags.ignore = 13: must be a list of whole numbers"},
    {"tags: {sizes_m: [1]}", "must be a section of `id: number`"},
    {"tags: 5", "tags = 5: must be a section"},
    {"bodies: {}", "must be a list"},
    {"map: {mode: chilled}", "map.mode = chilled: must be one of mapping, frozen"},
    {"map: {reference_tag: 0, reference_pose: {p: [0, 0], q_wxyz: [1, 0, 0, 0]}}",
     "map.reference_pose ="},
    {"map: {reference_tag: 0, reference_pose: {q_wxyz: [1, 1, 0, 0]}}", "with a unit quaternion"},
    {"map: {correction_ramp_s: -1}", "map.correction_ramp_s = -1: must be finite"},
    {"map: {reference_pose: {p: [0, 0, 0]}}", "needs reference_tag"},
    {"map: {reference_tag: 0, reference_pose: {p: [0, 0, 0]}, floor_tags: [1]}",
     "which defines the vertical"},
    {"streaming: {vrpn: {port: 70000}}",
     "streaming.vrpn.port = 70000: must be a whole number in [0, 65535]"},
    {"streaming: {web: {rate_hz: 0}}", "streaming.web.rate_hz = 0: must be"},
    {"streaming: {optional: [telnet]}", "streaming.optional = telnet: must be some of vrpn"},
    {"streaming: {natnet: {aliases: [drone]}}", "must be a section of `name: other name`"},
    {"streaming: {natnet: {aliases: {ghost: RigidBody 1}}}",
     "streaming.natnet.aliases.ghost = \"RigidBody 1\": must be an alias of one "
     "of the bodies"},
    {"{streaming: {dds: {aliases: {a: \"\"}}}, bodies: [{name: a, source: {type: "
     "recording, folder: x}}]}",
     "streaming.dds.aliases.a = \"\": must not be empty"},
    {"bodies: [{name: a/b, source: {type: recording, folder: x}}]",
     "bodies.0.name = \"a/b\": must not have /"},
    {"bodies: [{name: \"a\\u202Eb\", source: {type: recording, folder: x}}]",
     "bodies.0.name = \"a\\u202eb\": must not have invisible characters"},
    {"bodies: [{name: a, source: {type: recording}}]", "bodies.0.source.folder = \"\": must name"},
    {"bodies: [{name: a, source: {type: simulator}}]", "bodies.0.cameras = []"},
    {"bodies: [{name: a, source: {type: camera, open: x}}]", "exactly one camera"},
    {"bodies: [{name: a, filter: magic, source: {type: recording, folder: x}}]",
     "bodies.0.filter = magic"},
    {"bodies: [{name: a, source: {type: recording, folder: x}}, {name: a, source: "
     "{type: recording, folder: x}}]",
     "bodies.1.name = \"a\": is taken by another body"},
    {"bodies: [{name: a, limits: {coast_after_s: -1}, source: {type: recording, "
     "folder: x}}]",
     "bodies.0.limits.coast_after_s = -1: must be"}};

TEST(ConfigFile, NamesBadValuesWithTheirRules) {
  for (const auto& [yaml, fault] : kBadValues)
    EXPECT_THAT(faults_of(yaml), Contains(HasSubstr(fault))) << yaml;
}

const std::string kLineImu = "imu_source: {type: line, device: /dev/ttyACM0}";
struct OnlyFault {
  std::string yaml;
  std::string set;  ///< Of the command line; empty: none.
  testing::Matcher<std::string> fault;
};
const OnlyFault kOnlyFaults[] = {
    // Gravity is configured once.
    {"site: {gravity_m_s2: 9.78, latitude_deg: 0}", "", HasSubstr("remove one of them")},
    {"site: {height_m: 2240}", "", HasSubstr("needs latitude_deg")},
    {"site: {gravity_m_s2: 1}", "", HasSubstr("site.gravity_m_s2")},
    // Lenses
    {kOneCamera, "bodies.0.cameras.0.focal_sigma=10",
     HasSubstr("focal_sigma = 10: must be in [0, 0.3]")},
    {kOneCamera, "bodies.0.cameras.0.centre_sigma_px=-1",
     HasSubstr("centre_sigma_px = -1: must be in [0, 1000]")},
    {kOneCamera, "bodies.0.cameras.0.k1_sigma=2", HasSubstr("k1_sigma = 2: must be in [0, 1]")},
    // An IMU needs one source, and a known part.
    {std::string(kTwoCameras) + "    imu: {rate_hz: 200}\n", "",
     HasSubstr("bodies.0.imu = {…}: has no source: set `imu_source`")},
    {"bodies: [{name: a, source: {type: recording, folder: x}, " + kLineImu + "}]", "",
     HasSubstr("bodies.0.imu_source = {…}: must not be given: a recording")},
    {"bodies: [{name: a, source: {type: ros, images: [/c/i], imu: /imu}, cameras: [{}], " +
         kLineImu + "}]",
     "", HasSubstr("bodies.0.imu_source = {…}: must not be given together with source.imu")},
    {kImuOfTwoCameras, "bodies.0.imu.part=icm-42689",
     HasSubstr("bodies.0.imu.part = icm-42689: must be one of")},
    // Sources
    {"bodies: [{name: robot, source: {type: sensors}}]", "",
     HasSubstr("bodies.0.cameras = 0 entries: must have at least one camera")},
    {kTwoCameras, "bodies.0.cameras.1.source.image=right",
     HasSubstr("bodies.0.cameras.1.source.image = \"right\": must be a topic")},
    {"bodies: [{name: a, source: {type: recording, folder: x, open: y}}]", "",
     HasSubstr("bodies.0.source.open = y: unknown key; known here are type, folder, loop, "
               "speed")},
    // YAML
    {"tags: {size_m: 0.1}\ntags: {size_m: 0.2}\n", "", EndsWith("is given twice")},
    {"tags: {size_m: 0.1\nbodies: []\n", "", HasSubstr("is not YAML")},
    {"- a\n- b\n", "", HasSubstr("must be a section of `key: value`")},
    {"bodies: &a [*a, *a]\n", "",
     "test.yaml:1: bodies.0 = an alias: repeats the list or section that contains it"},
    // Settings of the command line
    {kOneCamera, "bodies.0.cameras.0.focal=3",
     StartsWith("--set: bodies.0.cameras.0.focal = 3: unknown key")},
    {kOneCamera, "streaming.rate_hz=0", "--set: streaming.rate_hz = 0: must be in [1, 1000]"},
    {kOneCamera, "bodies.3.name=x", HasSubstr("the list has 1 entries")},
    {kOneCamera, "streaming.speed=1", HasSubstr("unknown key")},
    {kOneCamera, "streaming.rate_hz.fast=1", HasSubstr("not a section")},
    {kOneCamera, "streaming.rate_hz", HasSubstr("path.to.key=value")},
    {kOneCamera, "streaming.rate_hz=[1", HasSubstr("is not YAML")},
};

TEST(ConfigFile, NamesTheOnlyFault) {
  for (const OnlyFault& one : kOnlyFaults) {
    const std::vector<std::string> sets(one.set.empty() ? 0 : 1, one.set);
    EXPECT_THAT(faults_of(one.yaml, sets), ElementsAre(one.fault)) << one.yaml << one.set;
  }
}

TEST(ConfigFile, RefusesASourceOfTheBodyBesideThoseOfCameras) {
  EXPECT_THAT(faults_of(kTwoCameras, {"bodies.0.source.type=camera", "bodies.0.source.open=a.mp4"}),
              Contains(HasSubstr("cameras.0.source = {…}: is given beside the `source`")));
  EXPECT_THAT(faults_of(kTwoCameras, {"bodies.0.cameras.1.source=~"}),
              Contains(HasSubstr("cameras.1.source = nothing: must be set: the body has no")));
}

TEST(ConfigOverride, HasPriorityOverTheFile) {
  const auto config = value_of(
      parse_config(kOneCamera, "test.yaml",
                   {"bodies.0.source.open=other.mp4", "streaming.rate_hz=50", "tags.sizes_m.9=0.3",
                    "map.mode=frozen", "bodies.0.cameras.0.focal_sigma=0.1",
                    "bodies.0.cameras.0.centre_sigma_px=20", "bodies.0.cameras.0.k1_sigma=0.3",
                    "bodies.0.pivot={p: [0, 0, 1], q_wxyz: [1, 0, 0, 0]}"}));
  EXPECT_THAT(config.bodies[0].source.camera.open, EndsWith("/other.mp4"));
  EXPECT_EQ(config.streaming.rate_hz, 50);
  EXPECT_EQ(config.tags.edge_of(9), 0.3);
  EXPECT_EQ(config.tags.edge_of(7), 0.4);
  EXPECT_EQ(config.map.builder.mode, MapMode::kFrozen);
  EXPECT_EQ(config.bodies[0].pivot.p.z(), 1);
  const CameraMount& mount = config.bodies[0].cameras[0].mount;
  EXPECT_EQ(std::tuple(mount.focal_sigma, mount.centre_sigma_px, mount.k1_sigma),
            std::tuple(0.1, 20, 0.3));
}

TEST(ConfigFile, GivesABodyAnAliasForOneProtocol) {
  const auto config = value_of(parse_config(
      "bodies: [{name: drone, source: {type: recording, folder: x}}]", "test.yaml",
      {"streaming.natnet.aliases={drone: Rigid Body 1}", "streaming.vicon.aliases.drone=cf7"}));
  EXPECT_EQ(config.streaming.natnet.aliases, (NameAliases{{"drone", "Rigid Body 1"}}));
  EXPECT_EQ(config.streaming.vicon.aliases, (NameAliases{{"drone", "cf7"}}));
  EXPECT_TRUE(config.streaming.qualisys.aliases.empty());
  EXPECT_THAT(print_config(config), HasSubstr("aliases: {\"drone\": \"Rigid Body 1\"}"));
}

TEST(ConfigPaths, AreRelativeToTheFileThatNamesThem) {
  const TemporaryFolder folder;
  const auto file = folder.write("robot.yaml", kOneCamera);
  const auto config = value_of(load_config(file, {"map.store=here.sqlite"}));
  EXPECT_EQ(config.bodies[0].source.camera.open, folder.file("clip.mp4"));
  EXPECT_EQ(config.map.store, (std::filesystem::current_path() / "here.sqlite").string());
}

TEST(ConfigPaths, LeaveDevicesAndPipelinesUnchanged) {
  for (const std::string device :
       {"0", "/dev/video3", "v4l2src ! appsink", "rtsp://camera/stream"}) {
    const auto config =
        value_of(parse_config("bodies: [{name: a, source: {type: camera, open: \"" + device +
                                  "\"}, cameras: [{calibration: c.json}]}]",
                              "a/test.yaml"));
    EXPECT_EQ(config.bodies[0].source.camera.open, device);
  }
}

TEST(ConfigPrint, DoesNotShowTheToken) {
  const auto config = value_of(parse_config("operator: {token: \"open sesame\"}", "test.yaml"));
  EXPECT_EQ(config.operators.token, "open sesame");
  const std::string printed = print_config(config);
  EXPECT_THAT(printed, testing::Not(HasSubstr("sesame")));
  EXPECT_THAT(printed, HasSubstr("  token: \"\"  # set, not shown\n"));
  const auto again = value_of(parse_config(printed, "printed.yaml"));
  EXPECT_EQ(again.operators.token, "") << "printed files have no token";
  EXPECT_THAT(print_config(ServerConfig{}), HasSubstr("  token: \"\"\n"));
}

TEST(ConfigPrint, LoadsAgainToTheSame) {
  const auto config =
      value_of(parse_config(kOneCamera, "test.yaml",
                            {"map.reference_tag=3", "bodies.0.limits.coast_after_s=0.1234567890123",
                             "map.reference_pose={p: [1, 2, 3], q_wxyz: [0.7071, 0.7071, 0, 0]}"}));
  const std::string printed = print_config(config);
  const auto again = value_of(parse_config(printed, "elsewhere/printed.yaml"));
  EXPECT_EQ(print_config(again), printed);
  EXPECT_EQ(again.bodies[0].limits.coast_after_s, 0.1234567890123);
  EXPECT_EQ(again.map.reference_pose->p, config.map.reference_pose->p);
}

TEST(ConfigPrint, ShowsKeysWithDefaults) {
  const auto config = value_of(parse_config(kOneCamera, "test.yaml"));
  for (const char* key :
       {"decimate:", "gate_probability:", "commit_period_s:", "correction_ramp_s:",
        "reference_tag: null", "minor_version:", "lose_after_s:", "q_wxyz"}) {
    EXPECT_THAT(print_config(config), HasSubstr(key));
  }
}

}  // namespace
}  // namespace fiducap
