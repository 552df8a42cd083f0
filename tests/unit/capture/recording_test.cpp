#include "capture/recording/recording.hpp"

#include <gmock/gmock.h>

#include "base/pose.hpp"
#include "support/lens_models.hpp"
#include "unit/capture/recording_folder.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST_F(CornerRecordingTest, ReadsTheCalibrationsOfItsFiles) {
  write_imu("");
  const RecordingInfo read = info();
  EXPECT_EQ(read.name, folder_.path().filename().string());
  ASSERT_EQ(read.cameras.size(), 1u);
  const CameraMount& mount = read.cameras[0];
  EXPECT_EQ(parts_of(mount.model),
            parts_of(radial_tangential({40, 30, 20, 21, 19.5, 14.5}, {-0.1, 0.01, 0.001, 0.002})));
  EXPECT_NEAR((mount.X_BV.q * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 0,
              1e-12);
  EXPECT_EQ(mount.X_BV.p, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(mount.time_shift, std::chrono::milliseconds(2));
  EXPECT_EQ(mount.position_sigma_m, 0.01);
  EXPECT_EQ(mount.rotation_sigma_rad, 0.02);
  EXPECT_EQ(mount.rate_hz, 10);
  EXPECT_THAT(read.has_images, ElementsAre(false));
  EXPECT_THAT(read.has_corners, ElementsAre(true));
  ASSERT_TRUE(read.imu);
  EXPECT_EQ(read.imu->accel_walk_m_s3_rtHz, 4e-4);
  EXPECT_EQ(read.imu->gyro_noise_rad_s_rtHz, 1e-4);
}

TEST_F(CornerRecordingTest, ReadsTagsYamlWithUnknownKeys) {
  const RecordingInfo read = info();
  EXPECT_EQ(read.tag_family, "tag25h9");
  EXPECT_EQ(read.tag_size_m, 0.2);
  EXPECT_EQ(read.tag_sizes_m, (std::map<int, double>{{7, 0.05}}));
  EXPECT_THAT(read.ignore_tags, ElementsAre(9, 11));
  EXPECT_EQ(read.max_hamming, 1);
  EXPECT_EQ(read.reference_tag, 3);
  ASSERT_EQ(read.known_tags.size(), 1u);
  EXPECT_EQ(read.known_tags[0].X_WT.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(read.known_tags[0].X_WT.q.w(), 0.5);
  EXPECT_EQ(read.known_tags[0].rotation_sigma_rad, 0.02);
}

TEST_F(CornerRecordingTest, OpensByItsMavFolder) {
  const RecordingInfo read = value_of(read_recording_info((folder_.path() / "mav0").string()));
  EXPECT_EQ(read.name, folder_.path().filename().string());
  EXPECT_TRUE(open_recording(read, {}, clock_));
}

TEST_F(CornerRecordingTest, JoinsCornersOfOneStampAndKeepsEmptyFrames) {
  EXPECT_THAT(played_tags(), ElementsAre(0, 2, 0, 1));
  const auto samples = play();
  EXPECT_THAT(stamps_ms(samples), ElementsAre(1'000'002, 1'000'102, 1'000'202, 1'000'302))
      << "time shift 2 ms";
  const auto& tags = std::get<CornerFrame>(samples[1]).tags;
  EXPECT_EQ(tags[0].tag_id, 5);
  EXPECT_EQ(tags[0].corners_px[0], Eigen::Vector2d(1.5, 2.5));
  EXPECT_EQ(tags[0].corners_px[3], Eigen::Vector2d(7, 8));
  EXPECT_EQ(tags[1].hamming, 1);
}

TEST_F(CornerRecordingTest, RotatesImuSamplesIntoBodyAxesAndMergesThem) {
  write_imu(
      "1000101000000,1,2,3,4,5,6\n1000102000000,0,0,0,0,0,9.81\n1000150000000,0,0,0,0,0,9.81\n");
  const auto samples = play();
  EXPECT_THAT(stamps_ms(samples), ElementsAre(1'000'002, 1'000'101, 1'000'102, 1'000'102, 1'000'150,
                                              1'000'202, 1'000'302));
  const ImuSample& imu = std::get<ImuSample>(samples[1]);
  EXPECT_NEAR((imu.w_WB_B - Eigen::Vector3d(-2, 1, 3)).norm(), 0, 1e-12);
  EXPECT_NEAR((imu.f_B - Eigen::Vector3d(-5, 4, 6)).norm(), 0, 1e-12);
  EXPECT_TRUE(std::holds_alternative<ImuSample>(samples[2])) << "first of equal times";
}

TEST_F(RecordingTest, PlaysImagesOfAEurocFolderInGray) {
  folder_.write("mav0/cam0/sensor.yaml", kCamera);
  folder_.write("mav0/cam0/data.csv",
                "#timestamp [ns],filename\n1000000000000,1000000000000.png\n"
                "1000100000000,1000100000000.png\n");
  write_image("1000000000000.png");
  write_image("1000100000000.png");
  const auto samples = play();
  EXPECT_THAT(stamps_ms(samples), ElementsAre(1'000'002, 1'000'102));
  const auto& image = std::get<CameraFrame>(samples[0]).image;
  ASSERT_TRUE(image);
  EXPECT_EQ(image->width, 40);
  EXPECT_EQ(image->height, 30);
  EXPECT_EQ(image->pixels[0], 0);
  EXPECT_EQ(image->pixels[2 * 40 + 10], 34);
}

TEST_F(CornerRecordingTest, PrefersImagesToCorners) {
  folder_.write("mav0/cam0/data.csv", "1000000000000,a.jpg\n");
  write_image("a.jpg");
  const auto samples = play();
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_TRUE(std::holds_alternative<CameraFrame>(samples[0]));
}

TEST_F(RecordingTest, FindsImagesByTheirStamps) {
  write_basics();
  folder_.write("mav0/cam0/data.csv", "1000000000000\n1000100000000\n");
  write_image("1000000000000.jpg");
  write_image("1000100000000.png");
  EXPECT_EQ(play().size(), 2u);
}

TEST_F(RecordingTest, NamesMissingFiles) {
  EXPECT_THAT(error_of(read_recording_info(folder_.text() + "/nowhere")),
              HasSubstr("no such folder"));
  EXPECT_THAT(info_error(), HasSubstr("no folder mav0"));
  folder_.write("mav0/body.yaml", "comment: x\n");
  EXPECT_THAT(info_error(), HasSubstr("cam0/sensor.yaml is missing"));
  folder_.write("mav0/cam0/data.csv", "");
  EXPECT_THAT(info_error(), HasSubstr("cam0/sensor.yaml: no such file"));
  write_basics();
  EXPECT_THAT(error_of(open_recording(info(), {}, clock_)), HasSubstr("neither images"));
  folder_.write("mav0/imu0/data.csv", "");
  EXPECT_THAT(info_error(), HasSubstr("imu0/sensor.yaml: no such file"));
}

TEST_F(RecordingTest, NamesAllFaultsOfCalibrationTagsAndOdometry) {
  folder_.write(
      "mav0/cam0/sensor.yaml",
      "camera_model: pinhole\nresolution: [40]\nintrinsics: [1, 2, x, 4]\ndistortion_model: ds\n"
      "T_BS: {rows: 4, cols: 4, data: [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}\n");
  for (const char* fault : {"resolution needs 2 numbers, has 1", "intrinsics must be a list",
                            "lens model ds is not supported", "T_BS has no rotation"})
    EXPECT_THAT(info_error(), HasSubstr(fault));
  folder_.write("mav0/cam0/sensor.yaml", "a: [1, 2\nb: }");
  EXPECT_THAT(info_error(), HasSubstr("is not YAML"));
  write_basics();
  folder_.write("mav0/odom0/data.csv", "1000100000000,1,2,3,1,0,0,0\n");
  folder_.write("mav0/odom0/sensor.yaml", "move_noise_m: 0\n");
  EXPECT_THAT(info_error(), HasSubstr("move_noise_m"));
  folder_.write("mav0/tags.yaml", "ignore_tags: [9, 1e300]\n");
  EXPECT_THAT(info_error(), HasSubstr("whole numbers"));
}

TEST_F(CornerRecordingTest, ReadsTruthWithAndWithoutVelocityAndBiases) {
  write_truth(
      "#header\n1000000000000,1,2,3,0,1,0,0,4,5,6,7,8,9,10,11,12\n1000100000000,1,2,3,0,0,0,0,4,5,"
      "6\n");
  folder_.write("truth/reference_poses.csv", "#header\n1000000000000,1,2,3,0.5,0.5,0.5,0.5\n");
  const auto truth = value_of(read_truth(folder_.text()));
  ASSERT_EQ(truth.size(), 1u) << "a quaternion of zeros is invalid";
  EXPECT_EQ(truth[0].X_WB.q.x(), 1);
  EXPECT_EQ(truth[0].v_WB, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(truth[0].bias_w, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(truth[0].bias_f, Eigen::Vector3d(10, 11, 12));
  const auto reference = value_of(read_reference_poses(folder_.text()));
  ASSERT_EQ(reference.size(), 1u);
  EXPECT_EQ(reference[0].v_WB, Eigen::Vector3d(0, 0, 0));
}

TEST_F(CornerRecordingTest, DropsAndReportsTruthThatGoesBackwards) {
  std::string rows;
  for (const char* stamp :
       {"1000000000000", "1000200000000", "1000100000000", "1000200000000", "1000300000000"})
    rows += stamp + std::string(",1,2,3,1,0,0,0\n");
  write_truth(rows);
  const auto truth = value_of(read_truth(folder_.text()));
  ASSERT_EQ(truth.size(), 3u) << "a binary search needs increasing times";
  EXPECT_LT(truth[1].at, truth[2].at);
  EXPECT_THAT(log_.text(), HasSubstr("stamps of 1 of 5 lines are out of order"));
  EXPECT_THAT(log_.text(), HasSubstr("1 lines left out whose time does not increase"));
}

TEST_F(CornerRecordingTest, ReadsTrueTagsAndExtrinsics) {
  folder_.write("truth/tags.csv",
                "id,size,px,py,pz,qw,qx,qy,qz\n3,0.16,1,2,3,1,0,0,0\n4,0.2,1,2,3,0,1,0,0");
  folder_.write(
      "truth/extrinsics.yaml",
      "cam0:\n  T_BS: {cols: 4, rows: 4, data: [1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1]}\n"
      "timeshift_cam_imu: 0\n");
  const auto tags = value_of(read_truth_tags(folder_.text()));
  ASSERT_EQ(tags.size(), 2u);
  EXPECT_EQ(tags[1].tag_id, 4);
  EXPECT_EQ(tags[1].edge_m, 0.2);
  EXPECT_EQ(tags[1].X_WT.q.x(), 1);
  const auto X_BV = value_of(read_truth_extrinsics(folder_.text()));
  ASSERT_EQ(X_BV.size(), 1u);
  EXPECT_EQ(X_BV[0].p, Eigen::Vector3d(5, 6, 7));
}

TEST_F(CornerRecordingTest, HasNoTruthWithoutItsFiles) {
  EXPECT_TRUE(read_truth(folder_.text()).value().empty());
  EXPECT_TRUE(read_reference_poses(folder_.text()).value().empty());
  EXPECT_TRUE(read_truth_tags(folder_.text()).value().empty());
  EXPECT_TRUE(read_truth_extrinsics(folder_.text()).value().empty());
}

TEST_F(CornerRecordingTest, ReadsOdometryInBodyAxes) {
  folder_.write("mav0/odom0/sensor.yaml",
                "T_BS: {cols: 4, rows: 4, data: [0, -1, 0, 0.5, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, "
                "1]}\nturn_noise_rad: 0.005\n");
  folder_.write("mav0/odom0/data.csv",
                "#timestamp [ns],p,p,p,q,q,q,q,v\n"
                "1000100000000,1,2,3,1,0,0,0,9\n1000200000000,2,2,3,1,0,0,0,9\n"
                "1000150000000,7,7,7,1,0,0,0,9\n1000300000000,2,2,x,1,0,0,0,9\n"
                "1000400000000,4,2,3,1,0,0,0,9\n");
  const RecordingInfo read = info();
  ASSERT_TRUE(read.odometry);
  const Odometry& odometry = *read.odometry;
  ASSERT_EQ(odometry.poses.size(), 3U) << "drops an unreadable line and one that goes back";
  EXPECT_EQ(odometry.turn_noise_rad, 0.005);
  // The body's origin is half a metre along the sensor's y axis.
  EXPECT_LT((odometry.poses[0].X_WB.p - Eigen::Vector3d(1, 2.5, 3)).norm(), 1e-12);
  const auto moved =
      odometry.motion(instant_from_ns(1000150000000), instant_from_ns(1000300000000)).value();
  EXPECT_LT((moved.p - Eigen::Vector3d(0, 1.5, 0)).norm(), 1e-9) << "between its poses, in B";
  EXPECT_FALSE(odometry.motion(instant_from_ns(1000150000000), instant_from_ns(1000500000000)));
}

TEST_F(CornerRecordingTest, ReadsOdometryOfAPhoneFromTheFirstFrame) {
  folder_.write("vio_odom.csv",
                "pose_id,t,x,y,z,qw,qx,qy,qz\n0,0.0,0,0,0,1,0,0,0\n1,0.1,0,1,2,1,0,0,0");
  const RecordingInfo read = info();
  ASSERT_TRUE(read.odometry);
  const auto& poses = read.odometry->poses;
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(to_ns(poses[0].at), 1000000000000);
  EXPECT_EQ(to_ns(poses[1].at), 1000100000000);
  EXPECT_LT((poses[1].X_WB.p - Eigen::Vector3d(0, -2, 1)).norm(), 1e-12) << "z is vertical";
}

}  // namespace
}  // namespace fiducap
