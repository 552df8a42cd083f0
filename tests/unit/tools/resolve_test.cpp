// `fiducap replay --resolve`.
#include <gmock/gmock.h>

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "support/command_run.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;
using Words = std::vector<std::string>;

class ResolveTest : public testing::Test {
 protected:
  /// @return stdout, or stderr of a failure
  static std::string run(const Words& words, int exit_code = kExitOk) {
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, exit_code) << run.err;
    return exit_code == kExitOk ? run.out : run.err;
  }
  void simulate(const std::string& name, const Words& more = {}) const {
    Words words{"simulate", "--room", "table", "--seconds", "15", "--out", folder_.file(name)};
    words.insert(words.end(), more.begin(), more.end());
    run(words);
  }
  std::string replay(const Words& more, int exit_code = kExitOk) const {
    Words words{"replay", folder_.file("table"), "--out", folder_.file("out")};
    words.insert(words.end(), more.begin(), more.end());
    return run(words, exit_code);
  }
  [[nodiscard]] std::size_t lines(const std::string& name) const {
    const auto text = read_whole_file(folder_.file("out/" + name));
    return text ? static_cast<std::size_t>(std::count(text->begin(), text->end(), '\n')) : 0;
  }
  [[nodiscard]] double position_rmse_m() const {
    const auto json = nlohmann::json::parse(
        run({"evaluate", folder_.file("out/table.tum"), folder_.file("table"), "--json"}));
    return json["pose"]["position_rmse_m"];
  }

  TemporaryFolder folder_;
};

TEST_F(ResolveTest, WritesPosesCovariancesAndLivePoses) {
  simulate("table");
  replay({"--resolve"});
  const std::size_t poses = lines("table.tum");
  EXPECT_GT(poses, 150U) << "20 images per second, from when the start is final";
  EXPECT_NEAR(static_cast<double>(lines("table.covariance.csv")), static_cast<double>(poses), 1)
      << "and a header";
  EXPECT_GT(lines("table.live.tum"), 100U);
  EXPECT_LT(position_rmse_m(), 0.01);
}

TEST_F(ResolveTest, IsTheOnlyWayWithoutAnImu) {
  simulate("table", {"--no-imu"});
  replay({});
  EXPECT_GT(lines("table.covariance.csv"), 150U);
  EXPECT_GT(lines("table.live.tum"), 0U);
}

TEST_F(ResolveTest, StartsFromAStoredMap) {
  simulate("table");
  const std::string store = folder_.file("hall.map");
  EXPECT_THAT(replay({"--resolve", "--store", store}, kExitFailed), HasSubstr("is not there"));
  simulate("before", {"--seed", "5"});
  run({"map", "build", folder_.file("before"), "--store", store});
  replay({"--resolve", "--store", store});
  EXPECT_GT(lines("table.tum"), 150U);
  EXPECT_LT(position_rmse_m(), 0.01);
  EXPECT_THAT(replay({"--map", "a.yaml", "--store", "b.map"}, kExitFailed), HasSubstr("not both"));
}

}  // namespace
}  // namespace fiducap
