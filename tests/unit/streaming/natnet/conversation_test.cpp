#include "streaming/natnet/conversation.hpp"

#include <random>

#include "base/log.hpp"
#include "conversation_fixture.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"

namespace fiducap::natnet {
namespace {

using ConversationTest = ConversationFixture;

constexpr std::size_t kInfoBytes = 283;
constexpr std::size_t kInfoBefore3 = 268;
constexpr std::size_t kMulticastFlag = kHeaderSize + 274;

TEST_F(ConversationTest, InfoContainsTheVersionAndTheKindOfServer) {
  EXPECT_EQ(say(ping())[kMulticastFlag], std::byte{0});
  EXPECT_EQ(say_to_group(ping())[kMulticastFlag], std::byte{1});
  EXPECT_EQ(version_in(say(ping())), (Bitstream{3, 1}));
  EXPECT_EQ(version_in(say(connect({3, 0}))), (Bitstream{3, 0}));
  EXPECT_EQ(version_in(say(connect({4, 2}, {4, 1}))), (Bitstream{4, 1}));
  EXPECT_EQ(version_in(say(connect({4, 2}, {255, 255}))), kNewest);
  const auto old = say(connect({2, 7}));
  EXPECT_EQ(version_in(old), (Bitstream{2, 7}));
  EXPECT_EQ(old.size(), kInfoBefore3);
}

TEST_F(ConversationTest, AnswersDiscoveryMulticastAndEmptyConnectWithoutState) {
  EXPECT_EQ(say(message(Message::kDiscovery, sender_block({3, 1}))).size(), kInfoBytes);
  EXPECT_EQ(version_in(say_to_group(connect({4, 2}, {4, 1}))), (Bitstream{3, 1}));
  (void)say(message(Message::kConnect));
  (void)say(message(Message::kRequestModel));
  EXPECT_EQ(clients(), 0U);
}

TEST_F(ConversationTest, AKeepAliveAtTheMulticastPortSubscribes) {
  (void)say_to_group(connect({4, 2}, {4, 1}));
  (void)say_to_group(message(Message::kKeepAlive));
  ASSERT_EQ(clients(), 1U);
  EXPECT_EQ(conversation_->subscribers()[0].version, (Bitstream{3, 1}));
  next_frame();
  EXPECT_FALSE(frame_of().empty());
  config_.unicast = false;
  start();
  (void)say_to_group(message(Message::kKeepAlive));
  EXPECT_EQ(clients(), 0U);
}

TEST_F(ConversationTest, OnlyClientsWithoutUnicastFramesRequestTheGroup) {
  const auto asks = [&](const Bytes& datagram, const Peer& from, Channel channel) {
    (void)say(datagram, from, channel);
    return conversation_->asked_for_group();
  };
  constexpr Peer kStranger{0xcb007107, 40003};
  const Bytes listener = message(Message::kConnect);
  EXPECT_TRUE(asks(listener, kClient, Channel::kMulticast));
  EXPECT_TRUE(asks(message(Message::kRequestModel), kOther, Channel::kMulticast));
  EXPECT_FALSE(asks(listener, kClient, Channel::kUnicast));
  EXPECT_FALSE(asks(message(Message::kDiscovery), kClient, Channel::kMulticast));
  EXPECT_FALSE(asks(listener, kStranger, Channel::kMulticast)) << "of no network of this machine";
  EXPECT_FALSE(asks({}, kClient, Channel::kMulticast));
  (void)say_to_group(message(Message::kKeepAlive));
  EXPECT_FALSE(asks(message(Message::kRequestModel), kClient, Channel::kMulticast))
      << "it gets its own";
}

TEST_F(ConversationTest, FramesStartWithAKeepAliveOrAfterADelay) {
  (void)say(ping());
  next_frame();
  EXPECT_TRUE(frame_of().empty()) << "it may still wait for its MODELDEF";
  (void)say(message(Message::kKeepAlive));
  EXPECT_FALSE(frame_of().empty());
  (void)say(ping(), kOther);
  (void)say(message(Message::kRequestModel), kOther);
  pass(0.19);
  next_frame();
  EXPECT_TRUE(frame_of(kOther).empty());
  (void)say(ping(), kOther);
  pass(0.02);
  EXPECT_FALSE(frame_of(kOther).empty()) << "a second CONNECT must not start the wait again";
}

TEST_F(ConversationTest, AKeepAliveAfterARestartSubscribesAgain) {
  (void)say(message(Message::kKeepAlive, sender_block({3, 0})));
  (void)say(message(Message::kKeepAlive, sender_block({3, 0})));
  next_frame();
  EXPECT_FALSE(frame_of().empty());
  EXPECT_EQ(conversation_->subscribers().front().version, (Bitstream{3, 0}));
}

TEST_F(ConversationTest, AKeepAliveGetsNoReply) {
  EXPECT_TRUE(say(message(Message::kKeepAlive)).empty());
  join(connect({4, 4}, {0, 0}));
  EXPECT_TRUE(say(message(Message::kKeepAlive, sender_block({4, 4}))).empty());
}

TEST_F(ConversationTest, ForgetsASilentClient) {
  join(ping());
  pass(14.9);
  EXPECT_EQ(clients(), 1U);
  (void)say(message(Message::kEchoRequest, Bytes(8)));
  pass(14.9);
  EXPECT_EQ(clients(), 1U) << "any packet keeps it";
  pass(0.2);
  EXPECT_EQ(clients(), 0U);
}

TEST_F(ConversationTest, DisconnectEndsTheFrames) {
  join(ping());
  EXPECT_TRUE(say(message(Message::kDisconnect)).empty());
  EXPECT_EQ(clients(), 0U);
  join(ping());
  EXPECT_EQ(number_in(say(words("Disconnect"))), 0);
  EXPECT_EQ(clients(), 0U);
}

TEST_F(ConversationTest, EachClientGetsItsOwnVersion) {
  join(connect({4, 1}, {4, 1}), kClient);
  join(connect({2, 7}), kOther);
  next_frame();
  EXPECT_EQ(frame_of(kClient).size(), 126 + 38 * 2U);
  EXPECT_EQ(frame_of(kOther).size(), kHeaderSize + 4 + 8 + 4 + 42 * 2 + 8 + 26);
}

TEST_F(ConversationTest, TheModelHasTheVersionOfTheClient) {
  (void)say(connect({2, 7}), kOther);
  const auto model_of = [&](const Peer& peer) {
    return say(message(Message::kRequestModel), peer).size();
  };
  const std::size_t in_2 = model_of(kOther);
  EXPECT_EQ(model_of(kClient), in_2 + 2 * 4) << "3.1 has an empty list of markers for each body";
  (void)say(connect({4, 2}, {4, 2}));
  EXPECT_EQ(model_of(kClient), in_2 + 2 * (4 + 4 + 16));
}

TEST_F(ConversationTest, EchoReturnsTheTicksOfClientAndServer) {
  Bytes payload;
  LittleEndianWriter(payload).u64(0x0123456789abcdef);
  const auto echo = say(message(Message::kEchoRequest, payload));
  LittleEndianReader in(echo);
  EXPECT_EQ(in.u16(), static_cast<std::uint16_t>(Message::kEchoResponse));
  EXPECT_EQ(in.u16(), 16);
  EXPECT_EQ(in.u64(), 0x0123456789abcdefU);
  EXPECT_EQ(in.u64(), static_cast<std::uint64_t>(to_ns(now_)) / 100);
}

TEST_F(ConversationTest, AFrameCanBeRequested) {
  EXPECT_TRUE(say(message(Message::kRequestFrame)).empty());
  next_frame();
  EXPECT_EQ(say(message(Message::kRequestFrame)).size(), 82 + 38 * 2U);
}

TEST_F(ConversationTest, AChangedBitstreamIsAnnouncedFor200Ms) {
  join(ping());
  EXPECT_EQ(number_in(say(words("Bitstream,4.1"))), 0);
  next_frame();
  EXPECT_EQ(frame_of().size(), 126 + 38 * 2U);
  EXPECT_EQ(bits_in(frame_of()), FrameBits::kBitstreamChanged);
  EXPECT_EQ(text_in(say(words("Bitstream"))), "Bitstream,4.1.0");
  pass(0.21);
  next_frame();
  EXPECT_EQ(bits_in(frame_of()), 0);
}

TEST_F(ConversationTest, AChangedModelIsAnnouncedFor200Ms) {
  join(ping());
  next_frame();
  const auto before = say(message(Message::kRequestModel)).size();
  EXPECT_EQ(bits_in(frame_of()), 0);
  next_frame(2, {"arm", "drone", "another"});
  EXPECT_EQ(bits_in(frame_of()), FrameBits::kModelChanged);
  EXPECT_EQ(bodies_in(frame_of()).size(), 3U);
  EXPECT_GT(say(message(Message::kRequestModel)).size(), before);
  pass(0.21);
  next_frame(2, {"arm", "drone", "another"});
  EXPECT_EQ(bits_in(frame_of()), 0);
}

TEST_F(ConversationTest, ARecordingShowsInTheFrames) {
  constexpr Peer kLocal{0x7f000001, 9};
  join(ping(), kLocal);
  EXPECT_EQ(number_in(say(words("StartRecording"), kLocal)), 0);
  next_frame();
  EXPECT_EQ(bits_in(frame_of(kLocal)), FrameBits::kRecording);
}

TEST_F(ConversationTest, SubscribedDataOnlyAppliesFromTheConnect) {
  join(connect({4, 1}, {3, 1}, true));
  next_frame();
  EXPECT_TRUE(bodies_in(frame_of()).empty());
  EXPECT_EQ(number_in(say(words("SubscribeToData,RigidBody,drone"))), 0);
  ASSERT_EQ(bodies_in(frame_of()).size(), 1U);
  EXPECT_EQ(bodies_in(frame_of())[0].id, 2);
}

TEST_F(ConversationTest, SendsFramesToTargetsAlways) {
  config_.targets = {"10.0.0.99:1511"};
  start();
  next_frame();
  EXPECT_FALSE(frame_of({0x0a000063, 1511}).empty());
  pass(1000);
  EXPECT_FALSE(frame_of({0x0a000063, 1511}).empty());
}

TEST_F(ConversationTest, SendsNothingToARemovedClient) {
  join(ping());
  EXPECT_TRUE(say(message(Message::kKeepAlive)).empty());
  EXPECT_EQ(id_of(say(words("service20,-1,12345678"))), Message::kUnrecognized) << "old libraries";
  EXPECT_TRUE(conversation_->remove(kClient));
  next_frame();
  EXPECT_TRUE(frame_of().empty());
}

TEST_F(ConversationTest, SendingAllocatesNothingOnceWarm) {
  constexpr Peer kOld{0x0a000009, 40003};
  join(ping());
  join(connect({4, 1}, {4, 1}), kOther);
  join(connect({2, 7}), kOld);
  EXPECT_EQ(number_in(say(words("SubscribeToData,RigidBody,drone"), kOther)), 0);
  const auto frame = make_scene_frame({"arm", "drone"});
  const auto send = [&] {
    conversation_->take(frame, now_);
    for (const auto& one : conversation_->subscribers()) (void)conversation_->frame_for(one, now_);
    (void)conversation_->multicast_frame(now_);
  };
  send();
  log::flush(std::chrono::seconds(10));  // its thread allocates, too
  const AllocationCounter counter;
  for (int i = 0; i < 100; ++i) send();
  EXPECT_EQ(counter.count(), 0U);
}

/// Ten seconds of 10 000 datagrams a second from forged addresses, and 100 frames a second.
class FloodTest : public ConversationFixture {
 protected:
  struct Traffic {
    double in{}, out{};
  };
  Traffic flood(const Bytes& datagram) {
    constexpr int kPerSecond = 10000, kSeconds = 10;
    Traffic traffic;
    for (int i = 0; i < kPerSecond * kSeconds; ++i) {
      const Peer forged{static_cast<std::uint32_t>(0xc0000000U | (random_() & 0xffffffU)),
                        static_cast<std::uint16_t>(1024 + random_() % 60000)};
      traffic.in += static_cast<double>(datagram.size());
      traffic.out += static_cast<double>(say(datagram, forged).size());
      now_ += from_seconds(1.0 / kPerSecond);
      if (i % (kPerSecond / 100) != 0) continue;
      conversation_->expire(now_);
      next_frame();
      for (const auto& one : conversation_->subscribers()) {
        if (one.peer != kClient)
          traffic.out += static_cast<double>(conversation_->frame_for(one, now_).size());
      }
    }
    return traffic;
  }
  std::mt19937 random_{3};  // each flood has other addresses
};

TEST_F(FloodTest, SendsStrangersAtMostThreeTimesTheirBytesAndNoFrames) {
  for (const Bytes& datagram :
       {ping(), connect({4, 1}, {4, 1}), message(Message::kKeepAlive), message(Message::kConnect),
        message(Message::kRequestModel), message(Message::kRequestFrame), words("FrameRate"),
        message(Message::kEchoRequest, Bytes(8)), words("GetProperty,,FrameRate")}) {
    start();  // unused bytes of an earlier flood do not count
    const Traffic traffic = flood(datagram);
    EXPECT_LE(traffic.out, net::AnswerBudget::kRatio * traffic.in)
        << to_hex(datagram).substr(0, 40);
    EXPECT_EQ(clients(), 0U) << to_hex(datagram).substr(0, 40);
  }
}

TEST_F(FloodTest, ServesOldAndNewClientsDuringAFlood) {
  config_.client_timeout_s = 600;  // the old one is silent during the flood
  start();
  join(ping());
  (void)flood(ping());
  next_frame();
  EXPECT_FALSE(frame_of().empty());
  join(ping(), kOther);
  next_frame();
  EXPECT_FALSE(frame_of(kOther).empty());
}

TEST_F(FloodTest, NamedClientsExcludeOtherAttachedAddresses) {
  config_.clients = {net::address_text(kOther)};
  start();
  join(connect({4, 4}, {0, 0}));
  join(connect({4, 4}, {0, 0}), kOther);
  join(ping(), Peer{0x7f000001, 40000});
  next_frame();
  EXPECT_TRUE(frame_of().empty()) << "attached, but not named";
  EXPECT_FALSE(frame_of(kOther).empty());
  EXPECT_FALSE(frame_of(Peer{0x7f000001, 40000}).empty()) << "this machine";
}

TEST_F(FloodTest, AcceptsClientsOfConfiguredNetworks) {
  config_.networks = {"192.168.0.0/16"};
  start();
  const Peer client{0xc0a80107, 40000};
  join(ping(), client);
  next_frame();
  EXPECT_FALSE(frame_of(client).empty());
}

}  // namespace
}  // namespace fiducap::natnet
