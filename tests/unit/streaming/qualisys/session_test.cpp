#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fake_operator_api.hpp"
#include "streaming/qualisys/session.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::qualisys {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

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
  /// The answers as `type text`; an event as `6 number`.
  static std::vector<std::string> read(std::span<const std::byte> bytes,
                                       std::endian order = std::endian::little) {
    std::vector<std::string> all;
    while (!bytes.empty()) {
      const auto packet = decode_packet(order, bytes);
      if (!packet || !*packet) return all.push_back("broken"), all;
      const auto type = static_cast<unsigned>((*packet)->type);
      const std::string text = (*packet)->type == PacketType::kEvent
                                   ? std::to_string(std::to_integer<int>((*packet)->payload[0]))
                                   : std::string(decode_text((*packet)->payload));
      all.push_back(std::to_string(type) + " " + text);
      bytes = bytes.subspan((*packet)->size);
    }
    return all;
  }
  std::vector<std::string> ask(std::string_view text) {
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

TEST_F(QualisysConnection, GreetsFirst) {
  connection_.greet(out_);
  EXPECT_THAT(read(out_), ElementsAre("1 QTM RT Interface connected"));
}

TEST_F(QualisysConnection, SetsVersionsAndRefusesOthers) {
  EXPECT_THAT(ask("Version"), ElementsAre("1 Version is 1.1"));
  EXPECT_THAT(ask("Version 1.28"), ElementsAre("1 Version set to 1.28"));
  EXPECT_THAT(ask("version"), ElementsAre("1 Version is 1.28"));
  for (const char* no : {"Version 1.29", "Version 1.0", "Version 255.255.255", "Version x"}) {
    EXPECT_THAT(ask(no), ElementsAre("0 Version NOT supported")) << no;
  }
}

TEST_F(QualisysConnection, TheOldPortSpeaksVersion0Only) {
  Connection old(room_, Dialect::kLegacy, 2, "10.0.0.7", 4712);
  ASSERT_TRUE(old.receive(command("Version 1.0", std::endian::big), out_));
  ASSERT_TRUE(old.receive(command("Version 1.28", std::endian::big), out_));
  ASSERT_TRUE(old.receive(command("ByteOrder BigEndian", std::endian::big), out_));
  ASSERT_TRUE(old.receive(command("ByteOrder LittleEndian", std::endian::big), out_));
  EXPECT_THAT(read(out_, std::endian::big),
              ElementsAre("1 Version set to 1.0", "0 Version NOT supported",
                          "1 Byte order is big endian", "0 Byte order is chosen by the port"));
}

TEST_F(QualisysConnection, AnswersTheSmallQuestions) {
  EXPECT_THAT(ask("QTMVersion"), ElementsAre("1 QTM Version is 2.17 (build 4050)"));
  EXPECT_THAT(ask("ByteOrder"), ElementsAre("1 Byte order is little endian"));
  EXPECT_THAT(ask("CheckLicense abc"), ElementsAre("1 License pass"));
  EXPECT_THAT(ask("GetState"), ElementsAre("6 1"));
  operator_api_.running = "take";
  EXPECT_THAT(ask("GetLastEvent"), ElementsAre("6 3"));
  EXPECT_THAT(ask("Dance"), ElementsAre("0 Parse error"));
  EXPECT_THAT(ask(""), ElementsAre("0 Parse error"));
}

TEST_F(QualisysConnection, GivesParametersInTheClientsVersion) {
  ask("Version 1.25");
  const auto answer = ask("GetParameters 6D General");
  ASSERT_EQ(answer.size(), 1u);
  EXPECT_THAT(answer[0], StartsWith("2 <QTM_Parameters_Ver_1.25><General>"));
  EXPECT_THAT(answer[0], HasSubstr("<Name>drone</Name>"));
  EXPECT_THAT(ask("GetParameters Weather"), ElementsAre("0 Parse error"));
}

TEST_F(QualisysConnection, BytesMayBeCutAnywhere) {
  auto bytes = command("Version 1.28");
  const auto second = command("ByteOrder");
  bytes.insert(bytes.end(), second.begin(), second.end());
  for (const std::byte b : bytes) ASSERT_TRUE(connection_.receive(std::span(&b, 1), out_));
  EXPECT_THAT(read(out_), ElementsAre("1 Version set to 1.28", "1 Byte order is little endian"));
}

TEST_F(QualisysConnection, BrokenFramingEndsIt) {
  EXPECT_FALSE(connection_.receive(from_hex("ffffffff 01000000"), out_));
}

TEST_F(QualisysConnection, WhoOnlyAsksIsEnded) {
  std::vector<std::byte> many;
  for (int i = 0; i < 5000; ++i) {
    const auto one = command("GetParameters All");
    many.insert(many.end(), one.begin(), one.end());
  }
  EXPECT_FALSE(connection_.receive(many, out_));
  EXPECT_LT(out_.size(), std::size_t{5} << 20);
}

TEST_F(QualisysConnection, WhoGuessesPasswordsIsEnded) {
  for (int i = 0; i < 4; ++i) {
    EXPECT_THAT(ask("TakeControl guess"), ElementsAre("0 Wrong or missing password"));
  }
  EXPECT_FALSE(connection_.receive(command("TakeControl guess"), out_));
}

TEST_F(QualisysConnection, ReconnectingGivesNoNewGuesses) {
  const auto try_one = [&](const std::string& address, const std::string& password) {
    Connection fresh{room_, Dialect::kLittleEndian, 2, address, 4712};
    std::vector<std::byte> out;
    EXPECT_TRUE(fresh.receive(command("TakeControl " + password), out));
    fresh.leave();
    return read(out).front();
  };
  for (int i = 0; i < 1000; ++i) (void)try_one("10.0.0.9", "guess");
  EXPECT_THAT(try_one("10.0.0.9", "open sesame"), HasSubstr("Too many wrong passwords"));
  EXPECT_EQ(try_one("10.0.0.8", "open sesame"), "1 You are now master");
  room_.now += net::WrongProofs::kWindow;
  EXPECT_EQ(try_one("10.0.0.9", "open sesame"), "1 You are now master");
}

TEST_F(QualisysConnection, StreamsWhatWasAskedForUntilStop) {
  publish(1);
  EXPECT_FALSE(connection_.stream_of(*frame_));
  ask("Version 1.28");
  EXPECT_TRUE(ask("StreamFrames AllFrames 6DEuler").empty());
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
  EXPECT_TRUE(ask("StreamFrames Stop").empty());
  publish(3);
  EXPECT_FALSE(connection_.stream_of(*frame_));
  EXPECT_FALSE(connection_.udp_port());
}

TEST_F(QualisysConnection, AStreamThatCannotBeIsRefusedAndTheOldOneGoesOn) {
  publish(1);
  ask("StreamFrames AllFrames 6D");
  for (const char* no : {"StreamFrames AllFrames", "StreamFrames", "StreamFrames 6D",
                         "StreamFrames AllFrames UDP:1 6D"}) {
    EXPECT_THAT(ask(no), ElementsAre("0 Parse error")) << no;
  }
  EXPECT_TRUE(connection_.stream_of(*frame_));
}

TEST_F(QualisysConnection, AStreamNeverGoesToAThirdParty) {
  publish(1);
  EXPECT_THAT(ask("StreamFrames AllFrames UDP:10.0.0.8:6734 6D"),
              ElementsAre("0 UDP goes to the client's own address only"));
  EXPECT_FALSE(connection_.streaming());
  EXPECT_TRUE(ask("StreamFrames AllFrames UDP:10.0.0.7:6734 6D").empty());
  EXPECT_EQ(connection_.udp_port(), 6734);
}

TEST_F(QualisysConnection, SaysSoWhenThereIsNoFrameYet) {
  EXPECT_THAT(ask("GetCurrentFrame 6D"), ElementsAre("4 "));
  EXPECT_THAT(ask("StreamFrames AllFrames 6D"), ElementsAre("4 "));
}

TEST_F(QualisysConnection, ACurrentFrameIsGivenOnceAndTheNextOneWaitedFor) {
  publish(1);
  EXPECT_FALSE(connection_.current_of(1));
  EXPECT_TRUE(ask("GetCurrentFrame 6D").empty());
  EXPECT_TRUE(ask("GetCurrentFrame 6DRes").empty());
  EXPECT_TRUE(connection_.current_of(1)->components.has(Component::k6d));
  EXPECT_FALSE(connection_.current_of(1));
  EXPECT_TRUE(connection_.current_of(2)->components.has(Component::k6dRes));
  EXPECT_FALSE(connection_.current_of(3));
}

TEST_F(QualisysConnection, FramesThatAreAskedForAreCounted) {
  publish(1);
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(ask("GetCurrentFrame 6D").empty());
  EXPECT_THAT(ask("GetCurrentFrame 6D"), ElementsAre("0 Too many frames are asked for"));
}

TEST_F(QualisysConnection, OldVersionsGetDoubles) {
  publish(1);
  ask("Version 1.7");
  ask("StreamFrames AllFrames 6D");
  EXPECT_TRUE(connection_.stream_of(*frame_)->wide);
}

TEST_F(QualisysConnection, ControlUsesTheOperatorApi) {
  EXPECT_THAT(ask("Start"), ElementsAre("0 You must be master to issue this command"));
  EXPECT_THAT(ask("TakeControl open sesame"), ElementsAre("1 You are now master"));
  EXPECT_THAT(ask("Start"), ElementsAre("1 Starting measurement"));
  EXPECT_TRUE(operator_api_.running);
  EXPECT_THAT(connection_.detail(), HasSubstr("master"));
  ASSERT_TRUE(connection_.receive(
      command("<S><The_6D><Body><Name>arm</Name><Enabled>False</Enabled></Body></The_6D></S>",
              std::endian::little, PacketType::kXml),
      out_));
  EXPECT_EQ(operator_api_.enabled, (std::map<int, bool>{{1, false}}));
  connection_.leave();
  EXPECT_THAT(ask("Stop"), ElementsAre("0 You must be master to issue this command"));
}

/// How many of the frames of `seconds` at 100 Hz are taken, the first one at a time that is not
/// round.
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

TEST(QualisysFramePicker, AllFramesAreAll) { EXPECT_EQ(taken({}, 2), 200); }

TEST(QualisysFramePicker, ADivisorTakesEveryNthFromTheFirst) {
  EXPECT_EQ(taken({RateKind::kFrequencyDivisor, 4}, 2), 50);
  EXPECT_EQ(taken({RateKind::kFrequencyDivisor, 1000}, 2), 1);
}

TEST(QualisysFramePicker, AFrequencyIsMetOverTime) {
  constexpr int kEnds = 1;  // the first frame is always taken
  for (const std::uint32_t hz : {1U, 7U, 30U, 50U, 60U, 99U, 100U}) {
    for (const std::int64_t jitter_ns : {0, 300'000}) {
      EXPECT_NEAR(taken({RateKind::kFrequency, hz}, 10, jitter_ns), 10 * static_cast<int>(hz),
                  kEnds)
          << hz << " Hz";
    }
  }
}

TEST(QualisysFramePicker, AFrequencyAboveTheFramesRateIsAllFrames) {
  EXPECT_EQ(taken({RateKind::kFrequency, 1000}, 2), 200);
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
