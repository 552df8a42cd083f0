#include "capture/recording/recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/pose.hpp"
#include "unit/capture/recording_folder.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST_F(RecordingTest, SaysWhatItsFilesSay) {
  write_corners();
  write_imu("");
  const auto info = read_recording_info(folder_.text());
  ASSERT_TRUE(info) << info.error().text();
  EXPECT_EQ(info->name, folder_.path().filename().string());
  ASSERT_EQ(info->cameras.size(), 1u);
  const CameraMount& mount = info->cameras[0];
  EXPECT_EQ(mount.model.width, 40);
  EXPECT_EQ(mount.model.height, 30);
  EXPECT_EQ(mount.model.fv, 21);
  EXPECT_EQ(mount.model.cu, 19.5);
  EXPECT_EQ(mount.model.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(mount.model.coefficients, (std::array<double, 5>{-0.1, 0.01, 0.001, 0.002, 0}));
  EXPECT_NEAR((mount.X_BV.q * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 0,
              1e-12);
  EXPECT_EQ(mount.X_BV.p, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(mount.time_shift, std::chrono::milliseconds(2));
  EXPECT_EQ(mount.position_sigma_m, 0.01);
  EXPECT_EQ(mount.rotation_sigma_rad, 0.02);
  EXPECT_EQ(mount.rate_hz, 10);
  EXPECT_THAT(info->has_images, ElementsAre(false));
  EXPECT_THAT(info->has_corners, ElementsAre(true));
  ASSERT_TRUE(info->imu);
  EXPECT_EQ(info->imu->accel_walk_m_s3_rtHz, 4e-4);
  EXPECT_EQ(info->imu->gyro_noise_rad_s_rtHz, 1e-4);
}

TEST_F(RecordingTest, SaysWhatTagsYamlSaysAndToleratesTheKeysOfOthers) {
  write_corners();
  const auto info = read_recording_info(folder_.text());
  ASSERT_TRUE(info) << info.error().text();
  EXPECT_EQ(info->tag_family, "tag25h9");
  EXPECT_EQ(info->tag_size_m, 0.2);
  EXPECT_EQ(info->tag_sizes_m, (std::map<int, double>{{7, 0.05}}));
  EXPECT_THAT(info->ignore_tags, ElementsAre(9, 11));
  EXPECT_EQ(info->max_hamming, 1);
  EXPECT_EQ(info->reference_tag, 3);
  ASSERT_EQ(info->known_tags.size(), 1u);
  EXPECT_EQ(info->known_tags[0].X_WT.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(info->known_tags[0].X_WT.q.w(), 0.5);
  EXPECT_EQ(info->known_tags[0].rotation_sigma_rad, 0.02);
}

TEST_F(RecordingTest, OpensByItsMavFolderToo) {
  write_corners();
  const auto info = read_recording_info((folder_.path() / "mav0").string());
  ASSERT_TRUE(info) << info.error().text();
  EXPECT_EQ(info->name, folder_.path().filename().string());
  EXPECT_TRUE(open_recording(*info, {}, clock_));
}

TEST_F(RecordingTest, CornersOfOneStampAreOneFrameAndFramesWithoutTagsComeOutEmpty) {
  write_corners();
  const auto samples = play();
  EXPECT_THAT(stamps_ms(samples), ElementsAre(1'000'002, 1'000'102, 1'000'202, 1'000'302))
      << "time shift 2 ms";
  std::vector<std::size_t> tags;
  for (const SensorSample& sample : samples)
    tags.push_back(std::get<CornerFrame>(sample).tags.size());
  EXPECT_THAT(tags, ElementsAre(0, 2, 0, 1));
  const TagSighting& tag = std::get<CornerFrame>(samples[1]).tags[0];
  EXPECT_EQ(tag.tag_id, 5);
  EXPECT_EQ(tag.corners_px[0], Eigen::Vector2d(1.5, 2.5));
  EXPECT_EQ(tag.corners_px[3], Eigen::Vector2d(7, 8));
  EXPECT_EQ(std::get<CornerFrame>(samples[1]).tags[1].hamming, 1);
}

TEST_F(RecordingTest, WithoutFramesCsvTheFramesComeFromTheDetections) {
  write_corners(kCorners, "");
  EXPECT_THAT(stamps_ms(play()), ElementsAre(1'000'102, 1'000'302));
}

TEST_F(RecordingTest, ImuSamplesAreTurnedIntoBodyAxesAndMergedByTime) {
  write_corners();
  write_imu(
      "1000101000000,1,2,3,4,5,6\n1000102000000,0,0,0,0,0,9.81\n1000150000000,0,0,0,0,0,9.81\n");
  const auto samples = play();
  EXPECT_THAT(stamps_ms(samples), ElementsAre(1'000'002, 1'000'101, 1'000'102, 1'000'102, 1'000'150,
                                              1'000'202, 1'000'302));
  const ImuSample& imu = std::get<ImuSample>(samples[1]);
  EXPECT_NEAR((imu.w_WB_B - Eigen::Vector3d(-2, 1, 3)).norm(), 0, 1e-12);
  EXPECT_NEAR((imu.f_B - Eigen::Vector3d(-5, 4, 6)).norm(), 0, 1e-12);
  EXPECT_TRUE(std::holds_alternative<ImuSample>(samples[2]))
      << "the IMU first where times are equal";
}

TEST_F(RecordingTest, SeveralCamerasComeMergedByTime) {
  write_corners();
  folder_.write("mav0/cam1/sensor.yaml", kCamera);
  folder_.write("mav0/tags1/data.csv", "1000150000000,5,0,1,2,3,4,5,6,7,8\n");
  std::vector<int> cameras;
  for (const SensorSample& sample : play()) cameras.push_back(std::get<CornerFrame>(sample).camera);
  EXPECT_THAT(cameras, ElementsAre(0, 0, 1, 0, 0));
}

TEST_F(RecordingTest, ImagesOfAPlainEurocFolderComeOutGray) {
  folder_.write("mav0/cam0/sensor.yaml", kCamera);
  folder_.write(
      "mav0/cam0/data.csv",
      "#timestamp "
      "[ns],filename\n1000000000000,1000000000000.png\n1000100000000,1000100000000.png\n");
  write_image("1000000000000.png");
  write_image("1000100000000.png");
  const auto samples = play();
  EXPECT_THAT(stamps_ms(samples), ElementsAre(1'000'002, 1'000'102));
  const CameraFrame& frame = std::get<CameraFrame>(samples[0]);
  ASSERT_TRUE(frame.image);
  EXPECT_EQ(frame.image->width, 40);
  EXPECT_EQ(frame.image->height, 30);
  EXPECT_EQ(frame.image->pixels[0], 0);
  EXPECT_EQ(frame.image->pixels[2 * 40 + 10], 34);
}

TEST_F(RecordingTest, ImagesWinOverCorners) {
  write_corners();
  folder_.write("mav0/cam0/data.csv", "1000000000000,a.jpg\n");
  write_image("a.jpg");
  const auto samples = play();
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_TRUE(std::holds_alternative<CameraFrame>(samples[0]));
}

TEST_F(RecordingTest, AListWithoutFileNamesMeansImagesNamedByTheirStamp) {
  write_basics();
  folder_.write("mav0/cam0/data.csv", "1000000000000\n1000100000000\n");
  write_image("1000000000000.jpg");
  write_image("1000100000000.png");
  EXPECT_EQ(play().size(), 2u);
}

TEST_F(RecordingTest, MissingPiecesAreNamed) {
  const auto error_of = [&] {
    const auto info = read_recording_info(folder_.text());
    return info ? std::string("none") : info.error().text();
  };
  EXPECT_THAT(read_recording_info(folder_.text() + "/nowhere").error().text(),
              HasSubstr("no such folder"));
  EXPECT_THAT(error_of(), HasSubstr("no folder mav0"));
  folder_.write("mav0/body.yaml", "comment: x\n");
  EXPECT_THAT(error_of(), HasSubstr("cam0/sensor.yaml is missing"));
  folder_.write("mav0/cam0/data.csv", "");
  EXPECT_THAT(error_of(), HasSubstr("cam0/sensor.yaml: no such file"));
  write_basics();
  EXPECT_EQ(error_of(), "none");
  folder_.write("mav0/imu0/data.csv", "");
  EXPECT_THAT(error_of(), HasSubstr("imu0/sensor.yaml: no such file"));
}

TEST_F(RecordingTest, ARecordingWithoutAnySensorDataIsRefused) {
  write_basics();
  const auto refused = open_recording(read_recording_info(folder_.text()).value(), {}, clock_);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), HasSubstr("neither images"));
}

TEST_F(RecordingTest, AllFaultsOfACalibrationAreNamedAtOnce) {
  folder_.write(
      "mav0/cam0/sensor.yaml",
      "camera_model: pinhole\nresolution: [40]\nintrinsics: [1, 2, x, 4]\ndistortion_model: ds\n"
      "T_BS: {rows: 4, cols: 4, data: [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}\n");
  const auto info = read_recording_info(folder_.text());
  ASSERT_FALSE(info);
  for (const char* fault : {"resolution needs 2 numbers, has 1", "intrinsics must be a list",
                            "distortion model ds is not supported", "T_BS has no rotation"}) {
    EXPECT_THAT(info.error().text(), HasSubstr(fault));
  }
  folder_.write("mav0/cam0/sensor.yaml", "a: [1, 2\nb: }");
  EXPECT_THAT(read_recording_info(folder_.text()).error().text(), HasSubstr("is not YAML"));
}

TEST_F(RecordingTest, TruthIsReadWithVelocityAndBiasesAndWithoutThem) {
  write_corners();
  folder_.write("mav0/state_groundtruth_estimate0/data.csv",
                "#header\n1000000000000,1,2,3,0,1,0,0,4,5,6,7,8,9,10,11,12\n1000100000000,1,2,3,0,"
                "0,0,0,4,5,6\n");
  folder_.write("truth/reference_poses.csv", "#header\n1000000000000,1,2,3,0.5,0.5,0.5,0.5\n");
  const auto truth = read_truth(folder_.text());
  ASSERT_TRUE(truth);
  ASSERT_EQ(truth->size(), 1u) << "a quaternion of zeros is none";
  EXPECT_EQ(truth->front().X_WB.q.x(), 1);
  EXPECT_EQ(truth->front().v_WB, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(truth->front().bias_w, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(truth->front().bias_f, Eigen::Vector3d(10, 11, 12));
  const auto reference = read_reference_poses(folder_.text());
  ASSERT_TRUE(reference);
  ASSERT_EQ(reference->size(), 1u);
  EXPECT_EQ(reference->front().v_WB, Eigen::Vector3d(0, 0, 0));
}

TEST_F(RecordingTest, TruthThatGoesBackwardsIsLeftOutAndSaid) {
  write_corners();
  const std::string pose = ",1,2,3,1,0,0,0\n";
  folder_.write("mav0/state_groundtruth_estimate0/data.csv",
                "1000000000000" + pose + "1000200000000" + pose + "1000100000000" + pose +
                    "1000200000000" + pose + "1000300000000" + pose);
  const auto truth = read_truth(folder_.text());
  ASSERT_TRUE(truth);
  ASSERT_EQ(truth->size(), 3u) << "who looks for a time by halves would miss what is there";
  EXPECT_LT(truth->at(1).at, truth->at(2).at);
  EXPECT_THAT(log_text(), HasSubstr("stamps of 1 of 5 lines are out of order"));
  EXPECT_THAT(log_text(), HasSubstr("1 lines left out whose time does not increase"));
}

TEST_F(RecordingTest, OneStampOfTheTruthFromTheFutureCostsItself) {
  write_corners();
  const std::string pose = ",1,2,3,1,0,0,0\n";
  folder_.write("mav0/state_groundtruth_estimate0/data.csv",
                "3900000000000000000" + pose + "1000100000000" + pose + "1000200000000" + pose);
  const auto truth = read_truth(folder_.text());
  ASSERT_TRUE(truth);
  EXPECT_EQ(truth->size(), 2u);
}

TEST_F(RecordingTest, AnIdToIgnoreThatIsNoWholeNumberIsAFault) {
  write_basics();
  folder_.write("mav0/tags.yaml", "ignore_tags: [9, 1e300]\n");
  EXPECT_THAT(read_recording_info(folder_.text()).error().text(), HasSubstr("whole numbers"));
}

TEST_F(RecordingTest, TrueTagsAndExtrinsicsAreRead) {
  write_corners();
  folder_.write("truth/tags.csv",
                "id,size,px,py,pz,qw,qx,qy,qz\n3,0.16,1,2,3,1,0,0,0\n4,0.2,1,2,3,0,1,0,0");
  folder_.write(
      "truth/extrinsics.yaml",
      "cam0:\n  T_BS: {cols: 4, rows: 4, data: [1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1]}\n"
      "timeshift_cam_imu: 0\n");
  const auto tags = read_truth_tags(folder_.text());
  ASSERT_TRUE(tags);
  ASSERT_EQ(tags->size(), 2u);
  EXPECT_EQ(tags->at(1).tag_id, 4);
  EXPECT_EQ(tags->at(1).edge_m, 0.2);
  EXPECT_EQ(tags->at(1).X_WT.q.x(), 1);
  const auto X_BV = read_truth_extrinsics(folder_.text());
  ASSERT_TRUE(X_BV);
  ASSERT_EQ(X_BV->size(), 1u);
  EXPECT_EQ(X_BV->front().p, Eigen::Vector3d(5, 6, 7));
}

TEST_F(RecordingTest, WithoutTruthThereIsNoneAndThatIsNoError) {
  write_corners();
  EXPECT_TRUE(read_truth(folder_.text()).value().empty());
  EXPECT_TRUE(read_reference_poses(folder_.text()).value().empty());
  EXPECT_TRUE(read_truth_tags(folder_.text()).value().empty());
  EXPECT_TRUE(read_truth_extrinsics(folder_.text()).value().empty());
}

TEST_F(RecordingTest, OdometryIsReadInBodyAxes) {
  write_corners();
  folder_.write(
      "mav0/odom0/sensor.yaml",
      "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.5, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, "
      "0, 1]\nturn_noise_rad: 0.005\n");
  folder_.write("mav0/odom0/data.csv",
                "#timestamp [ns],p,p,p,q,q,q,q,v\n"
                "1000100000000,1,2,3,1,0,0,0,9\n"
                "1000200000000,2,2,3,1,0,0,0,9\n"
                "1000150000000,7,7,7,1,0,0,0,9\n"
                "1000300000000,2,2,x,1,0,0,0,9\n"
                "1000400000000,4,2,3,1,0,0,0,9\n");
  const auto info = read_recording_info(folder_.text());
  ASSERT_TRUE(info) << info.error().text();
  ASSERT_TRUE(info->odometry);
  const Odometry& odometry = *info->odometry;
  ASSERT_EQ(odometry.poses.size(), 3U) << "a broken line and one that goes back are left out";
  EXPECT_EQ(odometry.turn_noise_rad, 0.005);
  // The body's origin is half a metre along the sensor's y axis.
  EXPECT_LT((odometry.poses[0].X_WB.p - Eigen::Vector3d(1, 2.5, 3)).norm(), 1e-12);
  const auto moved =
      odometry.motion(instant_from_ns(1000150000000), instant_from_ns(1000300000000));
  ASSERT_TRUE(moved);
  EXPECT_LT((moved->p - Eigen::Vector3d(0, 1.5, 0)).norm(), 1e-9) << "between its poses, in B";
  EXPECT_FALSE(odometry.motion(instant_from_ns(1000150000000), instant_from_ns(1000500000000)));
}

TEST_F(RecordingTest, OdometryOfAPhoneCountsFromTheFirstFrameAndStandsUp) {
  write_corners();
  folder_.write("vio_odom.csv",
                "pose_id,t,x,y,z,qw,qx,qy,qz\n0,0.0,0,0,0,1,0,0,0\n1,0.1,0,1,2,1,0,0,0");
  const auto info = read_recording_info(folder_.text());
  ASSERT_TRUE(info) << info.error().text();
  ASSERT_TRUE(info->odometry);
  ASSERT_EQ(info->odometry->poses.size(), 2U);
  EXPECT_EQ(to_ns(info->odometry->poses[0].at), 1000000000000);
  EXPECT_EQ(to_ns(info->odometry->poses[1].at), 1000100000000);
  EXPECT_LT((info->odometry->poses[1].X_WB.p - Eigen::Vector3d(0, -2, 1)).norm(), 1e-12);
}

TEST_F(RecordingTest, OdometryWithImpossibleNoiseIsRefused) {
  write_corners();
  folder_.write("mav0/odom0/data.csv", "1000100000000,1,2,3,1,0,0,0\n");
  folder_.write("mav0/odom0/sensor.yaml", "move_noise_m: 0\n");
  const auto info = read_recording_info(folder_.text());
  ASSERT_FALSE(info);
  EXPECT_NE(info.error().text().find("move_noise_m"), std::string::npos) << info.error().text();
}

}  // namespace
}  // namespace fiducap
