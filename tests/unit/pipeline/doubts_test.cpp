#include "pipeline/doubts.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "base/pose.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

Instant at_s(double seconds) { return Instant{} + from_seconds(seconds); }

TEST(TagDoubts, NameTheCausesOfRejectionsInOrder) {
  const std::string with = rejection_text(0.41, true);
  EXPECT_THAT(with, HasSubstr("41 %"));
  EXPECT_LT(with.find("sizes_m"), with.find("calibration"));
  EXPECT_LT(with.find("calibration"), with.find("IMU"));
  EXPECT_LT(with.find("IMU"), with.find("exist twice"));
  EXPECT_THAT(rejection_text(0.41, false), Not(HasSubstr("IMU")));
}

/// A body with one camera, 20 images a second.
struct DoubtingBody {
  explicit DoubtingBody(std::optional<ImuNoise> imu)
      : doubts(BodySensors{.cameras = {CameraMount{}}, .imu = imu}) {}

  /// @return the messages of that many images with this report
  std::vector<std::string> messages(int images, UpdateReport report) {
    std::vector<std::string> out;
    for (int i = 0; i < images; ++i) {
      report.exposed_at = instant_from_ns(50'000'000LL * ++image);
      const std::string text = doubts.add({}, report, std::nullopt, {}, {});
      if (!text.empty()) out.push_back(text);
    }
    return out;
  }

  TagDoubts doubts;
  int image{0};
};

TEST(TagDoubts, ReportOnceThatHalfOfTheTagsContradictForTenSeconds) {
  DoubtingBody body(std::nullopt);
  const UpdateReport contradicts{.tags_used = 2, .tags_rejected = 2};
  EXPECT_THAT(body.messages(9 * 20, contradicts), IsEmpty());
  const auto texts = body.messages(299, contradicts);
  EXPECT_THAT(texts, ElementsAre(rejection_text(0.5, false)));
  EXPECT_EQ(body.doubts.texts(), texts);
  EXPECT_THAT(body.messages(20 * 20, {.tags_used = 4}), IsEmpty());
  EXPECT_THAT(body.messages(20 * 20, contradicts), SizeIs(1)) << "again after an improvement";
}

TEST(TagDoubts, ReportNeitherOneTagInTenNorAFewBadSecondsNorNoTags) {
  DoubtingBody body(std::nullopt);
  EXPECT_THAT(body.messages(60 * 20, {.tags_used = 9, .tags_rejected = 1}), IsEmpty());
  EXPECT_THAT(body.messages(20 * 20, {.tags_used = 4}), IsEmpty());
  EXPECT_THAT(body.messages(4 * 20, {.tags_rejected = 4}), IsEmpty());
  EXPECT_THAT(body.messages(20 * 20, {.tags_used = 4}), IsEmpty());
  EXPECT_THAT(DoubtingBody(std::nullopt).messages(60 * 20, {}), IsEmpty());
}

TEST(TagDoubts, ReportOnceThatAnUndecidedBranchWithholdsThePose) {
  const UpdateReport pending{.tags_seen = 1, .tags_pending = 1};
  EXPECT_THAT(DoubtingBody(std::nullopt).messages(299, pending),
              ElementsAre(HasSubstr("allow two poses")));
  EXPECT_THAT(DoubtingBody(ImuNoise{}).messages(299, pending), IsEmpty());
}

TEST(TagDoubts, ReportAnAmbiguousPlaceOnceEachTime) {
  DoubtingBody body(ImuNoise{});
  const auto messages = [&](int images, std::optional<UpdateReport::AmbiguousPlace> place) {
    UpdateReport report{.tags_seen = 1, .tags_used = 1};
    report.ambiguous_place = place;
    return body.messages(images, report);
  };
  using Place = UpdateReport::AmbiguousPlace;
  EXPECT_THAT(messages(19, Place{4, 0.3}), IsEmpty()) << "a clock may have jumped";
  EXPECT_THAT(messages(20, std::nullopt), IsEmpty());
  EXPECT_THAT(messages(60, Place{4, 0.3}),
              ElementsAre(HasSubstr("by tag 4 the body is 0.30 m from")));
  EXPECT_THAT(messages(60, std::nullopt), IsEmpty());
  EXPECT_THAT(messages(60, Place{4, 0.02}), IsEmpty()) << "too close";
}

using Kind = FoundMismatch::Kind;

std::string text_of(const FoundMismatch& found) {
  CameraMount mount;
  mount.model.fu = 460;
  mount.model.cu = 376;
  mount.model.cv = 240;
  return mismatch_text(found, {mount});
}

TEST(MismatchText, NamesTheParameterItsValueAndTheRemedy) {
  struct Case {
    FoundMismatch found;
    std::vector<const char*> parts;
  };
  const Case cases[] = {
      {{Kind::kFocalLength, 0, -1, 0.009, 0.001},
       {"camera 0", "0.9 ± 0.1 % longer", "fu 460.0, seems 464.1", "calibrate camera",
        "estimator.refine_intrinsics: true"}},
      {{Kind::kCentreU, 0, -1, -4.2, 0.3}, {"4.2 ± 0.3 px left", "cu 376.0, seems 371.8"}},
      {{Kind::kCentreV, 0, -1, 3.0, 0.3}, {"3.0 ± 0.3 px below", "cv 240.0"}},
      {{Kind::kLens, 0, -1, 0.08, 0.002, {{0.08, {5, -3}}, 0.002, {1.5, 1.25}}},
       {"camera 0", "refined", "fu 496.8 ± 0.9 (configured 460.0)",
        "cu 381.0 ± 1.5 (configured 376.0)", "cv 237.0 ± 1.2 (configured 240.0). Run",
        "calibrate camera", ": its distortion stays"}},
      {{Kind::kLens, 0, -1, 0.08, 0.002, {{0.08, {5, -3}, -0.05}, 0.002, {1.5, 1.25}, 3e-3}},
       {"k1 -0.0500 ± 0.0030 (configured 0.0000)", "the rest of its distortion"}},
      {{Kind::kLens, 0, -1, 0, 0, {{0, {0, 0}, -0.05}, 0, {0, 0}, 3e-3}},
       {"the lens is refined: k1 -0.0500 ± 0.0030 (configured 0.0000). Run"}},
      {{Kind::kDistortion, 0, -1, -0.05, 0.002},
       {"camera 0", "k1 seems -0.0500 ± 0.0020, configured 0.0000", "calibrate camera"}},
      {{Kind::kReadout, 0, -1, 0.0151, 0.0004}, {"15.1 ± 0.4 ms", "readout_s"}},
      {{Kind::kAllPrints, -1, -1, 0.021, 0.002}, {"2.1 ± 0.2 % larger", "tags.size_m"}},
      {{Kind::kOnePrint, -1, 12, -0.03, 0.004}, {"tag 12", "3.0 ± 0.4 % smaller", "sizes_m"}},
      {{Kind::kImuNoise, -1, -1, 5.1, 0.2}, {"5.1 times as noisy", "calibrate imu"}},
      {{.kind = Kind::kGyroDrift, .axes = {1e-3, 0, 0}},
       {"gyro's bias", "3.44 ± 0.00", "°/s per minute", "warm up"}},
      {{Kind::kGyroRange, -1, -1, 8.73, 0}, {"gyro", "8.7 rad/s", "wider range"}},
      {{Kind::kAccelRange, -1, -1, 39.2, 0}, {"accelerometer", "39 m/s²"}},
      {{Kind::kStampJitter, -1, -1, 0.0031, 0}, {"jitter by 3.1 ms"}}};
  for (const auto& [found, parts] : cases)
    for (const char* part : parts) EXPECT_THAT(text_of(found), HasSubstr(part));
}

class MismatchReporterTest : public testing::Test {
 protected:
  /// @return how many of them are reported then
  std::size_t reports(double seconds, const std::vector<FoundMismatch>& found) {
    return reporter_.take(found, at_s(seconds)).size();
  }
  void report_at_three_seconds(const FoundMismatch& found) {
    EXPECT_EQ(reports(0, {found}), 0u);
    ASSERT_EQ(reports(3, {found}), 1u);
  }
  void expect_silence(int from_s, int to_s, const FoundMismatch& found) {
    for (int t = from_s; t < to_s; ++t) EXPECT_EQ(reports(t, {found}), 0u) << t << " s";
  }

  const FoundMismatch prints_{Kind::kAllPrints, -1, -1, 0.02, 0.002};
  FoundMismatch lens_{Kind::kLens, 0, -1, 0, 0};
  MismatchReporter reporter_;
};

TEST_F(MismatchReporterTest, ReportsALastingMismatchOnce) {
  expect_silence(0, 2, prints_);
  EXPECT_EQ(reports(3, {prints_}), 1u);
  expect_silence(4, 100, prints_);
}

TEST_F(MismatchReporterTest, DoesNotReportAShortMismatch) {
  for (int t = 0; t < 100; t += 2) {
    EXPECT_EQ(reports(t, {prints_}), 0u);
    EXPECT_EQ(reports(t + 1, {}), 0u);
  }
}

TEST_F(MismatchReporterTest, ReportsALastingChangeOnce) {
  report_at_three_seconds(prints_);
  FoundMismatch more = prints_;
  more.value = 0.04;
  expect_silence(4, 5, more);
  EXPECT_EQ(reports(8, {more}), 1u);
  expect_silence(9, 10, more);
}

TEST_F(MismatchReporterTest, ReportsARefinedLensAgainBeyondItsSigma) {
  lens_.value = 1e-3;
  lens_.sigma = 2e-3;
  lens_.lens.focal_sigma = 2e-3;
  report_at_three_seconds(lens_);
  lens_.lens.offset.focal = -1e-3;
  lens_.lens.offset.k1 = 1e-7;  // it is held, not refined
  expect_silence(4, 20, lens_);
  lens_.lens.offset.focal = 0.02;
  EXPECT_EQ(reports(30, {lens_}), 1u);
}

TEST_F(MismatchReporterTest, ReportsThatARefinedDistortionHasMoved) {
  lens_.lens.k1_sigma = 0.01;
  report_at_three_seconds(lens_);
  lens_.lens.offset.k1 = 0.03;
  expect_silence(4, 20, lens_);
  lens_.lens.offset.k1 = -0.05;
  EXPECT_EQ(reports(30, {lens_}), 1u);
}

TEST_F(MismatchReporterTest, ReportsThatARefinedDistortionIsKnownNow) {
  lens_.lens.k1_sigma = 0.09;
  report_at_three_seconds(lens_);
  lens_.lens.offset.k1 = -0.1;
  lens_.lens.k1_sigma = 0.01;
  (void)reports(4, {lens_});
  EXPECT_EQ(reports(8, {lens_}), 1u);
}

TEST_F(MismatchReporterTest, DistinguishesTags) {
  const FoundMismatch one{Kind::kOnePrint, -1, 1, 0.02, 0.002};
  const FoundMismatch other{Kind::kOnePrint, -1, 2, 0.02, 0.002};
  EXPECT_EQ(reports(0, {one, other}), 0u);
  EXPECT_EQ(reports(3, {one, other}), 2u);
}

constexpr double kQuarter = 1.5707963267948966;

/// In a room whose z is up; `q_WR` then lays the room on its side.
class UpCheckTest : public testing::Test {
 protected:
  void add(const Eigen::Quaterniond& q_RT, int sightings = 50) {
    TagBelief belief;
    belief.tag.tag_id = static_cast<int>(tags_.size());
    belief.tag.X_WT.q = q_WR_ * q_RT;
    belief.sightings = sightings;
    tags_.push_back(belief);
  }
  /// Upright on walls that face these ways.
  void hang(const std::vector<double>& headings, double inclined_rad = 0) {
    for (const double heading : headings)
      add(exp_so3({0, 0, heading}) * exp_so3({kQuarter, 0, 0}) * exp_so3({0, 0, inclined_rad}));
  }
  void lay(double heading) { add(exp_so3({0, 0, heading})); }
  std::string look(UpCheck& check, bool anchored = true, const std::vector<KnownTag>& known = {}) {
    now_ += std::chrono::milliseconds(1100);
    BodyEstimate estimate;
    estimate.anchored = anchored;
    return check.add(now_, estimate, tags_, known);
  }

  Eigen::Quaterniond q_WR_{Eigen::Quaterniond::Identity()};
  std::vector<TagBelief> tags_;
  Instant now_{};
};

TEST_F(UpCheckTest, TagsOnTwoWallsGiveTheVertical) {
  q_WR_ = exp_so3({-kQuarter, 0, 0});
  hang({0}, 0.03);
  hang({0}, -0.02);
  hang({kQuarter}, 0.04);
  hang({-kQuarter});
  const auto guess = guess_up(tags_);
  ASSERT_TRUE(guess);
  EXPECT_GT(guess->up_W.dot(q_WR_ * Eigen::Vector3d::UnitZ()), std::cos(0.05));
  EXPECT_EQ(guess->agree, 4);
}

TEST_F(UpCheckTest, TagsOnAFloorAndOneOnAWallGiveTheVertical) {
  for (const double heading : {0.3, 2.1, -1.2}) lay(heading);
  hang({0.5});
  ASSERT_TRUE(guess_up(tags_));
  EXPECT_GT(guess_up(tags_)->up_W.z(), 0.99);
}

TEST_F(UpCheckTest, OneWallOrTwoTagsDoNotGiveTheVertical) {
  hang(std::vector(5, 0.4));
  EXPECT_FALSE(guess_up(tags_));
  tags_.clear();
  hang({0, kQuarter});
  add(exp_so3({0, 0, 3}) * exp_so3({kQuarter, 0, 0}), 3);  // rarely seen
  EXPECT_FALSE(guess_up(tags_));
}

TEST_F(UpCheckTest, AWorkspaceOnItsSideIsReportedOnceWithARemedy) {
  q_WR_ = exp_so3({-kQuarter, 0, 0});
  hang({0});
  UpCheck check(false, {}, false);
  EXPECT_EQ(look(check, false), "");
  EXPECT_THAT(look(check), AllOf(HasSubstr("without an IMU the vertical is unknown"),
                                 HasSubstr("map.floor_tags")));
  EXPECT_EQ(look(check), "");
  hang({kQuarter, -kQuarter});
  EXPECT_THAT(look(check), AllOf(HasSubstr("seems to lie on its side: by 3 of 3 tags, up is "
                                           "90 deg from its z axis, about along +y"),
                                 HasSubstr("map.floor_tags")));
  EXPECT_EQ(look(check), "");
}

TEST_F(UpCheckTest, AnUprightWorkspaceIsConfirmed) {
  lay(0);
  hang({0, kQuarter});
  UpCheck check(false, {}, false);
  look(check);
  EXPECT_THAT(look(check), HasSubstr("3 of 3 tags agree"));
}

TEST_F(UpCheckTest, AKnownVerticalIsNotReported) {
  hang({0, kQuarter, -kQuarter});
  WorkspaceGauge placed;
  placed.X_WT = Pose{};
  WorkspaceGauge floor;
  floor.floor_tags = {0};
  UpCheck with_imu(true, {}, false);
  UpCheck with_place(false, placed, false);
  UpCheck with_survey(false, {}, true);
  UpCheck with_floor(false, floor, false);
  UpCheck with_map(false, {}, false);
  for (int i = 0; i < 3; ++i) {
    for (UpCheck* check : {&with_imu, &with_place, &with_survey, &with_floor})
      EXPECT_EQ(look(*check), "");
    EXPECT_EQ(look(with_map, true, {KnownTag{}}), "");
  }
}

TEST_F(UpCheckTest, UnseenFloorTagsAreNamedOnce) {
  hang({0});
  WorkspaceGauge gauge;
  gauge.floor_tags = {0, 7, 9};
  UpCheck check(false, gauge, false);
  std::string all;
  for (int i = 0; i < 30; ++i) all += look(check, false);
  EXPECT_THAT(all, HasSubstr("of them 7, 9 was not seen well"));
  EXPECT_EQ(all.find("no pose yet"), all.rfind("no pose yet"));
}

}  // namespace
}  // namespace fiducap
