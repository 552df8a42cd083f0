// Every usual mistake in a configuration is named.
#include "daemon/review/config_review.hpp"

#include <gmock/gmock.h>

#include <filesystem>

#include <opencv2/videoio.hpp>

#include "streaming/net/bind.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

constexpr const char* kValid = R"(
tags: {family: tag36h11, size_m: 0.16}
map: {mode: mapping, store: map.sqlite, reference_tag: 0}
bodies:
  - name: robot
    source: {type: simulator}
    cameras:
      - model: {width: 752, height: 480, fu: 460, fv: 460, cu: 375.5, cv: 239.5}
        X_BV: {p: [0.1, 0, 0], q_wxyz: [0.5, -0.5, 0.5, -0.5]}
  - name: filmed
    source: {type: camera, open: clip.avi}
    cameras:
      - model: {width: 64, height: 48, fu: 46, fv: 46, cu: 31.5, cv: 23.5}
streaming:
  vrpn: {port: 0}
  native: {port: 0}
  web: {port: 0}
)";

/// A folder with all files of the valid configuration.
class ConfigReviewTest : public testing::Test {
 protected:
  ConfigReviewTest() {
    cv::VideoWriter video(folder_.file("clip.avi"), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20,
                          {64, 48});
    for (int i = 0; i < 3; ++i) video.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(90)));
  }

  ConfigReview look(std::vector<std::string> sets) {
    sets.push_back("recorder.folder=" + folder_.file("recordings"));
    const auto config = parse_config(kValid, folder_.file("robot.yaml"), sets);
    if (config) return review(*config);
    return {.faults = config.error(), .doubts = {}, .plan = {}};
  }
  static std::vector<std::string> lines(const std::vector<ConfigFault>& faults) {
    std::vector<std::string> all;
    for (const auto& fault : faults) all.push_back(fault.text());
    return all;
  }

  TemporaryFolder folder_;
};

TEST_F(ConfigReviewTest, ShowsThePlanOfAValidConfiguration) {
  const ConfigReview found = look({});
  EXPECT_THAT(lines(found.faults), IsEmpty());
  EXPECT_THAT(lines(found.doubts), IsEmpty());
  EXPECT_THAT(found.plan, Contains("body robot (id 1): 1 camera, 752 x 480, with IMU, from a "
                                   "simulated robot"));
  EXPECT_THAT(found.plan, Contains(HasSubstr("filmed (id 2): 1 camera, 64 x 48, without IMU")));
  EXPECT_THAT(found.plan, Contains("a growing map; tags tag36h11, 160 mm"));
  EXPECT_THAT(found.plan, Contains(HasSubstr("vrpn on 127.0.0.1: 0 tcp 0 udp")));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("map.sqlite"))) << "nothing is written";
  EXPECT_FALSE(std::filesystem::exists(folder_.file("recordings"))) << "nothing is written";
}

struct Mistake {
  std::vector<std::string> sets;
  std::string text;
  bool is_doubt{false};
};

const std::vector<Mistake> kMistakes{
    // Names and keys
    {{"tags.famly=tag36h11"}, "tags.famly = tag36h11: unknown key; did you mean family?"},
    {{"map.mode=frosen"},
     "map.mode = frosen: must be one of mapping, frozen; did you mean frozen?"},
    {{"tags.family=tag36h12"}, "tags.family = tag36h12: must be one of"},
    // Units
    {{"tags.size_m=160"}, "tags.size_m = 160: must be in metres: 160 mm is 0.16"},
    {{"tags.sizes_m={7: 400}"}, "tags.sizes_m.7 = 400: must be in metres"},
    {{"bodies.1.source.exposure_s=8"}, "bodies.1.source.exposure_s = 8: must be in [0, 1]"},
    {{"bodies.0.cameras.0.X_BV.p=[100, 0, 0]"}, "places are in metres, not millimetres", true},
    {{"bodies.0.imu.gyro_noise_rad_s_rtHz=0.2"}, "data sheets give degrees", true},
    {{"bodies.0.imu.accel_noise_m_s2_rtHz=100"}, "data sheets give micro-g", true},
    // Lenses
    {{"bodies.1.cameras.0.model.width=640"}, "gives images of 64 x 48"},
    {{"bodies.0.cameras.0.focal_sigma=0.1"}, "means that the lens is a guess", true},
    {{"bodies.0.cameras.0.model.fv=700"}, "differs from fu by more than pixels do", true},
    {{"bodies.0.cameras.0.model.cu=20"}, "is far from the middle of 752 x 480", true},
    {{"bodies.0.cameras.0.model.fu=7000", "bodies.0.cameras.0.model.fv=7000"},
     "means a view of 6.1",
     true},
    // Missing files and devices
    {{"bodies.1.source.open=field.mp4"}, "no such video file"},
    {{"bodies.1.source.open=/dev/video63"}, "/dev/video63: "},
    {{"bodies.1.source={type: recording, folder: nothing}"}, "bodies.1 = filmed: "},
    {{"bodies.0.cameras.0.calibration=lens.json"}, "lens.json: no such file"},
    {{"map.file=room.yaml"}, "there is no such file"},
    {{"map.store=/no/such/folder/map.sqlite"}, "its folder does not exist"},
    {{"operator.token_file=/no/such/token"}, "operator.token_file = /no/such/token"},
    {{"dds.interface=eth77"}, "dds.interface = eth77: is no network interface"},
    // Configurations that can never track
    {{"map.mode=frozen"}, "has no map: nothing will ever be tracked"},
    {{"map.reference_tag=900"},
     "map.reference_tag = 900: is no tag of tag36h11, which has 0 to 586"},
    {{"tags.ignore=[0]"}, "map.reference_tag = 0: is in tags.ignore"},
    {{"tags.sizes_m={5000: 0.2}"}, "tags.sizes_m = 5000: is no tag of tag36h11"},
    {{"map.floor_tags=[-3]"}, "map.floor_tags = -3: is no tag"},
    // Lost at the end
    {{"map.store="}, "the map is lost when the server ends", true},
    {{"map.reference_tag=~"}, "the first tag that is seen becomes the origin", true},
    {{"bodies.0.use_imu=false"}, "the vertical is unknown", true},
    // Ports
    {{"streaming.vrpn.port=21987", "streaming.native.port=21987"},
     "streaming.native.port = 21987: opens port 21987 udp, which streaming.vrpn.port = 21987 "
     "opens, "
     "too: give one of them another port"},
    {{"streaming.native.port=21987", "streaming.web.port=21987"},
     "streaming.web.port = 21987: opens port 21987 tcp, which streaming.native.port = 21987 opens"},
    {{"streaming.qualisys={enabled: true, base_port: 21985}", "streaming.web.port=21987"},
     "streaming.web.port = 21987: opens port 21987 tcp, which streaming.qualisys.base_port = 21985 "
     "opens"},
    {{"streaming.natnet={enabled: true, port: 21987, unicast_port: 21987}"},
     "streaming.natnet.unicast_port = 21987: opens port 21987 udp, which streaming.natnet.port"},
    {{"bodies.1.imu={part: icm-42688-p}",
      "bodies.1.imu_source={type: line, port: 21987, peer: 10.0.0.7}", "streaming.vrpn.port=21987"},
     "bodies.1.imu_source.port = 21987: opens port 21987 udp, which streaming.vrpn.port"},
    {{"streaming.vrpn.address=203.0.113.7", "streaming.vrpn.port=21988"},
     "streaming.vrpn.port = 21988: "},
};

TEST_F(ConfigReviewTest, NamesEveryMistake) {
  for (const Mistake& mistake : kMistakes) {
    const ConfigReview found = look(mistake.sets);
    const auto& where = mistake.is_doubt ? found.doubts : found.faults;
    EXPECT_THAT(lines(where), Contains(HasSubstr(mistake.text))) << mistake.sets.front();
    if (mistake.is_doubt) {
      EXPECT_THAT(lines(found.faults), IsEmpty()) << mistake.sets.front();
    }
  }
}

TEST_F(ConfigReviewTest, NamesAllMistakesOfOneFileAtOnce) {
  const ConfigReview found =
      look({"map.mode=frozen", "bodies.1.source.open=field.mp4", "tags.ignore=[0]"});
  EXPECT_EQ(found.faults.size(), 3u) << testing::PrintToString(lines(found.faults));
}

TEST_F(ConfigReviewTest, FindsAllFaultsOfOneBodyAtOnce) {
  const auto files = lines(
      look({"bodies.1.cameras.0.calibration=lens.json", "bodies.1.source.open=field.mp4"}).faults);
  EXPECT_THAT(files, UnorderedElementsAre(HasSubstr("lens.json: no such file"),
                                          HasSubstr("no such video file")));
  const auto device = lines(look({"bodies.1.source.open=/dev/video63", "bodies.1.source.width=640",
                                  "bodies.1.source.height=480"})
                                .faults);
  EXPECT_THAT(device, UnorderedElementsAre(HasSubstr("the calibration is for 64 x 48"),
                                           HasSubstr("/dev/video63: ")));
}

TEST_F(ConfigReviewTest, NamesATakenPort) {
  boost::asio::io_context io;
  const auto taken = value_of(net::listen_tcp(io, {"127.0.0.1", 0, "test"}));
  const std::string port = std::to_string(taken.local_endpoint().port());
  EXPECT_THAT(lines(look({"streaming.web.port=" + port}).faults),
              Contains(AllOf(HasSubstr("streaming.web.port = " + port),
                             HasSubstr("used by this process itself"))));
  EXPECT_THAT(lines(look({"streaming.native.port=" + port}).faults),
              Contains(HasSubstr("streaming.native.port = " + port)))
      << "for commands";
  const ConfigReview optional = look({"streaming.web.port=" + port, "streaming.optional=[web]"});
  EXPECT_THAT(lines(optional.faults), IsEmpty());
  EXPECT_THAT(lines(optional.doubts), Contains(HasSubstr("the server runs without")));
}

TEST_F(ConfigReviewTest, NamesEveryTakenPortOfQualisys) {
  boost::asio::io_context io;
  const auto taken = value_of(net::listen_tcp(io, {"127.0.0.1", 0, "test"}));
  const std::string base = std::to_string(taken.local_endpoint().port());
  const auto discovery = value_of(net::bind_udp(io, {"127.0.0.1", 0, "test"}));
  const std::string found = std::to_string(discovery.local_endpoint().port());
  const ConfigReview one = look({"streaming.qualisys={enabled: true, base_port: " + base +
                                 ", discovery_port: " + found + "}"});
  EXPECT_THAT(lines(one.faults), Contains(HasSubstr("streaming.qualisys.base_port = " + base)));
  EXPECT_THAT(lines(one.doubts), Contains(AllOf(HasSubstr("streaming.qualisys.discovery_port"),
                                                HasSubstr("qualisys is served without"))));
}

TEST_F(ConfigReviewTest, LetsSectionsShareAPortOnDifferentAddresses) {
  EXPECT_THAT(
      lines(look({"streaming.web={port: 21987, address: 127.0.0.2}", "streaming.native.port=21987"})
                .faults),
      IsEmpty());
  EXPECT_THAT(
      lines(look({"streaming.web={port: 21987, address: 0.0.0.0}", "streaming.native.port=21987"})
                .faults),
      Contains(HasSubstr("which streaming.native.port = 21987 opens")));
}

TEST_F(ConfigReviewTest, WarnsOfAnImuOfTheFirstSender) {
  const std::string imu = "bodies.1.imu={part: icm-42688-p}";
  const std::string port = "bodies.1.imu_source={type: line, port: 47115";
  EXPECT_THAT(lines(look({imu, port + "}"}).doubts),
              Contains(HasSubstr("belongs to the first sender")));
  EXPECT_THAT(lines(look({imu, port + ", peer: 10.0.0.7}"}).doubts), IsEmpty());
}

TEST_F(ConfigReviewTest, NamesAnInvalidRecordingFolder) {
  EXPECT_THAT(lines(look({}).faults), IsEmpty());
  const auto config = value_of(parse_config(kValid, folder_.file("robot.yaml")));
  EXPECT_THAT(lines(review(config).faults), IsEmpty()) << "the working directory";
  ServerConfig wrong = config;
  wrong.recorder.folder = folder_.file("clip.avi");
  EXPECT_THAT(lines(review(wrong).faults), Contains(HasSubstr("is no folder")));
}

TEST_F(ConfigReviewTest, PrintsJson) {
  const std::string text = review_json(look({"map.mode=frozen"}));
  EXPECT_THAT(text, HasSubstr("\"usable\": false"));
  EXPECT_THAT(text, HasSubstr("\"path\": \"map.mode\""));
}

}  // namespace
}  // namespace fiducap
