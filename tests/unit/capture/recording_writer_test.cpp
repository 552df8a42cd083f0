#include "capture/recording/recording_writer.hpp"

#include <gmock/gmock.h>

#include "base/pose.hpp"
#include "capture/output_file.hpp"
#include "support/fake_clock.hpp"
#include "support/lens_models.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/capture/sample_stamps.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

// The precision of the text formats.
constexpr double kCorner_px = 0.5001e-5;
constexpr double kSensor = 0.5001e-9;
// The 3 × 3 rotation is exact text; only the way from the quaternion and back rounds.
constexpr double kRotation_rad = 1e-12;

class RecordingWriterTest : public testing::Test {
 protected:
  RecordingWriterTest() {
    info_.folder = (folder_.path() / "out").string();
    for (int k = 0; k < 2; ++k) {
      CameraMount mount;
      const CameraModel pinhole{40, 30, 20.123456789012, 21, 19.5, 14.25};
      mount.model = k == 0 ? radial_tangential(pinhole, {-0.1, 1.0 / 3, 1e-5, 2e-17, 0.5})
                           : equidistant(pinhole, {-0.1, 1.0 / 3, 1e-5, 2e-17});
      mount.X_BV = {exp_so3({0.3, -1.2, 0.7 + k}), {0.1, 1.0 / 7, -0.3}};
      mount.position_sigma_m = 0.0123;
      mount.rotation_sigma_rad = 0.045;
      mount.focal_sigma = 0.07;
      mount.centre_sigma_px = 11;
      mount.k1_sigma = 0.04;
      mount.time_shift = Duration(2'500'123);
      mount.rate_hz = 29.97;
      info_.cameras.push_back(mount);
    }
    info_.imu = ImuNoise{1.25e-4, 2e-5, 3e-3, 4e-4, 400};
    info_.imu->correction = ImuCorrection{{0.1, -0.2, 1.0 / 3},
                                          Eigen::Vector3d(1.01, 0.98, 1.0 / 1.1).asDiagonal(),
                                          {0.01, 0, -0.02},
                                          Eigen::Matrix3d::Identity()};
    info_.X_BI = {exp_so3({1.0, 0.5, -2.0}), {0, 0, 0}};
    info_.tag_family = "tag25h9";
    info_.tag_size_m = 0.123;
    info_.tag_sizes_m = {{4, 0.5}, {70, 0.05}};
    info_.ignore_tags = {3, 99};
    info_.max_hamming = 1;
    info_.reference_tag = 4;
    info_.known_tags = {{4, 0.5, {exp_so3({0.1, 0.2, 0.3}), {1, 2, 1.0 / 3}}, 0.01, 0.02}};
  }
  RecordingWriter create() { return value_of(RecordingWriter::create(info_)); }
  RecordingInfo read_info() { return value_of(read_recording_info(info_.folder)); }
  std::vector<SensorSample> play() {
    return play_all(*value_of(open_recording(read_info(), {}, clock_)));
  }
  static void expect_equal(const Pose& a, const Pose& b, double position, double rotation) {
    EXPECT_NEAR((a.p - b.p).cwiseAbs().maxCoeff(), 0, position);
    EXPECT_NEAR(angle_between(a.q, b.q), 0, rotation);
  }

  TemporaryFolder folder_;
  RecordingInfo info_;
  FakeClock clock_;
};

TEST_F(RecordingWriterTest, WritesTheCalibrationAndTheTags) {
  ASSERT_TRUE(create().finish());
  const RecordingInfo back = read_info();
  ASSERT_EQ(back.cameras.size(), 2u);
  const auto parts = [](const CameraMount& m) {
    return std::tuple(parts_of(m.model), m.time_shift, m.position_sigma_m, m.rotation_sigma_rad,
                      m.focal_sigma, m.centre_sigma_px, m.k1_sigma, m.rate_hz);
  };
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(parts(back.cameras[k]), parts(info_.cameras[k]));
    expect_equal(back.cameras[k].X_BV, info_.cameras[k].X_BV, 0, kRotation_rad);
  }
  ASSERT_TRUE(back.imu);
  EXPECT_EQ(back.imu->gyro_noise_rad_s_rtHz, info_.imu->gyro_noise_rad_s_rtHz);
  EXPECT_EQ(back.imu->accel_walk_m_s3_rtHz, info_.imu->accel_walk_m_s3_rtHz);
  EXPECT_EQ(back.imu->rate_hz, 400);
  ASSERT_TRUE(back.imu->correction);
  EXPECT_EQ(back.imu->correction->accel_matrix, info_.imu->correction->accel_matrix);
  EXPECT_EQ(back.imu->correction->gyro_bias_rad_s, info_.imu->correction->gyro_bias_rad_s);
  expect_equal(back.X_BI, info_.X_BI, 0, kRotation_rad);
  const auto tags = [](const RecordingInfo& i) {
    return std::tuple(i.tag_family, i.tag_size_m, i.tag_sizes_m, i.ignore_tags, i.max_hamming,
                      i.reference_tag);
  };
  EXPECT_EQ(tags(back), tags(info_));
  EXPECT_THAT(back.known_tags,
              testing::ElementsAre(testing::FieldsAre(4, 0.5, testing::_, 0.01, 0.02)));
  expect_equal(back.known_tags[0].X_WT, info_.known_tags[0].X_WT, 0, kRotation_rad);
}

TEST_F(RecordingWriterTest, WritesCornersAndImuInOrder) {
  RecordingWriter writer = create();
  const ImuSample imu{
      instant_from_ns(1'000'000'000'123), {0.1234567891, -2, 3e-7}, {-9.87654321, 0.1, 1e-8}};
  CornerFrame frame{1, instant_from_ns(1'000'010'000'456), {}};
  frame.tags.push_back(
      {17, 1, 0, {Eigen::Vector2d(1.123456, 2), {39.5, 0.25}, {-0.5, 29}, {3, 1e-7}}});
  frame.tags.push_back({18, 0, 0, {Eigen::Vector2d(1, 2), {3, 4}, {5, 6}, {7, 8}}});
  const CornerFrame empty{0, instant_from_ns(1'000'010'000'456), {}};
  for (const SensorSample& sample : {SensorSample(imu), SensorSample(frame), SensorSample(empty)})
    ASSERT_TRUE(writer.write(sample));
  ASSERT_TRUE(writer.finish());
  const auto back = play();
  ASSERT_EQ(back.size(), 3u);
  const auto& imu_back = std::get<ImuSample>(back[0]);
  EXPECT_EQ(imu_back.sampled_at, imu.sampled_at);
  // Each component is rounded in the IMU's axes and turned back.
  EXPECT_NEAR((imu_back.w_WB_B - imu.w_WB_B).norm(), 0, std::sqrt(3) * kSensor);
  EXPECT_NEAR((imu_back.f_B - imu.f_B).norm(), 0, std::sqrt(3) * kSensor);
  EXPECT_TRUE(std::get<CornerFrame>(back[1]).tags.empty());
  const auto& frame_back = std::get<CornerFrame>(back[2]);
  EXPECT_EQ(frame_back.camera, 1);
  EXPECT_EQ(frame_back.exposed_at, frame.exposed_at);
  ASSERT_EQ(frame_back.tags.size(), 2u);
  EXPECT_EQ(frame_back.tags[0].tag_id, 17);
  EXPECT_EQ(frame_back.tags[0].hamming, 1);
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d off = frame_back.tags[0].corners_px[i] - frame.tags[0].corners_px[i];
    EXPECT_LE(off.cwiseAbs().maxCoeff(), kCorner_px);
  }
}

TEST_F(RecordingWriterTest, WritesTheTruth) {
  RecordingWriter writer = create();
  TruthSample truth;
  truth.at = instant_from_ns(1'000'000'000);
  truth.X_WB = {exp_so3({0.4, 0.5, -0.6}), {1.23456789012, -2, 3}};
  truth.v_WB = {4, 5, 6};
  truth.bias_w = {0.01, 0.02, 0.03};
  truth.bias_f = {0.1, 0.2, 0.3};
  ASSERT_TRUE(writer.write_truth(truth));
  ASSERT_TRUE(writer.write_truth_tags({{7, 0.16, truth.X_WB, 0, 0}}));
  ASSERT_TRUE(writer.write_truth_extrinsics({info_.cameras[0].X_BV, info_.cameras[1].X_BV}));
  ASSERT_TRUE(writer.finish());
  const auto samples = read_truth(info_.folder).value();
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].at, truth.at);
  expect_equal(samples[0].X_WB, truth.X_WB, kSensor, 4 * kSensor);
  EXPECT_EQ(samples[0].v_WB, truth.v_WB);
  EXPECT_EQ(samples[0].bias_w, truth.bias_w);
  EXPECT_EQ(samples[0].bias_f, truth.bias_f);
  const auto tags = read_truth_tags(info_.folder).value();
  ASSERT_EQ(tags.size(), 1u);
  EXPECT_EQ(tags[0].edge_m, 0.16);
  expect_equal(tags[0].X_WT, truth.X_WB, kSensor, 4 * kSensor);
  const auto extrinsics = read_truth_extrinsics(info_.folder).value();
  ASSERT_EQ(extrinsics.size(), 2u);
  expect_equal(extrinsics[1], info_.cameras[1].X_BV, 0, kRotation_rad);
}

TEST_F(RecordingWriterTest, WritesIntoNoFolderWithContent) {
  folder_.write("out/precious.txt", "years of work");
  EXPECT_THAT(error_of(RecordingWriter::create(info_)), HasSubstr("is not empty"));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out/mav0"));
}

TEST_F(RecordingWriterTest, RefusesSamplesOfOtherSensors) {
  info_.imu.reset();
  RecordingWriter writer = create();
  EXPECT_FALSE(writer.write(ImuSample{}));
  EXPECT_FALSE(writer.write(CornerFrame{2, instant_from_ns(10'000'000), {}}));
  EXPECT_FALSE(writer.write(CornerFrame{0, instant_from_ns(0), {}}))
      << "before the epoch on the camera's clock";
}

TEST(OutputFile, ReportsWhyItCannotBeWritten) {
  OutputFile file = value_of(OutputFile::create("/dev/full"));
  ASSERT_TRUE(file.write("one")) << "still in the buffer";
  EXPECT_THAT(error_of(file.flush()), HasSubstr("/dev/full: cannot be written: No space left"));
  EXPECT_FALSE(file.write("two"));
  EXPECT_FALSE(file.close());
  EXPECT_FALSE(file.close()) << "the failure stays";
  EXPECT_EQ(file.bytes(), 0u);
  const TemporaryFolder folder;
  EXPECT_THAT(error_of(OutputFile::create(folder.write("file", "") + "/below/name")),
              HasSubstr("Not a directory"));
}

}  // namespace
}  // namespace fiducap
