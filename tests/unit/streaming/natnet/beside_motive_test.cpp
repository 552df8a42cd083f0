// What a commercial server sent, and what we send to the same requests, field by field. The table
// in docs/natnet-clients.md lists the intended differences.
#include <gmock/gmock.h>

#include "conversation_fixture.hpp"
#include "support/shared_data.hpp"
#include "wire_fields.hpp"

namespace fiducap::natnet {
namespace {

constexpr std::uint16_t kCommandPort = 1510;
constexpr std::uint16_t kDataPort = 1511;
constexpr double kFloat = 1e-6;  // relative, of a float32

/// Our server in the place of the one that was recorded: one body of the same name and number.
class BesideMotive : public ConversationFixture {
 protected:
  void SetUp() override {
    const auto data = shared_data();
    if (!data) GTEST_SKIP() << kNoSharedData;
    folder_ = (*data / "wire").string();
    ConversationFixture::SetUp();
    auto frame = make_scene_frame({"RaceQuad"}, 162734);
    auto model = std::make_shared<SceneModel>();
    model->generation = 2;
    model->bodies = {{2, "RaceQuad"}};
    frame->model = model;
    frame->bodies[0].body_id = 2;
    frame->bodies[0].X_WP = {};
    frame->at = frame->published_at = now_;
    frame->rate_hz = 120;
    conversation_->take(frame, now_);
    now_ += Conversation::kAnnounce;  // the model is announced
    conversation_->take(frame, now_);
  }
  [[nodiscard]] Bytes ours_at(Bitstream version) {
    config_.bitstream = text_of(version);
    SetUp();
    const auto frame = conversation_->multicast_frame(now_);
    return {frame.begin(), frame.end()};
  }
  [[nodiscard]] std::string packet(const std::string& name) const {
    return folder_ + "/natnet_python_natnet/test_data/" + name;
  }

  std::string folder_;
};

std::vector<std::string> without_markers(const std::vector<std::string>& names) {
  std::vector<std::string> kept;
  for (const auto& name : names) {
    const bool marker = name.rfind("marker_set.", 0) == 0 || name.rfind("other_marker.", 0) == 0 ||
                        name.rfind("labeled.", 0) == 0;
    if (!marker) kept.push_back(name);
  }
  return kept;
}

TEST_F(BesideMotive, EveryFrameOfTheSessionIsTakenApartToItsLastByteAndSoIsOurs) {
  int frames = 0;
  double last = 0;
  const auto ours = take_apart(ours_at({3, 0}), {3, 0});
  ASSERT_TRUE(ours);
  for (const auto& datagram : read_capture(packet("raw/traffic.pcapng"))) {
    if (id_of(datagram.bytes) != Message::kFrame) continue;
    EXPECT_EQ(datagram.from_port, kDataPort);
    EXPECT_EQ(datagram.to_port, kDataPort);
    const auto theirs = take_apart(datagram.bytes, {3, 0});
    ASSERT_TRUE(theirs);
    ASSERT_THAT(ours->structure(), testing::ElementsAreArray(without_markers(theirs->structure())));
    if (frames > 0) EXPECT_EQ((*theirs)["frame"], last + 1);
    last = *(*theirs)["frame"];
    for (const char* zero : {"timecode", "timecode_sub", "params", "end", "skeletons"}) {
      EXPECT_EQ((*theirs)[zero], 0) << zero;
      EXPECT_EQ((*ours)[zero], 0) << zero;
    }
    EXPECT_LE((*theirs)["mid_exposure"], (*theirs)["data_received"]);
    EXPECT_LE((*theirs)["data_received"], (*theirs)["transmit"]);
    ++frames;
  }
  EXPECT_EQ(frames, 518);
}

TEST_F(BesideMotive, FramesOfItsOlderVersionsHaveTheFieldsOfOurs) {
  const std::pair<const char*, Bitstream> kVersions[] = {
      {"1.5.0", {2, 5}}, {"1.7.2", {2, 7}}, {"1.9.0", {2, 9}}};
  for (const auto& [motive, version] : kVersions) {
    for (const char* number : {"001", "002"}) {
      const auto theirs =
          take_apart(read_bytes(folder_ + "/natnet_natnet-decode/tests/data/frame-motive-" +
                                motive + "-" + number + ".bin"),
                     version);
      ASSERT_TRUE(theirs) << motive;
      const auto ours = take_apart(ours_at(version), version);
      ASSERT_TRUE(ours) << motive;
      EXPECT_THAT(ours->structure(),
                  testing::ElementsAreArray(without_markers(theirs->structure())));
      ASSERT_EQ(theirs->bodies.size(), 1U);
      EXPECT_EQ(theirs->bodies[0].size(), ours->bodies.at(0).size());
      // Its latency is the time stamp once more, as a float.
      if (const auto stamp = (*theirs)["timestamp"]) {
        EXPECT_NEAR(*(*theirs)["latency"], *stamp, 1e-6 * *stamp) << motive;
      }
    }
  }
}

TEST_F(BesideMotive, ABodyInTheSamePoseIsTheSameBytes) {
  const auto theirs = read_bytes(packet("mocapframe_packet_v3.bin"));
  const auto read = take_apart(theirs, {3, 0});
  ASSERT_TRUE(read);
  const auto& body = read->bodies.at(0);
  const auto at = [&](std::size_t i) { return body.at(i).value; };
  // Their y-up axes to ours: x east, y north is their -z, z up is their y.
  const Eigen::Quaterniond q(at(7), at(4), -at(6), at(5));
  auto frame = make_scene_frame({"RaceQuad"}, 162734);
  frame->bodies[0].body_id = 2;
  frame->bodies[0].X_WP = {q.normalized(), {at(1), -at(3), at(2)}};
  frame->bodies[0].covariance = Matrix12d::Identity() * (at(8) * at(8));
  conversation_->take(frame, now_);
  const auto bytes = conversation_->multicast_frame(now_);
  const auto ours = take_apart(bytes, {3, 0});
  ASSERT_TRUE(ours);
  ASSERT_EQ(ours->bodies.at(0).size(), body.size());
  for (std::size_t i = 0; i < body.size(); ++i) {
    if (body[i].name == "body.mean_error") continue;  // ours is made of three axes
    EXPECT_NEAR(ours->bodies[0][i].value, body[i].value, kFloat * std::abs(body[i].value) + kFloat)
        << body[i].name;
  }
  EXPECT_EQ((*ours)["frame"], (*read)["frame"]);
}

TEST_F(BesideMotive, EveryRequestOfTheSessionGetsAnAnswerOfTheSameKind) {
  const auto session = read_capture(packet("raw/traffic.pcapng"));
  std::vector<CapturedDatagram> asked;
  int compared = 0;
  for (const auto& datagram : session) {
    if (datagram.to_port == kCommandPort) asked.push_back(datagram);
    if (datagram.from_port != kCommandPort || asked.empty()) continue;
    const auto question = std::find_if(asked.begin(), asked.end(), [&](const auto& one) {
      const auto kind = [](Message m) { return static_cast<int>(m); };
      const int q = kind(id_of(one.bytes));
      const int a = kind(id_of(datagram.bytes));
      return a == q + 1 || (q == kind(Message::kDiscovery) && a == 1) ||
             (q == kind(Message::kRequest) && a == 100);
    });
    ASSERT_NE(question, asked.end()) << static_cast<int>(id_of(datagram.bytes));
    const bool library_check = text_in(question->bytes).rfind("service20", 0) == 0;
    const auto ours = say(question->bytes, kClient, Channel::kMulticast);
    ASSERT_GE(ours.size(), kHeaderSize);
    if (!library_check) {
      EXPECT_EQ(id_of(ours), id_of(datagram.bytes)) << text_in(question->bytes);
      const bool same_size =
          id_of(ours) != Message::kModel && id_of(ours) != Message::kUnrecognized;
      if (same_size) EXPECT_EQ(ours.size(), datagram.bytes.size());
      ++compared;
    }
    asked.erase(question);
  }
  EXPECT_EQ(compared, 15);
}

TEST_F(BesideMotive, TheServersInfoDiffersOnlyWhereItMust) {
  const auto theirs = read_bytes(packet("serverinfo_packet_v3.bin"));
  const auto ours = say(read_bytes(packet("connect_packet_v3.bin")), kClient, Channel::kMulticast);
  ASSERT_EQ(ours.size(), theirs.size());
  EXPECT_TRUE(std::equal(theirs.begin(), theirs.begin() + kHeaderSize, ours.begin()));
  constexpr std::size_t kNatNetMajor = kHeaderSize + 260;
  EXPECT_EQ(ours[kNatNetMajor], theirs[kNatNetMajor]);
  constexpr std::size_t kDataPortAndGroup = kHeaderSize + 272;
  EXPECT_TRUE(std::equal(theirs.begin() + kDataPortAndGroup, theirs.end(),
                         ours.begin() + kDataPortAndGroup))
      << "port 1511, multicast, 239.255.42.99";
}

TEST_F(BesideMotive, TheModelDescribesTheBodyAlikeButForItsMarkers) {
  const auto theirs = read_bytes(packet("modeldef_packet_v3.bin"));
  const auto ours =
      say(read_bytes(packet("requestmodeldef_packet_v3.bin")), kClient, Channel::kMulticast);
  constexpr std::size_t kCount = kHeaderSize;
  constexpr std::size_t kBody = kHeaderSize + 4;
  constexpr std::size_t kUpToMarkers = 4 + 9 + 4 + 4 + 12;  // type, "RaceQuad", id, parent, offset
  ASSERT_EQ(ours.size(), kBody + kUpToMarkers + 4);
  EXPECT_EQ(ours[kCount], std::byte{1});
  EXPECT_EQ(theirs[kCount], std::byte{3}) << "the body, and two sets of its markers";
  EXPECT_TRUE(std::equal(ours.begin() + kBody, ours.begin() + kBody + kUpToMarkers,
                         theirs.begin() + kBody));
}

}  // namespace
}  // namespace fiducap::natnet
