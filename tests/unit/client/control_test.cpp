// The control channel, both ends, over a real loopback socket.
#include "fiducap/control.hpp"

#include <gtest/gtest.h>

#include "streaming/net/limits.hpp"
#include "support/fake_operator_api.hpp"
#include "test_server.hpp"

namespace fiducap {
namespace {

/// A connection from an address of 127.0.0.0/8 that has been greeted and says nothing.
class Watcher {
 public:
  Watcher(std::uint32_t host, std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_addr.s_addr = htonl(host);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&here), sizeof(here)), 0);
    sockaddr_in there = here;
    there.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    there.sin_port = htons(port);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&there), sizeof(there)), 0);
    char greeting = 0;
    (void)!::recv(socket_, &greeting, 1, 0);
  }
  Watcher(Watcher&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}
  Watcher& operator=(Watcher&&) = delete;
  ~Watcher() {
    if (socket_ >= 0) ::close(socket_);
  }

 private:
  int socket_;
};

class ControlTest : public testing::Test {
 protected:
  ControlOptions options(const std::string& token = "correct horse") const {
    ControlOptions made;
    made.port = server_.port();
    made.token = token;
    made.timeout = kPatience;
    return made;
  }

  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone", "arm"});
  FakeOperatorApi operator_api_;
  TestServer server_{*scene_, 0, {}, &operator_api_};
};

TEST_F(ControlTest, ListsAllBodiesAndWhatTheServerIsAbout) {
  Control control(options());
  ControlState state;
  operator_api_.mode = MapMode::kMapping;
  operator_api_.under_way = "monday";
  using State = RecordingStatus::State;
  operator_api_.known = {{"sunday", State::kFailed, "the disk is full", 1200, 34567, 8},
                         {"monday", State::kRecording, "", 10, 2000, 0}};
  const auto outcome = control.list(state);
  ASSERT_TRUE(outcome) << outcome.problem;
  ASSERT_EQ(state.bodies.size(), 2u);
  EXPECT_EQ(state.bodies[1].id, 2);
  EXPECT_EQ(state.bodies[1].name, "arm");
  EXPECT_FALSE(state.bodies[1].enabled);
  EXPECT_EQ(state.bodies[1].pivot_position_m, (std::array<double, 3>{0.1, 0.2, 0.3}));
  EXPECT_TRUE(state.mapping);
  EXPECT_EQ(state.recording, "monday");
  ASSERT_EQ(state.recordings.size(), 2u);
  const Recording& sunday = state.recordings[0];
  EXPECT_EQ(sunday.name, "sunday");
  EXPECT_EQ(sunday.state, RecordingState::kFailed);
  EXPECT_EQ(sunday.reason, "the disk is full");
  EXPECT_EQ(sunday.samples, 1200u);
  EXPECT_EQ(sunday.bytes, 34567u);
  EXPECT_EQ(sunday.dropped, 8u);
  EXPECT_EQ(state.recordings[1].state, RecordingState::kRecording);
}

TEST_F(ControlTest, CarriesOutEveryCommandOnOneConnection) {
  Control control(options());
  EXPECT_TRUE(control.set_enabled(2, true));
  EXPECT_TRUE(operator_api_.all[1].enabled);
  EXPECT_TRUE(control.rename(1, "quad"));
  EXPECT_EQ(operator_api_.all[0].name, "quad");
  EXPECT_TRUE(control.set_pivot(1, {1, 2, 3}, {2 / 9., 4 / 9., 5 / 9., 6 / 9.}));
  EXPECT_EQ(operator_api_.all[0].X_BP.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(operator_api_.all[0].X_BP.q.z(), 6 / 9., 1e-15);
  EXPECT_TRUE(control.set_mapping(true));
  EXPECT_EQ(operator_api_.mode, MapMode::kMapping);
  EXPECT_TRUE(control.commit_map());
  EXPECT_EQ(operator_api_.changes.size(), 1U);
  EXPECT_TRUE(control.start_recording("tuesday"));
  EXPECT_EQ(operator_api_.under_way, "tuesday");
  EXPECT_TRUE(control.stop_recording());
  EXPECT_FALSE(operator_api_.under_way);
}

template <typename Change>
Change change_in(const FakeOperatorApi& operator_api, std::size_t i) {
  return std::get<Change>(operator_api.changes.at(i));
}

TEST_F(ControlTest, ChangesOfTheMapArriveAsTheyWereSent) {
  Control control(options());
  ASSERT_TRUE(control.commit_map("before the move"));
  ASSERT_TRUE(control.name_version(12, "monday"));
  ASSERT_TRUE(control.roll_back(12));
  ASSERT_TRUE(control.align_map({{3, {1, 2, 3}}, {4, {-1, 0.5, 0}}}));
  ASSERT_TRUE(control.quarantine_tag(0));
  ASSERT_TRUE(control.forget_tag(586));
  EXPECT_EQ(change_in<CommitVersion>(operator_api_, 0).name, "before the move");
  EXPECT_EQ(change_in<NameVersion>(operator_api_, 1).version, 12);
  EXPECT_EQ(change_in<NameVersion>(operator_api_, 1).name, "monday");
  EXPECT_EQ(change_in<RollBack>(operator_api_, 2).version, 12);
  const auto align = change_in<AlignMap>(operator_api_, 3);
  ASSERT_EQ(align.places.size(), 2U);
  EXPECT_EQ(align.places[1].tag_id, 4);
  EXPECT_EQ(align.places[1].p_RT, Eigen::Vector3d(-1, 0.5, 0));
  EXPECT_EQ(change_in<QuarantineTag>(operator_api_, 4).tag_id, 0);
  EXPECT_EQ(change_in<ForgetTag>(operator_api_, 5).tag_id, 586);
  EXPECT_FALSE(control.forget_tag(-1)) << "no tag has such an id";
  operator_api_.refusal = "the map is frozen";
  EXPECT_NE(control.roll_back(12).problem.find("the map is frozen"), std::string::npos);
}

TEST_F(ControlTest, TheVersionOfTheMapIsListed) {
  auto map = std::make_shared<TagMap>();
  map->version = 7;
  operator_api_.served = map;
  Control control(options());
  ControlState state;
  ASSERT_TRUE(control.list(state));
  EXPECT_EQ(state.map_version, 7);
}

TEST_F(ControlTest, SaysWhatTheDeskRefuses) {
  Control control(options());
  EXPECT_NE(control.rename(7, "x").problem.find("7"), std::string::npos);
  EXPECT_NE(control.rename(1, "").problem.find("empty"), std::string::npos);
  EXPECT_FALSE(control.set_pivot(1, {0, 0, 0}, {1, 1, 0, 0})) << "not of unit length";
  EXPECT_FALSE(control.set_enabled(-1, true));
  EXPECT_TRUE(control.commit_map()) << "and the connection goes on";
}

TEST_F(ControlTest, RefusesAWrongTokenAndDoesNothing) {
  for (const auto* token : {"", "correct horsf", "correct horse "}) {
    Control control(options(token));
    const auto outcome = control.set_mapping(true);
    EXPECT_FALSE(outcome);
    EXPECT_NE(outcome.problem.find("token"), std::string::npos) << outcome.problem;
  }
  EXPECT_EQ(operator_api_.mode, MapMode::kFrozen);
}

TEST_F(ControlTest, TakesNoCommandsWithoutAConfiguredToken) {
  operator_api_.operator_token.clear();
  Control control(options(""));
  const auto outcome = control.commit_map();
  EXPECT_FALSE(outcome);
  EXPECT_NE(outcome.problem.find("operator.token"), std::string::npos) << outcome.problem;
  EXPECT_EQ(operator_api_.changes.size(), 0U);
}

TEST_F(ControlTest, ShutsOutWhoGuesses) {
  for (int i = 0; i < net::WrongProofs::kAllowed; ++i)
    EXPECT_FALSE(Control(options("guess")).commit_map());
  EXPECT_FALSE(Control(options()).commit_map()) << "not even with the right token, for ten seconds";
  server_.clock().advance(net::WrongProofs::kWindow);
  server_.publish(scene_);  // forgets the connections that ended
  Control control(options());
  const auto outcome = control.commit_map();
  EXPECT_TRUE(outcome) << outcome.problem;
}

TEST_F(ControlTest, TheOperatorGetsInThoughManyAddressesHoldAllPlaces) {
  std::vector<Watcher> watchers;
  for (std::uint32_t i = 0; i < 32; ++i) watchers.emplace_back(0x7f000010 + i, server_.port());
  EXPECT_FALSE(Control(options()).commit_map()) << "each has time to prove itself";
  server_.clock().advance(std::chrono::seconds(3));
  Control control(options());
  const auto outcome = control.commit_map();
  ASSERT_TRUE(outcome) << outcome.problem;
  for (std::uint32_t i = 0; i < 32; ++i) watchers.emplace_back(0x7f000050 + i, server_.port());
  EXPECT_TRUE(control.commit_map()) << "and keeps the place";
}

TEST_F(ControlTest, SaysThatNobodyListens) {
  auto nowhere = options();
  { nowhere.port = TestServer(*scene_).port(); }
  const auto outcome = Control(nowhere).commit_map();
  EXPECT_FALSE(outcome);
  EXPECT_NE(outcome.problem.find(std::to_string(nowhere.port)), std::string::npos)
      << outcome.problem;
}

TEST_F(ControlTest, ComesBackAfterARestartOfTheServer) {
  std::uint16_t port = 0;
  auto first = std::make_unique<TestServer>(*scene_, port, native::NativeConfig{}, &operator_api_);
  auto there = options();
  there.port = first->port();
  Control control(there);
  ASSERT_TRUE(control.commit_map());
  first.reset();
  EXPECT_FALSE(control.commit_map());
  first = std::make_unique<TestServer>(*scene_, there.port, native::NativeConfig{}, &operator_api_);
  const auto outcome = control.commit_map();
  EXPECT_TRUE(outcome) << outcome.problem;
}

}  // namespace
}  // namespace fiducap
