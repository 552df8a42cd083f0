// The control channel, both ends, over a real loopback socket.
#include "fiducap/control.hpp"

#include <gmock/gmock.h>

#include <boost/asio/ip/tcp.hpp>

#include "support/fake_operator_api.hpp"
#include "test_server.hpp"

namespace fiducap {
namespace {

using boost::asio::ip::address_v4;
using boost::asio::ip::tcp;
using testing::ElementsAre;
using testing::FieldsAre;

/// A connection from an address of 127.0.0.0/8 that has been greeted and sends nothing.
tcp::socket silent_connection(boost::asio::io_context& io, std::uint32_t host, std::uint16_t port) {
  tcp::socket socket(io, tcp::endpoint(address_v4(host), 0));
  socket.connect({address_v4::loopback(), port});
  char greeting = 0;
  boost::system::error_code closed;  // by a server without a place for it
  socket.receive(boost::asio::buffer(&greeting, 1), 0, closed);
  return socket;
}

class ControlTest : public testing::Test {
 protected:
  ControlOptions options(const std::string& token = "correct horse") const {
    ControlOptions made;
    made.port = server_.port();
    made.token = token;
    made.timeout = kTimeout;
    return made;
  }
  static void expect_done(const Outcome& outcome) { EXPECT_TRUE(outcome) << outcome.problem; }
  static void expect_refused(const Outcome& outcome, const std::string& reason) {
    EXPECT_FALSE(outcome);
    EXPECT_THAT(outcome.problem, testing::HasSubstr(reason));
  }
  template <typename Change>
  Change change(std::size_t i) const {
    return std::get<Change>(operator_api_.changes.at(i));
  }

  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone", "arm"});
  FakeOperatorApi operator_api_;
  TestServer server_{*scene_, 0, {}, &operator_api_};
};

TEST_F(ControlTest, ListsBodiesMapAndRecordings) {
  Control control(options());
  ControlState state;
  operator_api_.mode = MapMode::kMapping;
  operator_api_.under_way = "monday";
  using State = RecordingStatus::State;
  operator_api_.known = {{"sunday", State::kFailed, "the disk is full", 1200, 34567, 8},
                         {"monday", State::kRecording, "", 10, 2000, 0}};
  auto map = std::make_shared<TagMap>();
  map->version = 7;
  operator_api_.served = map;
  expect_done(control.list(state));
  ASSERT_EQ(state.bodies.size(), 2u);
  EXPECT_EQ(state.bodies[1].id, 2);
  EXPECT_EQ(state.bodies[1].name, "arm");
  EXPECT_FALSE(state.bodies[1].enabled);
  EXPECT_THAT(state.bodies[1].pivot_position_m, ElementsAre(0.1, 0.2, 0.3));
  EXPECT_TRUE(state.mapping);
  EXPECT_EQ(state.map_version, 7);
  EXPECT_EQ(state.recording, "monday");
  ASSERT_EQ(state.recordings.size(), 2u);
  EXPECT_THAT(state.recordings[0],
              FieldsAre("sunday", RecordingState::kFailed, "the disk is full", 1200u, 34567u, 8u));
  EXPECT_EQ(state.recordings[1].state, RecordingState::kRecording);
}

TEST_F(ControlTest, ExecutesAllCommandsOnOneConnection) {
  Control control(options());
  expect_done(control.set_enabled(2, true));
  EXPECT_TRUE(operator_api_.all[1].enabled);
  expect_done(control.rename(1, "quad"));
  EXPECT_EQ(operator_api_.all[0].name, "quad");
  expect_done(control.set_pivot(1, {1, 2, 3}, {2 / 9., 4 / 9., 5 / 9., 6 / 9.}));
  EXPECT_EQ(operator_api_.all[0].X_BP.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(operator_api_.all[0].X_BP.q.z(), 6 / 9., 1e-15);
  expect_done(control.set_mapping(true));
  EXPECT_EQ(operator_api_.mode, MapMode::kMapping);
  expect_done(control.start_recording("tuesday"));
  EXPECT_EQ(operator_api_.under_way, "tuesday");
  expect_done(control.stop_recording());
  EXPECT_FALSE(operator_api_.under_way);

  expect_done(control.commit_map("before the move"));
  EXPECT_EQ(change<CommitVersion>(0).name, "before the move");
  expect_done(control.name_version(12, "monday"));
  EXPECT_THAT(change<NameVersion>(1), FieldsAre(12, "monday"));
  expect_done(control.roll_back(12));
  EXPECT_EQ(change<RollBack>(2).version, 12);
  expect_done(control.align_map({{3, {1, 2, 3}}, {4, {-1, 0.5, 0}}}));
  const auto places = change<AlignMap>(3).places;
  EXPECT_THAT(places, ElementsAre(FieldsAre(3, Eigen::Vector3d(1, 2, 3)),
                                  FieldsAre(4, Eigen::Vector3d(-1, 0.5, 0))));
  expect_done(control.quarantine_tag(0));
  EXPECT_EQ(change<QuarantineTag>(4).tag_id, 0);
  expect_done(control.forget_tag(586));
  EXPECT_EQ(change<ForgetTag>(5).tag_id, 586);
}

TEST_F(ControlTest, ReportsRefusalsAndKeepsTheConnection) {
  Control control(options());
  expect_refused(control.rename(7, "x"), "7");
  expect_refused(control.rename(1, ""), "empty");
  EXPECT_FALSE(control.set_pivot(1, {0, 0, 0}, {1, 1, 0, 0})) << "not of unit length";
  EXPECT_FALSE(control.set_enabled(-1, true));
  EXPECT_FALSE(control.forget_tag(-1));
  expect_done(control.commit_map());
  operator_api_.refusal = "the map is frozen";
  expect_refused(control.roll_back(12), "the map is frozen");
}

TEST_F(ControlTest, RefusesAWrongToken) {
  for (const auto* token : {"", "correct horsf", "correct horse "})
    expect_refused(Control(options(token)).set_mapping(true), "token");
  EXPECT_EQ(operator_api_.mode, MapMode::kFrozen);
}

TEST_F(ControlTest, RefusesCommandsWithoutAConfiguredToken) {
  operator_api_.operator_token.clear();
  expect_refused(Control(options("")).commit_map(), "operator.token");
  EXPECT_EQ(operator_api_.changes.size(), 0U);
}

TEST_F(ControlTest, OperatorConnectsThoughOtherAddressesHoldAllPlaces) {
  boost::asio::io_context io;
  std::vector<tcp::socket> silent;
  const auto connect_32 = [&](std::uint32_t first_host) {
    for (std::uint32_t i = 0; i < 32; ++i)
      silent.push_back(silent_connection(io, first_host + i, server_.port()));
  };
  connect_32(0x7f000010);
  EXPECT_FALSE(Control(options()).commit_map()) << "each has time to prove itself";
  server_.clock().advance(std::chrono::seconds(3));
  Control control(options());
  expect_done(control.commit_map());
  connect_32(0x7f000050);
  expect_done(control.commit_map());
}

TEST_F(ControlTest, ReportsThatThereIsNoServer) {
  auto nowhere = options();
  nowhere.port = TestServer(*scene_).port();
  expect_refused(Control(nowhere).commit_map(), std::to_string(nowhere.port));
}

TEST_F(ControlTest, ReconnectsToARestartedServer) {
  auto there = options();
  const auto start = [&](std::uint16_t port) {
    return std::make_unique<TestServer>(*scene_, port, native::NativeConfig{}, &operator_api_);
  };
  auto server = start(0);
  there.port = server->port();
  Control control(there);
  expect_done(control.commit_map());
  server.reset();
  EXPECT_FALSE(control.commit_map());
  server = start(there.port);
  expect_done(control.commit_map());
}

}  // namespace
}  // namespace fiducap
