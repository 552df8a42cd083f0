#include "pipeline/doubts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(TagDoubts, SayWhichTagLooksLargerAndWhatToDo) {
  EXPECT_EQ(size_text({7, 0.1, 1.12, 0.02}),
            "tag 7 looks 12 % larger than its configured 0.100 m (0.112 ± 0.002 m): measure it, or "
            "set tags.sizes_m");
  EXPECT_THAT(size_text({7, 0.1, 0.9, 0.02}),
              HasSubstr("tag 7 looks 10 % smaller than its configured 0.100 m (0.090"));
}

TEST(TagDoubts, AskWhatTagsSizeMIsWhenAllLookAlike) {
  EXPECT_EQ(size_text({std::nullopt, 0.0, 1.25, 0.01}),
            "all tags look 1.25 (± 0.01) times their configured size: is tags.size_m the edge of "
            "the black square?");
}

TEST(TagDoubts, NameTheCausesOfRejectionsInOrderWithoutTheImuWhereThereIsNone) {
  const std::string with = rejection_text(0.41, true);
  EXPECT_THAT(with, HasSubstr("41 %"));
  EXPECT_LT(with.find("sizes_m"), with.find("calibration"));
  EXPECT_LT(with.find("calibration"), with.find("IMU"));
  EXPECT_LT(with.find("IMU"), with.find("exist twice"));
  EXPECT_THAT(rejection_text(0.41, false), Not(HasSubstr("IMU")));
}

TEST(TagDoubts, KeepWhatWasSaid) {
  TagDoubts doubts(BodySensors{.cameras = {CameraMount{}}, .imu = std::nullopt}, EstimatorConfig{});
  std::vector<std::string> said;
  for (int image = 1; image < 20 * 15; ++image) {
    UpdateReport report;
    report.exposed_at = instant_from_ns(50'000'000LL * image);
    report.tags_used = report.tags_rejected = 2;
    const std::string news = doubts.add({}, report, std::nullopt, {}, {});
    if (!news.empty()) said.push_back(news);
  }
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(said.front(), rejection_text(0.5, false));
  EXPECT_EQ(doubts.texts(), said);
}

TEST(TagDoubts, SayOnceWhyThereIsNoPoseWhileATagsBranchIsOpen) {
  const auto sentences = [](std::optional<ImuNoise> imu) {
    TagDoubts doubts(BodySensors{.cameras = {CameraMount{}}, .imu = imu}, EstimatorConfig{});
    std::vector<std::string> said;
    for (int image = 1; image < 20 * 15; ++image) {
      UpdateReport report;
      report.exposed_at = instant_from_ns(50'000'000LL * image);
      report.tags_seen = report.tags_pending = 1;
      const std::string news = doubts.add({}, report, std::nullopt, {}, {});
      if (!news.empty()) said.push_back(news);
    }
    return said;
  };
  EXPECT_THAT(sentences(std::nullopt), testing::ElementsAre(HasSubstr("allow two poses")));
  EXPECT_THAT(sentences(ImuNoise{}), testing::IsEmpty());
}

TEST(TagDoubts, SayOnceEachTimeThatATagWantsTheBodyElsewhere) {
  TagDoubts doubts(BodySensors{.cameras = {CameraMount{}}, .imu = ImuNoise{}}, EstimatorConfig{});
  int image = 0;
  const auto sentences = [&](int images, std::optional<UpdateReport::AmbiguousPlace> elsewhere) {
    std::vector<std::string> said;
    for (int i = 0; i < images; ++i) {
      UpdateReport report;
      report.exposed_at = instant_from_ns(50'000'000LL * ++image);
      report.tags_seen = report.tags_used = 1;
      report.ambiguous_place = elsewhere;
      const std::string news = doubts.add({}, report, std::nullopt, {}, {});
      if (!news.empty()) said.push_back(news);
    }
    return said;
  };
  using AmbiguousPlace = UpdateReport::AmbiguousPlace;
  EXPECT_TRUE(sentences(19, AmbiguousPlace{4, 0.3}).empty()) << "a clock may have jumped";
  EXPECT_TRUE(sentences(20, std::nullopt).empty());
  const auto said = sentences(60, AmbiguousPlace{4, 0.3});
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said.front(), HasSubstr("by tag 4 the body is 0.30 m from"));
  EXPECT_TRUE(sentences(60, std::nullopt).empty());
  EXPECT_TRUE(sentences(60, AmbiguousPlace{4, 0.02}).empty()) << "a breath of air";
}

}  // namespace
}  // namespace fiducap
