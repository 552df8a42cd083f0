#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <random>

#include <nlohmann/json.hpp>

#include "base/text.hpp"
#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_writer.hpp"
#include "simulation/simulation.hpp"
#include "support/command_run.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/calibrate/calibrate.hpp"
#include "unit/calibration/calibration_scene.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

const ImuNoise kTrue{2e-3, 2e-5, 2e-2, 5e-4, 200.0};

class CalibrateImu : public VerbTest<CalibrateImuArguments> {
 protected:
  CalibrateImu() { arguments_ = {recording_, folder_.file("out")}; }

  /// An IMU on a table; `disturb` may move it.
  void record(double seconds, const std::function<void(double t_s, ImuSample&)>& disturb = {}) {
    RecordingInfo info;
    info.folder = recording_;
    info.imu = kTrue;
    info.cameras = {CameraMount{{640, 480, 400, 400, 320, 240, Distortion::kNone, {}}, Pose{}}};
    info.has_images = {false};
    info.has_corners = {false};
    auto writer = value_of(RecordingWriter::create(info));
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    const auto three = [&](double density) -> Eigen::Vector3d {
      const double x = normal(random), y = normal(random), z = normal(random);
      return density * std::sqrt(kTrue.rate_hz) * Eigen::Vector3d(x, y, z);
    };
    for (int i = 0; i <= static_cast<int>(seconds * kTrue.rate_hz); ++i) {
      ImuSample imu{instant_from_ns(1'000'000'000LL + 5'000'000LL * i),
                    Eigen::Vector3d(0.01, -0.02, 0.03) + three(kTrue.gyro_noise_rad_s_rtHz),
                    Eigen::Vector3d(0.1, 0.2, 9.81) + three(kTrue.accel_noise_m_s2_rtHz)};
      if (disturb) disturb(i / kTrue.rate_hz, imu);
      ASSERT_TRUE(writer.write(imu));
    }
    ASSERT_TRUE(writer.finish());
  }
  void expect_refused(const char* reason) {
    EXPECT_THAT(refused(run_calibrate_imu), HasSubstr(reason));
    EXPECT_FALSE(std::filesystem::exists(folder_.file("out/imu.yaml")));
  }

  std::string recording_{folder_.file("still")};
};

TEST_F(CalibrateImu, WritesConfigurationPageAndJsonAndKeepsAnEarlierOne) {
  folder_.write("out/imu.yaml", "of another IMU\n");
  record(100);
  std::filesystem::remove_all(recording_ + "/mav0/cam0");  // no camera is needed
  run(run_calibrate_imu);
  EXPECT_EQ(content_of(folder_.file("out/imu.yaml.before")), "of another IMU\n");
  EXPECT_THAT(err_, HasSubstr("is kept as"));
  const auto noise = value_of(read_imu_noise(folder_.file("out/imu.yaml")));
  // 3 axes of 20 000 samples: √(3/4n) is 0.35 %, four sigma.
  EXPECT_NEAR(noise.gyro_noise_rad_s_rtHz / kTrue.gyro_noise_rad_s_rtHz, 1, 0.014);
  EXPECT_NEAR(noise.accel_noise_m_s2_rtHz / kTrue.accel_noise_m_s2_rtHz, 1, 0.014);
  EXPECT_NEAR(noise.rate_hz, 200, 1e-6);
  EXPECT_THAT(out_, HasSubstr("gyro: no bias walk to be seen"));
  EXPECT_THAT(content_of(folder_.file("out/imu.yaml")), HasSubstr("upper bound"));
  EXPECT_THAT(content_of(folder_.file("out/allan.html")), HasSubstr("Allan deviation"));
  arguments_.json = true;
  const auto report = nlohmann::json::parse(run(run_calibrate_imu));
  EXPECT_EQ(report["axes"].size(), kImuAxes);
  EXPECT_TRUE(report["gyroscope_random_walk_is_bound"].get<bool>());
  EXPECT_EQ(report["lost"].get<int>(), 0);
}

TEST_F(CalibrateImu, RefusesARotation) {
  record(100, [](double t_s, ImuSample& imu) {
    if (t_s > 42.1 && t_s < 43.9) imu.w_WB_B.y() += 0.1;
  });
  expect_refused("did not lie still: gyro y moved 42 s");
}

TEST_F(CalibrateImu, RefusesAnImpactOnTheTable) {
  record(100, [](double t_s, ImuSample& imu) {
    if (t_s > 42.1 && t_s < 42.4) imu.f_B.z() += 8 * std::sin(300 * t_s);
  });
  expect_refused("accelerometer z moved 42 s");
}

TEST_F(CalibrateImu, RefusesHalfAMinute) {
  record(30);
  expect_refused("at least 60 s");
}

constexpr double kStampError_s = 0.012;  // stamps are too late: the shift is negative
constexpr double kTime_s = 0.001;
constexpr double kSigmas = 3.5;  // six numbers: 3 sigma of one is 3.5 of the worst

class CalibrateExtrinsics : public VerbTest<CalibrateExtrinsicsArguments> {
 protected:
  void record(double seconds, bool with_imu = true) {
    simulation::RoomConfig room;
    room.preset = "table";
    simulation::SimulatedBodyConfig body;
    CameraMount camera;
    camera.model = {
        752, 480, 460, 460, 376, 240, Distortion::kRadialTangential, {-0.28, 0.07, 2e-4, -1e-4, 0}};
    camera.X_BV = simulation::forward_camera();
    camera.X_BV.p = {0.06, -0.015, 0.02};
    body.cameras = {camera};
    body.camera.images = false;
    body.trajectory.kind = "table";
    body.trajectory.duration_s = seconds;
    body.faults.image_stamp_error_s = kStampError_s;
    truth_ = camera.X_BV;
    const auto source = value_of(
        simulation::make_simulated_source(room, body, instant_from_ns(1'000'000'000), nullptr));
    camera.X_BV.p += Eigen::Vector3d(0.012, -0.008, 0.01);
    camera.X_BV.q = (camera.X_BV.q * exp_so3({0.02, -0.015, 0.01})).normalized();
    RecordingInfo info;
    info.folder = recording_;
    info.cameras = {camera};
    info.has_images = {false};
    info.has_corners = {true};
    if (with_imu) info.imu = body.imu.noise;
    const auto tags = simulation::tags_of(room);
    info.tag_size_m = tags.front().edge_m;
    info.reference_tag = tags.front().tag_id;
    auto writer = value_of(RecordingWriter::create(info));
    for (auto sample = value_of(source->next({})); sample; sample = value_of(source->next({})))
      if (with_imu || !std::holds_alternative<ImuSample>(*sample))
        ASSERT_TRUE(writer.write(*sample));
    ASSERT_TRUE(writer.finish());
  }

  nlohmann::json calibrate() {
    arguments_.recording = recording_;
    arguments_.out = folder_.file("out");
    arguments_.json = true;
    return nlohmann::json::parse(run(run_calibrate_extrinsics));
  }

  std::string recording_{folder_.file("waving")};
  Pose truth_;
};

TEST_F(CalibrateExtrinsics, FindsPoseAndTimeShiftWithinTheSigmas) {
  record(40);
  const auto camera = calibrate()["cameras"][0];
  const auto chain = value_of(read_calibration(folder_.file("out/camchain-imucam.yaml"), {}));
  ASSERT_EQ(chain.size(), 1U);
  const Pose& found = chain.front().mount.X_BV;
  Eigen::Matrix<double, 6, 1> off;
  off << found.p - truth_.p, log_so3(found.q * truth_.q.conjugate());
  for (int i = 0; i < 6; ++i) {
    const double sigma = camera["sigma_m_rad"][static_cast<std::size_t>(i)].get<double>();
    EXPECT_LT(std::abs(off(i)), kSigmas * sigma) << "axis " << i;
    EXPECT_LT(sigma, i < 3 ? 0.003 : 0.001) << "axis " << i;
  }
  EXPECT_NEAR(to_seconds(chain.front().mount.time_shift), -kStampError_s, kTime_s);
  EXPECT_NEAR(chain.front().mount.model.coefficients[0], -0.28, 1e-9);
}

TEST_F(CalibrateExtrinsics, ReportsWhatTooLittleMotionDoesNotDetermine) {
  record(1);  // the simulator rests for its first second
  const auto report = calibrate();
  EXPECT_EQ(report["verdict"], "weak");
  ASSERT_GE(report["cameras"][0]["not_observed"].size(), 3U);
  EXPECT_THAT(report["cameras"][0]["not_observed"][0]["motion"].get<std::string>(),
              HasSubstr("rotate quickly"));
}

TEST_F(CalibrateExtrinsics, NeedsAnImu) {
  record(3, false);
  arguments_.recording = recording_;
  EXPECT_THAT(refused(run_calibrate_extrinsics), HasSubstr("no IMU"));
}

TEST(KalibrCamchain, RoundTripKeepsEveryValue) {
  CameraMount mount;
  mount.model = {
      640, 400, 300, 301, 320, 200, Distortion::kEquidistant, {0.1, -0.02, 0.003, -0.0004, 0}};
  mount.X_BV = {exp_so3({0.3, -1.1, 0.7}), {0.1, -0.2, 0.3}};
  mount.time_shift = std::chrono::microseconds(-12'345);
  TemporaryFolder folder;
  const auto all = value_of(
      read_calibration(folder.write("chain.yaml", to_kalibr_camchain({mount, mount}, "test")), {}));
  ASSERT_EQ(all.size(), 2U);
  const CameraMount& read = all[1].mount;
  EXPECT_LT((read.X_BV.p - mount.X_BV.p).norm(), 1e-9);
  EXPECT_LT(angle_between(read.X_BV.q, mount.X_BV.q), 1e-9);
  EXPECT_EQ(read.time_shift, mount.time_shift);
  EXPECT_EQ(read.model.distortion, mount.model.distortion);
  EXPECT_EQ(read.model.coefficients, mount.model.coefficients);
}

class CornerFile : public ::testing::Test {
 protected:
  [[nodiscard]] Expected<CalibrationData> read(const std::string& text,
                                               const std::string& board = "tags:100",
                                               const std::string& set = "", int camera = 0) const {
    CornerFileChoice choice;
    choice.path = folder_.write("corners.csv", text);
    choice.width = 640;
    choice.height = 480;
    choice.camera = camera;
    choice.set = set;
    const auto described = read_board_description(board);
    if (!described) return tl::unexpected(described.error());
    choice.board = *described;
    return read_corner_file(choice);
  }
  /// Rows of four corners of one tag.
  [[nodiscard]] Expected<CalibrationData> read_tags(const std::string& rows,
                                                    const std::string& board = "tags:100") const {
    return read("image,tag,blx,bly,brx,bry,trx,try,tlx,tly\n" + rows, board);
  }

  TemporaryFolder folder_;
};

TEST_F(CornerFile, HasTagsCornerByCornerWithColumnsInAnyOrder) {
  const auto data = value_of(
      read("u,v,corner,tag,image,note\n"
           "10,60,0,7,first,x\n60,60,1,7,first,x\n60,10,2,7,first,x\n10,10,3,7,first,x\n"));
  ASSERT_EQ(data.views.size(), 1U);
  EXPECT_EQ(data.views[0].name, "first");
  ASSERT_EQ(data.views[0].sightings.size(), 1U);
  EXPECT_EQ(data.targets[0].name, "tag 7");
  EXPECT_EQ(data.views[0].sightings[0].points[1].px, Eigen::Vector2d(60, 60));
  EXPECT_DOUBLE_EQ((data.targets[0].points[1] - data.targets[0].points[0]).norm(), 0.1);
}

TEST_F(CornerFile, HasRowsOfFourCornersOfOneCameraAndSet) {
  const std::string text =
      "set,frame,cam,id,blx,bly,brx,bry,trx,try,tlx,tly\n"
      "a,0,0,3,10,60,60,60,60,10,10,10\n"
      "b,0,0,3,11,60,60,60,60,10,10,10\n"
      "a,1,1,3,12,60,60,60,60,10,10,10\n";
  EXPECT_THAT(error_of(read(text)), HasSubstr("sets a, b: choose one with --set"));
  const auto data = value_of(read(text, "tags:100", "a", 1));
  ASSERT_EQ(data.views.size(), 1U);
  EXPECT_EQ(data.views[0].sightings[0].points[0].px.x(), 12);
}

TEST_F(CornerFile, HasBoardPointsNumberedRowByRow) {
  std::string text = "image,point,u,v\n";
  for (int i = 0; i < 6; ++i)
    text += "1," + std::to_string(i) + "," + std::to_string(100 + 20 * i) + ",50\n";
  const auto data = value_of(read(text, "points:3x2:20"));
  EXPECT_EQ(data.targets[0].points.size(), 6U);
  EXPECT_EQ(data.targets[0].points[4], Eigen::Vector3d(0.02, -0.02, 0));
}

TEST(BoardDescription, CharucoMarkersAreOnWhiteSquares) {
  const auto middle = [](const BoardDescription& board, int tag) {
    const auto first = static_cast<std::size_t>(board.first_corner_of_tag.at(tag));
    return Eigen::Vector3d((board.board.points[first] + board.board.points[first + 2]) / 2);
  };
  constexpr double kRounding = 1e-12;
  const auto black = value_of(read_board_description("charuco:3x2:30:20"));
  // b w b / w b w, from the upper left
  ASSERT_EQ(black.first_corner_of_tag.size(), 3U);
  EXPECT_LT((middle(black, 0) - Eigen::Vector3d(0.045, -0.015, 0)).norm(), kRounding);
  EXPECT_LT((middle(black, 1) - Eigen::Vector3d(0.015, -0.045, 0)).norm(), kRounding);
  const auto white = value_of(read_board_description("charuco:3x2:30:20:white"));
  EXPECT_LT((middle(white, 0) - Eigen::Vector3d(0.015, -0.015, 0)).norm(), kRounding);
}

TEST(BoardDescription, RefusesImpossibleBoards) {
  for (const char* wrong : {"", "tags", "tags:0", "tags:nan", "points:9:20", "points:9x6",
                            "charuco:5x7:20:30", "charuco:5x7:36:18:black", "grid:1x2:30:10",
                            "points:900x6:20", "grid:3x3:-3:10", "x:3x3:1"})
    EXPECT_THAT(error_of(read_board_description(wrong)), HasSubstr("--board")) << wrong;
}

TEST_F(CornerFile, OmitsTagsThatAreNotOnTheBoard) {
  const std::string rows =
      "1,0,10,60,60,60,60,10,10,10\n1,1,110,60,160,60,160,10,110,10\n"
      "1,99,210,60,260,60,260,10,210,10\n";
  EXPECT_THAT(error_of(read_tags(rows, "grid:2x1:30:10")), HasSubstr("--board"))
      << "one row of tags is no board";
  EXPECT_EQ(value_of(read_tags(rows, "grid:2x2:30:10")).views[0].sightings[0].points.size(), 8U);
}

TEST_F(CornerFile, RefusesMirroredImages) {
  EXPECT_THAT(error_of(read_tags("1,0,60,60,10,60,10,10,60,10\n2,0,70,60,10,60,10,10,70,10\n")),
              HasSubstr("mirrored"));
}

TEST_F(CornerFile, OmitsUnusableRows) {
  const auto data = value_of(read_tags(
      "1,0,nan,60,60,60,60,10,10,10\n1,1,10,60,60\n1,2,1e9,60,60,60,60,10,10,10\n"
      "1,3,10,60,60,60,60,10,10,10\n1,3,11,60,60,60,60,10,10,10\n1,-4,10,60,60,60,60,10,10,10\n"));
  ASSERT_EQ(data.views[0].sightings.size(), 1U);
  EXPECT_EQ(data.views[0].sightings[0].points[0].px.x(), 10);
}

TEST_F(CornerFile, ErrorNamesWhatIsMissing) {
  EXPECT_THAT(error_of(read("")), HasSubstr("is empty"));
  EXPECT_THAT(error_of(read("1,2,3\n")), HasSubstr("column names: image,tag,corner,u,v"));
  EXPECT_THAT(error_of(read("image,tag,corner,u,v\n", "points:3x3:20")),
              HasSubstr("image,point,u,v"));
  EXPECT_THAT(error_of(read("image,tag,corner,u,v\n")), HasSubstr("no corners"));
}

class CalibrateCorners : public VerbTest<CalibrateCameraArguments> {};

/// Corners that another program found: of two cameras, in rows of corners and in rows of tags.
TEST_F(CalibrateCorners, FindTheLensInEachKindOfTable) {
  const CameraModel truth = narrow_lens();
  CalibrationScene scene(truth);
  scene.add_tags(3, 2);
  scene.look(40, 0.1);
  std::string by_corner = "image,camera,tag,corner,u,v,note\n";
  std::string by_tag = "frame,cam,id,blx,bly,brx,bry,trx,try,tlx,tly\n";
  for (const CalibrationView& view : scene.data.views)
    for (const TargetSighting& seen : view.sightings) {
      const std::string tag = std::to_string(seen.target);
      by_corner += view.name + ",0," + tag + ",0,7,7,another camera\n";
      by_tag += view.name + ",1," + tag;
      for (const auto& point : seen.points) {
        const std::string px = shortest(point.px.x()) + "," + shortest(point.px.y());
        by_corner += view.name + ",1," + tag + "," + std::to_string(point.point) + "," + px + ",\n";
        by_tag += "," + px;
      }
      by_tag += "\n";
    }
  arguments_.camera = 1;
  arguments_.size = "752x480";
  arguments_.board = "tags:100";
  arguments_.out = folder_.file("out");
  arguments_.json = true;
  for (const std::string* table : {&by_corner, &by_tag}) {
    arguments_.corners = folder_.write("corners.csv", *table);
    run(run_calibrate_camera);
    const auto report = nlohmann::json::parse(out_);
    EXPECT_EQ(report["images"]["used"], scene.data.views.size());
    const auto fu = report["numbers"]["fu"];
    EXPECT_NEAR(fu["value"], truth.fu, 4 * fu["sigma"].get<double>());
    EXPECT_LT(fu["sigma"], 1);
    EXPECT_EQ(value_of(read_camera_calibration(folder_.file("out/camera.yaml"))).height, 480);
  }
}

}  // namespace
}  // namespace fiducap
