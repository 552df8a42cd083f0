// `fiducap replay --resolve`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "support/temporary_folder.hpp"
#include "tools/command_line.hpp"
#include "tools/terminal.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

class ResolveTest : public testing::Test {
 protected:
  int run(const std::vector<std::string>& words) {
    std::vector<const char*> argv{"fiducap"};
    for (const std::string& word : words) argv.push_back(word.c_str());
    out_.str("");
    err_.str("");
    return run_command_line(static_cast<int>(argv.size()), argv.data(), {out_, err_});
  }
  void simulate(const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{
        "simulate", "--room", "table", "--seconds", "15", "--out", folder_.file("table")};
    words.insert(words.end(), more.begin(), more.end());
    ASSERT_EQ(run(words), kExitOk) << err_.str();
  }
  [[nodiscard]] std::size_t lines(const std::string& name) const {
    const auto text = read_whole_file(folder_.file("out/" + name));
    return text ? static_cast<std::size_t>(std::count(text->begin(), text->end(), '\n')) : 0;
  }
  nlohmann::json evaluated() {
    EXPECT_EQ(run({"evaluate", folder_.file("out/table.tum"), folder_.file("table"), "--json"}),
              kExitOk)
        << err_.str();
    return nlohmann::json::parse(out_.str());
  }

  TemporaryFolder folder_;
  std::ostringstream out_;
  std::ostringstream err_;
};

TEST_F(ResolveTest, WritesEveryPoseWithItsCovarianceAndWhatWasKnownLive) {
  simulate();
  ASSERT_EQ(run({"replay", folder_.file("table"), "--resolve", "--out", folder_.file("out")}),
            kExitOk)
      << err_.str();
  const std::size_t poses = lines("table.tum");
  EXPECT_GT(poses, 150U) << "20 images a second, from when the start is not taken back any more";
  EXPECT_NEAR(static_cast<double>(lines("table.covariance.csv")), static_cast<double>(poses), 1)
      << "and a header";
  EXPECT_GT(lines("table.live.tum"), 100U);
  EXPECT_LT(evaluated()["pose"]["position_rmse_m"], 0.01);
}

TEST_F(ResolveTest, WithoutAnImuARecordingIsAlwaysResolved) {
  simulate({"--no-imu"});
  ASSERT_EQ(run({"replay", folder_.file("table"), "--out", folder_.file("out")}), kExitOk)
      << err_.str();
  EXPECT_GT(lines("table.covariance.csv"), 150U);
  EXPECT_GT(lines("table.live.tum"), 0U);
}

TEST_F(ResolveTest, GoesOnFromAStoredMapAndSaysWhenThereIsNone) {
  simulate();
  const std::string store = folder_.file("hall.map");
  EXPECT_EQ(run({"replay", folder_.file("table"), "--resolve", "--store", store, "--out",
                 folder_.file("out")}),
            kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("is not there"));
  ASSERT_EQ(run({"simulate", "--room", "table", "--seconds", "15", "--seed", "5", "--out",
                 folder_.file("before")}),
            kExitOk);
  ASSERT_EQ(run({"map", "build", folder_.file("before"), "--store", store}), kExitOk) << err_.str();
  ASSERT_EQ(run({"replay", folder_.file("table"), "--resolve", "--store", store, "--out",
                 folder_.file("out")}),
            kExitOk)
      << err_.str();
  EXPECT_GT(lines("table.tum"), 150U);
  EXPECT_LT(evaluated()["pose"]["position_rmse_m"], 0.01);
}

TEST_F(ResolveTest, BeginsWithOneMapOnly) {
  simulate();
  EXPECT_EQ(run({"replay", folder_.file("table"), "--map", "a.yaml", "--store", "b.map", "--out",
                 folder_.file("out")}),
            kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("not both"));
}

}  // namespace
}  // namespace fiducap
