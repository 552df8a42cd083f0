#include "streaming/qualisys/session.hpp"

#include <gmock/gmock.h>

#include "fake_operator_api.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::qualisys {
namespace {

using testing::HasSubstr;

TEST(QualisysConfig, ReportsEveryBrokenRule) {
  EXPECT_TRUE(QualisysConfig{}.check().empty());
  QualisysConfig config;
  config.address = "localhost";
  config.base_port = 65534;
  config.max_clients = 0;
  config.max_clients_per_address = 257;
  config.qtm_version = "2.17\n";
  const auto errors = config.check();
  ASSERT_EQ(errors.size(), 5u);
  EXPECT_EQ(errors[0].path, "streaming.qualisys.address");
  EXPECT_EQ(errors[1].path, "streaming.qualisys.base_port");
}

class QualisysConnection : public testing::Test {
 protected:
  void SetUp() override { room_.bodies.update(*make_scene_frame({"arm", "drone"})->model); }

  void publish(std::uint64_t number) {
    frame_ = make_scene_frame({"arm", "drone"}, number);
    room_.frames.put(frame_, room_.bodies);
    room_.rate_hz = frame_->rate_hz;
  }
  static std::vector<std::byte> command(std::string_view text,
                                        std::endian order = std::endian::little,
                                        PacketType type = PacketType::kCommand) {
    std::vector<std::byte> out;
    encode_text(order, type, text, out);
    return out;
  }
  /// Each reply as `type text`, an event as `6 number`, joined by `|`.
  static std::string read(std::span<const std::byte> bytes,
                          std::endian order = std::endian::little) {
    std::string all;
    while (!bytes.empty()) {
      const auto packet = decode_packet(order, bytes);
      if (!packet || !*packet) return all + "|broken";
      const auto payload = (*packet)->payload;
      if (!all.empty()) all += '|';
      all += std::to_string(static_cast<unsigned>((*packet)->type)) + " ";
      all += (*packet)->type == PacketType::kEvent
                 ? std::to_string(std::to_integer<int>(payload[0]))
                 : std::string(decode_text(payload));
      bytes = bytes.subspan((*packet)->size);
    }
    return all;
  }
  std::string ask(std::string_view text) {
    out_.clear();
    EXPECT_TRUE(connection_.receive(command(text), out_));
    return read(out_);
  }

  FakeOperatorApi operator_api_;
  SharedState room_{QualisysConfig{}, &operator_api_};
  Connection connection_{room_, Dialect::kLittleEndian, 1, "10.0.0.7", 4711};
  std::shared_ptr<SceneFrame> frame_;
  std::vector<std::byte> out_;
};

TEST_F(QualisysConnection, GreetsAndRepliesToCommands) {
  connection_.greet(out_);
  EXPECT_EQ(read(out_), "1 QTM RT Interface connected");
  const std::pair<const char*, const char*> kDialogue[] = {
      {"Version", "1 Version is 1.1"},
      {"Version 1.28", "1 Version set to 1.28"},
      {"version", "1 Version is 1.28"},
      {"Version 1.29", "0 Version NOT supported"},
      {"Version 1.0", "0 Version NOT supported"},
      {"Version 255.255.255", "0 Version NOT supported"},
      {"Version x", "0 Version NOT supported"},
      {"QTMVersion", "1 QTM Version is 2.17 (build 4050)"},
      {"ByteOrder", "1 Byte order is little endian"},
      {"CheckLicense abc", "1 License pass"},
      {"Dance", "0 Parse error"},
      {"", "0 Parse error"},
      {"GetParameters Weather", "0 Parse error"},
      {"GetCurrentFrame 6D", "4 "},  // no frame yet
      {"StreamFrames AllFrames 6D", "4 "},
      {"GetState", "6 1"}};
  for (const auto& [question, reply] : kDialogue) EXPECT_EQ(ask(question), reply) << question;
  operator_api_.under_way = "take";
  EXPECT_EQ(ask("GetLastEvent"), "6 3");
}

TEST_F(QualisysConnection, OldPortAcceptsOnlyVersion0) {
  Connection old(room_, Dialect::kLegacy, 2, "10.0.0.7", 4712);
  for (const char* text :
       {"Version 1.0", "Version 1.28", "ByteOrder BigEndian", "ByteOrder LittleEndian"}) {
    ASSERT_TRUE(old.receive(command(text, std::endian::big), out_));
  }
  EXPECT_EQ(read(out_, std::endian::big),
            "1 Version set to 1.0|0 Version NOT supported|"
            "1 Byte order is big endian|0 Byte order is chosen by the port");
}

TEST_F(QualisysConnection, SendsParametersInTheVersionOfTheClient) {
  ask("Version 1.25");
  EXPECT_THAT(ask("GetParameters 6D General"),
              testing::AllOf(testing::StartsWith("2 <QTM_Parameters_Ver_1.25><General>"),
                             HasSubstr("<Name>drone</Name>"), testing::Not(HasSubstr("|"))));
}

TEST_F(QualisysConnection, AcceptsBytesCutAnywhere) {
  auto bytes = command("Version 1.28");
  const auto second = command("ByteOrder");
  bytes.insert(bytes.end(), second.begin(), second.end());
  for (const std::byte b : bytes) ASSERT_TRUE(connection_.receive(std::span(&b, 1), out_));
  EXPECT_EQ(read(out_), "1 Version set to 1.28|1 Byte order is little endian");
}

TEST_F(QualisysConnection, EndsOnBrokenFraming) {
  EXPECT_FALSE(connection_.receive(from_hex("ffffffff 01000000"), out_));
}

TEST_F(QualisysConnection, EndsOnAFloodOfQuestions) {
  std::vector<std::byte> many;
  const auto one = command("GetParameters All");
  for (int i = 0; i < 5000; ++i) many.insert(many.end(), one.begin(), one.end());
  EXPECT_FALSE(connection_.receive(many, out_));
  EXPECT_LT(out_.size(), std::size_t{5} << 20);
}

TEST_F(QualisysConnection, EndsAfterFiveWrongPasswords) {
  for (int i = 0; i < 4; ++i) EXPECT_EQ(ask("TakeControl guess"), "0 Wrong or missing password");
  EXPECT_FALSE(connection_.receive(command("TakeControl guess"), out_));
}

TEST_F(QualisysConnection, ReconnectingAllowsNoMoreGuesses) {
  const auto try_one = [&](const std::string& address, const std::string& password) {
    Connection fresh{room_, Dialect::kLittleEndian, 2, address, 4712};
    std::vector<std::byte> out;
    EXPECT_TRUE(fresh.receive(command("TakeControl " + password), out));
    fresh.leave();
    return read(out);
  };
  for (int i = 0; i < 1000; ++i) (void)try_one("10.0.0.9", "guess");
  EXPECT_THAT(try_one("10.0.0.9", "open sesame"), HasSubstr("Too many wrong passwords"));
  EXPECT_EQ(try_one("10.0.0.8", "open sesame"), "1 You are now master");
  room_.now += net::WrongProofs::kWindow;
  EXPECT_EQ(try_one("10.0.0.9", "open sesame"), "1 You are now master");
}

TEST_F(QualisysConnection, StreamsTheRequestedComponentsInTheVersionUntilStop) {
  publish(1);
  EXPECT_FALSE(connection_.stream_of(*frame_));
  ask("Version 1.28");
  EXPECT_EQ(ask("StreamFrames AllFrames 6DEuler"), "");
  const auto profile = connection_.stream_of(*frame_);
  ASSERT_TRUE(profile);
  EXPECT_TRUE(profile->components.has(Component::k6dEuler));
  EXPECT_FALSE(profile->wide);
  EXPECT_FALSE(connection_.udp_port());
  ask("StreamFrames FrequencyDivisor:2 UDP:6734 6D");  // replaces the first
  EXPECT_EQ(connection_.udp_port(), 6734);
  EXPECT_TRUE(connection_.stream_of(*frame_)->components.has(Component::k6d));
  publish(2);
  EXPECT_FALSE(connection_.stream_of(*frame_));
  EXPECT_EQ(ask("StreamFrames Stop"), "");
  publish(3);
  EXPECT_FALSE(connection_.stream_of(*frame_));
  EXPECT_FALSE(connection_.udp_port());
  ask("Version 1.7");
  ask("StreamFrames AllFrames 6D");
  EXPECT_TRUE(connection_.stream_of(*frame_)->wide);
}

TEST_F(QualisysConnection, RefusesAnInvalidStreamAndKeepsTheOldOne) {
  publish(1);
  ask("StreamFrames AllFrames 6D");
  for (const char* no : {"StreamFrames AllFrames", "StreamFrames", "StreamFrames 6D",
                         "StreamFrames AllFrames UDP:1 6D"}) {
    EXPECT_EQ(ask(no), "0 Parse error") << no;
  }
  EXPECT_TRUE(connection_.stream_of(*frame_));
}

TEST_F(QualisysConnection, StreamsToNoThirdParty) {
  publish(1);
  EXPECT_EQ(ask("StreamFrames AllFrames UDP:10.0.0.8:6734 6D"),
            "0 UDP goes to the client's own address only");
  EXPECT_FALSE(connection_.streaming());
  EXPECT_EQ(ask("StreamFrames AllFrames UDP:10.0.0.7:6734 6D"), "");
  EXPECT_EQ(connection_.udp_port(), 6734);
}

TEST_F(QualisysConnection, SendsEachRequestedFrameOnce) {
  publish(1);
  EXPECT_FALSE(connection_.current_of(1));
  EXPECT_EQ(ask("GetCurrentFrame 6D"), "");
  EXPECT_EQ(ask("GetCurrentFrame 6DRes"), "");
  EXPECT_TRUE(connection_.current_of(1)->components.has(Component::k6d));
  EXPECT_FALSE(connection_.current_of(1));
  EXPECT_TRUE(connection_.current_of(2)->components.has(Component::k6dRes));
  EXPECT_FALSE(connection_.current_of(3));
  for (int i = 0; i < 16; ++i) EXPECT_EQ(ask("GetCurrentFrame 6D"), "");
  EXPECT_EQ(ask("GetCurrentFrame 6D"), "0 Too many frames are asked for");
}

TEST_F(QualisysConnection, ControlUsesTheOperatorApi) {
  EXPECT_EQ(ask("Start"), "0 You must be master to issue this command");
  EXPECT_EQ(ask("TakeControl open sesame"), "1 You are now master");
  EXPECT_EQ(ask("Start"), "1 Starting measurement");
  EXPECT_TRUE(operator_api_.under_way);
  EXPECT_THAT(connection_.detail(), HasSubstr("master"));
  ASSERT_TRUE(connection_.receive(
      command("<S><The_6D><Body><Name>arm</Name><Enabled>False</Enabled></Body></The_6D></S>",
              std::endian::little, PacketType::kXml),
      out_));
  EXPECT_EQ(operator_api_.enabled, (std::map<int, bool>{{1, false}}));
  connection_.leave();
  EXPECT_EQ(ask("Stop"), "0 You must be master to issue this command");
}

/// Number of frames that are taken in `seconds` at 100 Hz, from a time that is not round.
int taken(Rate rate, int seconds, std::int64_t jitter_ns = 0) {
  FramePicker picker(rate);
  SceneFrame frame;
  frame.rate_hz = 100;
  int count = 0;
  for (int i = 0; i < 100 * seconds; ++i) {
    frame.number = static_cast<std::uint64_t>(i) + 41;
    frame.at = instant_from_ns(1'234'567'891 + i * 10'000'000LL + (i % 3 - 1) * jitter_ns);
    if (picker.wants(frame)) ++count;
  }
  return count;
}

TEST(QualisysFramePicker, TakesFramesAtTheRequestedRate) {
  EXPECT_EQ(taken({}, 2), 200);
  EXPECT_EQ(taken({RateKind::kFrequencyDivisor, 4}, 2), 50);
  EXPECT_EQ(taken({RateKind::kFrequencyDivisor, 1000}, 2), 1);
  EXPECT_EQ(taken({RateKind::kFrequency, 1000}, 2), 200) << "above the rate of the frames";
  constexpr int kEnds = 1;  // the first frame is always taken
  for (const std::uint32_t hz : {1U, 7U, 30U, 50U, 60U, 99U, 100U}) {
    for (const std::int64_t jitter_ns : {0, 300'000}) {
      const int count = taken({RateKind::kFrequency, hz}, 10, jitter_ns);
      EXPECT_NEAR(count, 10 * static_cast<int>(hz), kEnds) << hz << " Hz";
    }
  }
}

TEST(QualisysFramePicker, DoesNotCatchUpAfterAPause) {
  FramePicker picker({RateKind::kFrequency, 10});
  SceneFrame frame;
  frame.rate_hz = 100;
  EXPECT_TRUE(picker.wants(frame));
  frame.at = frame.at + std::chrono::seconds(60);
  int count = 0;
  for (int i = 0; i < 100; ++i) {
    count += picker.wants(frame) ? 1 : 0;
    frame.at = frame.at + std::chrono::milliseconds(10);
  }
  EXPECT_EQ(count, 10);
}

}  // namespace
}  // namespace fiducap::qualisys
