#include "estimation/conversation/lone_return.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace fiducap {
namespace {

using Verdict = LoneReturn::Verdict;

constexpr int kLoneTag = 7;
// The readings alone say where the body is to 0.1 m per axis.
constexpr double kSigma_m = 0.1;

BodyPlace by_readings() {
  return {Eigen::Vector3d::Zero(), kSigma_m * kSigma_m * Eigen::Matrix3d::Identity()};
}

/// What is said after so many images that contradict it.
Verdict after(int images, LoneReturn lone, const std::vector<int>& against,
              const std::optional<Eigen::Vector3d>& shift) {
  Verdict verdict = Verdict::kOpen;
  for (int i = 0; i < images && verdict == Verdict::kOpen; ++i)
    verdict = lone.contradict(against, shift);
  return verdict;
}

TEST(LoneReturn, ATagThatLeftTheBodyWhereTheReadingsHadItIsBelievedAgainstOneThatWantsItFarAway) {
  LoneReturn lone;
  lone.begin(kLoneTag, by_readings(), {0.02, 0.0, 0.0});
  EXPECT_EQ(after(4, lone, {8}, Eigen::Vector3d(0.3, 0, 0)), Verdict::kOpen) << "too soon";
  EXPECT_EQ(after(5, lone, {8}, Eigen::Vector3d(0.3, 0, 0)), Verdict::kOthersWrong);
}

TEST(LoneReturn, ATagThatMovedTheBodyFarIsWrongWhenAnotherWantsItBack) {
  LoneReturn lone;
  lone.begin(kLoneTag, by_readings(), {0.3, 0.0, 0.0});
  EXPECT_EQ(after(5, lone, {8}, Eigen::Vector3d(-0.3, 0, 0)), Verdict::kReturnWrong);
}

TEST(LoneReturn, TwoThatContradictOutvoteIt) {
  LoneReturn lone;
  lone.begin(kLoneTag, by_readings(), {0.02, 0.0, 0.0});
  EXPECT_EQ(after(5, lone, {8, 9}, Eigen::Vector3d(0.3, 0, 0)), Verdict::kReturnWrong);
}

TEST(LoneReturn, TwoThatContradictOneAfterTheOtherOutvoteItToo) {
  LoneReturn lone;
  lone.begin(kLoneTag, by_readings(), {0.02, 0.0, 0.0});
  const std::vector<int> one{8}, other{9};
  ASSERT_EQ(lone.contradict(one, Eigen::Vector3d(0.3, 0, 0)), Verdict::kOpen);
  EXPECT_EQ(after(4, lone, other, Eigen::Vector3d(0.3, 0, 0)), Verdict::kReturnWrong);
}

TEST(LoneReturn, OfABodyThatWasAdriftTheOtherIsBelieved) {
  LoneReturn lone;
  lone.begin(kLoneTag, std::nullopt, {0.02, 0.0, 0.0});
  EXPECT_TRUE(lone.is_watched());
  EXPECT_EQ(lone.tag_id(), kLoneTag);
  EXPECT_EQ(after(5, lone, {8}, Eigen::Vector3d(0.3, 0, 0)), Verdict::kReturnWrong);
  lone.forget();
  EXPECT_FALSE(lone.is_watched());
}

TEST(LoneReturn, WhoDoesNotSayWhereTheBodyIsCannotBeWeighed) {
  LoneReturn lone;
  lone.begin(kLoneTag, by_readings(), {0.02, 0.0, 0.0});
  EXPECT_EQ(after(5, lone, {8}, std::nullopt), Verdict::kReturnWrong);
}

}  // namespace
}  // namespace fiducap
