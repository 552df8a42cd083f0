#include "streaming/native/profile.hpp"

#include <gtest/gtest.h>

#include "streaming/native/profile.hpp"

namespace fiducap::native {
namespace {

TEST(Profile, LeavesOutAWholeNumberOfFramesToStayBelowTheRate) {
  Profile profile;
  EXPECT_EQ(step_of(profile, 200), 1u) << "no limit";
  for (const auto& [most, step] : std::vector<std::pair<float, std::uint64_t>>{
           {200, 1}, {1000, 1}, {199, 2}, {100, 2}, {99, 3}, {50, 4}, {1, 200}, {0.1F, 2000}}) {
    profile.max_rate_hz = most;
    EXPECT_EQ(step_of(profile, 200), step) << most << " Hz";
  }
  profile.max_rate_hz = 100;
  EXPECT_EQ(step_of(profile, 200.0001), 2u) << "a clock's error does not cost a frame";
  EXPECT_EQ(step_of(profile, 0), 1u) << "a server without a rate";
}

TEST(Profile, ChoosesBodiesByNameInTheOrderOfTheScene) {
  const SceneModel model{1, {{1, "c"}, {2, "a"}, {3, "b"}}};
  Profile profile;
  EXPECT_EQ(chosen_bodies(profile, model), (std::vector<std::uint32_t>{0, 1, 2}));
  profile.bodies = {"b", "c", "ghost"};
  EXPECT_EQ(chosen_bodies(profile, model), (std::vector<std::uint32_t>{0, 2}));
  profile.bodies = {"ghost"};
  EXPECT_TRUE(chosen_bodies(profile, model).empty());
}

TEST(ProfileTable, GrantsTheSameNumberForTheSameWish) {
  ProfileTable table;
  Profile slow;
  slow.max_rate_hz = 10;
  EXPECT_EQ(table.grant(Profile{}), 0u);
  EXPECT_EQ(table.grant(slow), 1u);
  EXPECT_EQ(table.grant(slow), 1u);
  slow.covariance = false;
  EXPECT_EQ(table.grant(slow), 2u);
}

TEST(ProfileTable, IsBoundedAndNeverUsesANumberTwice) {
  ProfileTable table;
  Profile profile;
  for (std::size_t i = 1; i <= ProfileTable::kMost; ++i) {
    profile.max_rate_hz = static_cast<float>(i);
    EXPECT_EQ(table.grant(profile), i);
  }
  profile.max_rate_hz = 1000;
  EXPECT_FALSE(table.grant(profile));
  table.prune([](std::uint32_t number) { return number != 3; });
  EXPECT_EQ(table.grant(profile), ProfileTable::kMost + 1);
}

}  // namespace
}  // namespace fiducap::native
