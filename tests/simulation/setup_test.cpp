// A set-up from no camera to a configuration, with a simulated robot that does what a person would.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/whole_file.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/setup/setup_files.hpp"
#include "daemon/setup/setup_guide.hpp"
#include "daemon/setup/setup_rig.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// As fast as images are drawn.
class UnpacedRig final : public SetupRig {
 public:
  std::vector<FoundCamera> cameras() override {
    return {{SimulatedRig::kName, "a simulated robot", ""}};
  }
  Expected<void> use(const CameraDeviceConfig& camera) override {
    if (camera.open != SimulatedRig::kName)
      return fail(ErrorCode::kNotFound, "no such camera", camera.open);
    auto opened = rig_.open();
    if (!opened) return tl::unexpected(opened.error());
    source = std::move(*opened);
    return {};
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
  void say(const std::string& what, std::map<std::string, std::string> values = {}) {
    const auto done = guide_.command({what, std::move(values)});
    ASSERT_TRUE(done) << what << ": " << done.error().text();
  }
  /// Gives samples until that holds.
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

TEST_F(SetupTest, LeadsFromNoCameraToAConfigurationThatIsRight) {
  EXPECT_FALSE(guide_.command({"next"})) << "no image has come yet";
  EXPECT_FALSE(guide_.command({"camera", {{"open", "/dev/video9"}}}));
  EXPECT_FALSE(guide_.command({"dance"}));
  EXPECT_FALSE(guide_.command({"mount"})) << "does not belong to this step";
  say("camera", {{"open", SimulatedRig::kName}});
  ASSERT_TRUE(work_until([&] { return guide_.image().image != nullptr; }));
  say("next");  // picture
  ASSERT_TRUE(work_until([&] { return guide_.picture() && guide_.picture()->tags > 0; }));
  EXPECT_TRUE(guide_.picture()->is_good) << guide_.picture()->verdict;
  say("next");  // sheet
  EXPECT_FALSE(guide_.command({"sheet", {{"size_mm", "0.4 m"}}}));
  say("sheet", {{"size_mm", "401.6"}, {"ruler_mm", "99.6"}});
  EXPECT_NEAR(guide_.result().tags.size_m, 0.4, 1e-4);
  say("next");  // lens
  EXPECT_FALSE(guide_.command({"next"})) << "the lens is not known yet";
  ASSERT_TRUE(work_until([&] { return guide_.verdict() && guide_.verdict()->is_good; }))
      << verdict() << "; " << guide_.lens()->progress().hint;
  const CameraModel& lens = guide_.result().camera.mount.model;
  constexpr double kFocal_px = 2;  // of 458; three sigma of some sixty views
  EXPECT_NEAR(lens.fu, 458.6, kFocal_px) << verdict();
  EXPECT_NEAR(lens.fv, 457.3, kFocal_px);
  say("next");  // imu
  ASSERT_TRUE(work_until([&] { return guide_.imu_rate_hz() > 0; }));
  say("next");  // rest
  ASSERT_TRUE(work_until([&] { return guide_.verdict().has_value(); })) << guide_.rest().hint();
  EXPECT_TRUE(guide_.verdict()->is_good) << verdict();
  EXPECT_NEAR(guide_.result().imu->rate_hz, 200, 1);
  say("next");  // mount
  EXPECT_FALSE(guide_.command({"mount", {{"looks", "ahead"}}}));
  say("mount", {{"looks", "forward"}, {"x_m", "0.1"}, {"y_m", "0"}, {"z_m", "-0.02"}});
  say("next");  // wave
  late_ = std::chrono::milliseconds(30);
  const auto truth = rig_.simulated()->cameras.front();
  constexpr double kClock_s = 0.002, kPlace_m = 0.006, kTurn_rad = 0.005;
  constexpr double kSigmas = 4.0;  // norm of three over the sigma of one: 99.9 %
  for (int wave = 0; wave < 2; ++wave) {
    if (wave > 0) say("again");
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
  say("next");
  EXPECT_EQ(guide_.step(), SetupStep::kFinish);

  const TemporaryFolder folder;
  const std::string file = folder.file("robot.yaml");
  const auto written = write_setup(file, guide_.result(), false);
  ASSERT_TRUE(written) << written.error().text();
  EXPECT_FALSE(write_setup(file, guide_.result(), false)) << "never over a file that is there";
  EXPECT_TRUE(write_setup(file, guide_.result(), true));
  const auto config = load_config(file);
  ASSERT_TRUE(config) << config.error().front().text();
  EXPECT_EQ(config->bodies.front().cameras.front().mount.model.fu, lens.fu);
  EXPECT_EQ(config->tags.size_m, guide_.result().tags.size_m);
  EXPECT_EQ(std::filesystem::status(token_file_of(file)).permissions(),
            std::filesystem::perms(0600));
}

TEST_F(SetupTest, GoesOnWithAGuessedLensAndWithoutAnImu) {
  say("camera", {{"open", SimulatedRig::kName}});
  ASSERT_TRUE(work_until([&] { return guide_.image().image != nullptr; }));
  for (int i = 0; i < 3; ++i) say("next");
  say("guess");
  EXPECT_EQ(guide_.step(), SetupStep::kImu);
  say("imu");
  say("next");
  EXPECT_EQ(guide_.step(), SetupStep::kMount) << "nothing is there to lie still";
  say("next");
  EXPECT_EQ(guide_.step(), SetupStep::kFinish);
  EXPECT_THAT(setup_preview("robot.yaml", guide_.result()), HasSubstr("focal_sigma: 0.15"));
  say("back");
  EXPECT_EQ(guide_.step(), SetupStep::kMount);
}

TEST_F(SetupTest, AnotherCameraHasNeitherTheLensNorThePlaceOfTheOneBefore) {
  say("camera", {{"open", SimulatedRig::kName}});
  ASSERT_TRUE(work_until([&] { return guide_.image().image != nullptr; }));
  for (int i = 0; i < 3; ++i) say("next");
  say("guess");
  say("next");
  say("next");  // mount
  say("mount", {{"looks", "up"}, {"x_m", "0.5"}});
  while (guide_.step() != SetupStep::kCamera) say("back");
  const int width = guide_.result().camera.mount.model.width;
  say("camera", {{"open", SimulatedRig::kName}});
  EXPECT_EQ(guide_.result().camera.mount.model.width, width) << "the same camera keeps its lens";
  EXPECT_FALSE(guide_.command({"next"})) << "its picture is of an earlier time";
  say("camera", {{"open", SimulatedRig::kName}, {"width", "320"}, {"height", "240"}});
  EXPECT_EQ(guide_.result().camera.mount.model.width, 0);
  EXPECT_EQ(guide_.result().camera.mount.X_BV.p.x(), 0);
  ASSERT_TRUE(work_until([&] { return guide_.image().image != nullptr; }));
  for (int i = 0; i < 3; ++i) say("next");
  EXPECT_FALSE(guide_.command({"next"})) << "the lens is not known";
}

TEST(SetupFile, WhereNothingCanBeWrittenIsSaidBeforeTheSteps) {
  const TemporaryFolder folder;
  EXPECT_TRUE(can_write_setup(folder.file("robot.yaml")));
  const auto in_nothing = can_write_setup(folder.file("nothing/robot.yaml"));
  ASSERT_FALSE(in_nothing);
  EXPECT_THAT(in_nothing.error().text(), HasSubstr("no such folder"));
  const auto a_folder = can_write_setup(folder.path().string());
  ASSERT_FALSE(a_folder);
  EXPECT_THAT(a_folder.error().text(), HasSubstr("must be a file"));
}

TEST(SetupSheet, IsAPdfOfTwelveTagsOrSaysWhatWasExpected) {
  const auto pdf =
      setup_sheet({"sheet", {{"family", "tag36h11"}, {"size_mm", "160"}, {"paper", "a4"}}});
  ASSERT_TRUE(pdf) << pdf.error().text();
  EXPECT_THAT(*pdf, StartsWith("%PDF"));
  EXPECT_THAT(*pdf, HasSubstr("/Count 12"));
  const auto refusal = [](const char* family, const char* size, const char* paper) {
    const auto made =
        setup_sheet({"sheet", {{"family", family}, {"size_mm", size}, {"paper", paper}}});
    return made ? "made" : made.error().text();
  };
  EXPECT_THAT(refusal("tag36h11", "160", "a9"), HasSubstr("a4, a3 or letter"));
  EXPECT_THAT(refusal("tag36h11", "-1", "a4"), HasSubstr("black square"));
  EXPECT_THAT(refusal("tag36h11", "400", "a4"), HasSubstr("fit"));
  EXPECT_THAT(refusal("tag99", "100", "a4"), HasSubstr("tag36h11"));
}

}  // namespace
}  // namespace fiducap
