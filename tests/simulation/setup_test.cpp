// A set-up from no camera to a configuration, with a simulated robot.
#include <gmock/gmock.h>

#include "base/whole_file.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/setup/setup_files.hpp"
#include "daemon/setup/setup_guide.hpp"
#include "daemon/setup/setup_rig.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

/// A simulated rig that does not wait for real time.
class UnpacedRig final : public SetupRig {
 public:
  std::vector<FoundCamera> cameras() override {
    return {{SimulatedRig::kName, "a simulated robot", ""}};
  }
  Expected<void> use(const CameraDeviceConfig& camera) override {
    if (camera.open != SimulatedRig::kName)
      return fail(ErrorCode::kNotFound, "no such camera", camera.open);
    return rig_.open().map([this](auto opened) { source = std::move(opened); });
  }
  Expected<void> use(const ImuSourceConfig&) override { return {}; }
  void close_imu() override {}
  void begin(SetupStep step) override { rig_.begin(step); }
  std::optional<simulation::SimulatedBodyConfig> simulated() const override { return rig_.body(); }

  std::unique_ptr<SensorSource> source;

 private:
  SimulatedRig rig_{nullptr};
};

class SetupTest : public testing::Test {
 protected:
  void command(const std::string& what, std::map<std::string, std::string> values = {}) {
    value_of(guide_.command({what, std::move(values)}));
  }
  void use_camera() {
    command("camera", {{"open", SimulatedRig::kName}});
    ASSERT_TRUE(work_until([&] { return guide_.image().image != nullptr; }));
  }
  /// Gives samples until a condition holds.
  template <typename Done>
  bool work_until(Done done, int most_samples = 60'000) {
    for (int i = 0; i < most_samples && !done(); ++i) {
      auto sample = rig_.source->next({});
      if (!sample || !sample->has_value()) return false;
      if (auto* image = std::get_if<CameraFrame>(&**sample)) image->exposed_at += late_;
      guide_.take(**sample);
    }
    return done();
  }
  std::string verdict() const {
    if (!guide_.verdict()) return "none";
    std::string text = guide_.verdict()->summary;
    for (const auto& advice : guide_.verdict()->advice) text += " | " + advice;
    return text;
  }

  UnpacedRig rig_;
  SetupGuide guide_{rig_, [] {}};
  Duration late_{0};  ///< Delay of the images' stamps.
};

TEST_F(SetupTest, LeadsToACorrectConfiguration) {
  EXPECT_FALSE(guide_.command({"next"})) << "no image yet";
  EXPECT_FALSE(guide_.command({"camera", {{"open", "/dev/video9"}}}));
  EXPECT_FALSE(guide_.command({"dance"}));
  EXPECT_FALSE(guide_.command({"mount"})) << "does not belong to this step";
  use_camera();
  command("next");  // picture
  ASSERT_TRUE(work_until([&] { return guide_.picture() && guide_.picture()->tags > 0; }));
  EXPECT_TRUE(guide_.picture()->is_good) << guide_.picture()->verdict;
  command("next");  // sheet
  EXPECT_FALSE(guide_.command({"sheet", {{"size_mm", "0.4 m"}}}));
  command("sheet", {{"size_mm", "401.6"}, {"ruler_mm", "99.6"}});
  EXPECT_NEAR(guide_.result().tags.size_m, 0.4, 1e-4);
  command("next");  // lens
  EXPECT_FALSE(guide_.command({"next"})) << "the lens is not known yet";
  ASSERT_TRUE(work_until([&] { return guide_.verdict() && guide_.verdict()->is_good; }))
      << verdict() << "; " << guide_.lens()->progress().hint;
  const CameraModel& lens = guide_.result().camera.mount.model;
  constexpr double kFocal_px = 2;  // of 458; three sigma of some sixty views
  EXPECT_NEAR(lens.fu, 458.6, kFocal_px) << verdict();
  EXPECT_NEAR(lens.fv, 457.3, kFocal_px);
  command("next");  // imu
  ASSERT_TRUE(work_until([&] { return guide_.imu_rate_hz() > 0; }));
  command("next");  // rest
  ASSERT_TRUE(work_until([&] { return guide_.verdict().has_value(); })) << guide_.rest().hint();
  EXPECT_TRUE(guide_.verdict()->is_good) << verdict();
  EXPECT_NEAR(guide_.result().imu->rate_hz, 200, 1);
  command("next");  // mount
  EXPECT_FALSE(guide_.command({"mount", {{"looks", "ahead"}}}));
  command("mount", {{"looks", "forward"}, {"x_m", "0.1"}, {"y_m", "0"}, {"z_m", "-0.02"}});
  command("next");  // wave
  late_ = std::chrono::milliseconds(30);
  const auto truth = rig_.simulated()->cameras.front();
  constexpr double kClock_s = 0.002, kPlace_m = 0.006, kTurn_rad = 0.005;
  constexpr double kSigmas = 4.0;  // norm of three over the sigma of one: 99.9 %
  for (int wave = 0; wave < 2; ++wave) {
    if (wave > 0) command("again");
    ASSERT_TRUE(work_until([&] { return guide_.verdict().has_value(); }))
        << guide_.wave().progress().hint;
    EXPECT_FALSE(guide_.verdict()->is_refused) << verdict();
    const CameraMount& mount = guide_.result().camera.mount;
    EXPECT_NEAR(to_seconds(mount.time_shift), -0.03, kClock_s) << verdict();
    // Information of half a minute of waving.
    EXPECT_LT(mount.position_sigma_m, kPlace_m) << verdict();
    EXPECT_LT((mount.X_BV.p - truth.X_BV.p).norm(), kSigmas * mount.position_sigma_m) << verdict();
    EXPECT_LT(mount.X_BV.q.angularDistance(truth.X_BV.q), kTurn_rad) << verdict();
  }
  command("next");
  EXPECT_EQ(guide_.step(), SetupStep::kFinish);

  const TemporaryFolder folder;
  const std::string file = folder.file("robot.yaml");
  value_of(write_setup(file, guide_.result(), false));
  EXPECT_FALSE(write_setup(file, guide_.result(), false)) << "the file exists";
  EXPECT_TRUE(write_setup(file, guide_.result(), true));
  const auto config = value_of(load_config(file));
  EXPECT_EQ(config.bodies.front().cameras.front().mount.model.fu, lens.fu);
  EXPECT_EQ(config.tags.size_m, guide_.result().tags.size_m);
  EXPECT_EQ(std::filesystem::status(token_file_of(file)).permissions(),
            std::filesystem::perms(0600));
}

TEST_F(SetupTest, ContinuesWithAGuessedLensAndWithoutImu) {
  use_camera();
  for (int i = 0; i < 3; ++i) command("next");
  command("guess");
  EXPECT_EQ(guide_.step(), SetupStep::kImu);
  command("imu");
  command("next");
  EXPECT_EQ(guide_.step(), SetupStep::kMount) << "no rest without an IMU";
  command("next");
  EXPECT_EQ(guide_.step(), SetupStep::kFinish);
  EXPECT_THAT(setup_preview("robot.yaml", guide_.result()), HasSubstr("focal_sigma: 0.15"));
  command("back");
  EXPECT_EQ(guide_.step(), SetupStep::kMount);
}

TEST_F(SetupTest, ForgetsLensAndPoseOfAnEarlierCamera) {
  use_camera();
  for (int i = 0; i < 3; ++i) command("next");
  command("guess");
  command("next");
  command("next");  // mount
  command("mount", {{"looks", "up"}, {"x_m", "0.5"}});
  while (guide_.step() != SetupStep::kCamera) command("back");
  const int width = guide_.result().camera.mount.model.width;
  command("camera", {{"open", SimulatedRig::kName}});
  EXPECT_EQ(guide_.result().camera.mount.model.width, width) << "the same camera keeps its lens";
  EXPECT_FALSE(guide_.command({"next"})) << "its picture is old";
  command("camera", {{"open", SimulatedRig::kName}, {"width", "320"}, {"height", "240"}});
  EXPECT_EQ(guide_.result().camera.mount.model.width, 0);
  EXPECT_EQ(guide_.result().camera.mount.X_BV.p.x(), 0);
  ASSERT_TRUE(work_until([&] { return guide_.image().image != nullptr; }));
  for (int i = 0; i < 3; ++i) command("next");
  EXPECT_FALSE(guide_.command({"next"})) << "the lens is not known";
}

TEST(SetupFile, IsCheckedForWritingBeforeTheSteps) {
  const TemporaryFolder folder;
  EXPECT_TRUE(can_write_setup(folder.file("robot.yaml")));
  EXPECT_THAT(error_of(can_write_setup(folder.file("nothing/robot.yaml"))),
              HasSubstr("no such folder"));
  EXPECT_THAT(error_of(can_write_setup(folder.path().string())), HasSubstr("must be a file"));
}

TEST(SetupSheet, IsAPdfOfTwelveTagsOrARefusal) {
  const auto sheet = [](const char* family, const char* size, const char* paper) {
    return setup_sheet({"sheet", {{"family", family}, {"size_mm", size}, {"paper", paper}}});
  };
  EXPECT_THAT(value_of(sheet("tag36h11", "160", "a4")),
              AllOf(StartsWith("%PDF"), HasSubstr("/Count 12")));
  EXPECT_THAT(error_of(sheet("tag36h11", "160", "a9")), HasSubstr("a4, a3 or letter"));
  EXPECT_THAT(error_of(sheet("tag36h11", "-1", "a4")), HasSubstr("black square"));
  EXPECT_THAT(error_of(sheet("tag36h11", "400", "a4")), HasSubstr("fit"));
  EXPECT_THAT(error_of(sheet("tag99", "100", "a4")), HasSubstr("tag36h11"));
}

}  // namespace
}  // namespace fiducap
