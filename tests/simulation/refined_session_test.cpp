// A session of the whole server whose map is refined, recorded and replayed.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <thread>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "support/running_server.hpp"
#include "support/temporary_folder.hpp"
#include "tools/replay/replay_inputs.hpp"
#include "tools/replay/replay_verbs.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

class RefinedSessionTest : public testing::Test {
 protected:
  /// Three robots in real time until the map has adopted this number of solutions.
  void serve_and_record(int refinements) {
    ServerConfig config = corner_demo();
    config.map.builder.refine_period_s = 0.5;
    config.recorder.folder = folder_.file("recordings");
    config.recorder.at_start = "session";
    RunningServer server(config);
    for (int i = 0; i < 1200 && adopted() < refinements; ++i) std::this_thread::sleep_for(50ms);
    server.stop();
    ASSERT_TRUE(server.clean());
    ASSERT_GE(adopted(), refinements) << "not within a minute";
  }
  /// On disk.
  [[nodiscard]] int adopted() const {
    const auto turns = read_refinement_turns(session() + "/refinements.csv");
    return turns ? static_cast<int>(std::count_if(turns->begin(), turns->end(),
                                                  [](const auto& t) { return t.adopted; }))
                 : 0;
  }
  /// @return the replay's report about the live estimates
  nlohmann::json replay() {
    ReplayArguments arguments;
    arguments.recordings = {session()};
    arguments.out = folder_.file("out");
    std::ostringstream out;
    std::ostringstream err;
    EXPECT_EQ(run_replay(arguments, {out, err}), 0) << err.str();
    const auto report = read_whole_file(folder_.file("out/report.json"));
    return report ? nlohmann::json::parse(*report)["live"] : nlohmann::json{};
  }
  [[nodiscard]] std::string session() const { return folder_.file("recordings/session"); }

  TemporaryFolder folder_;
};

TEST_F(RefinedSessionTest, IsReplayedToTheLastBit) {
  serve_and_record(5);
  auto live = replay();
  EXPECT_EQ(live["turns_missed"], 0);
  EXPECT_GT(live["compared"], 100);
  EXPECT_EQ(live["different"], 0) << live;

  // That it could be otherwise: without the refinements it is another session.
  std::ofstream(session() + "/refinements.csv") << "#taken_after,adopted_after\n";
  live = replay();
  EXPECT_GT(live["different"], 100) << live;
}

}  // namespace
}  // namespace fiducap
