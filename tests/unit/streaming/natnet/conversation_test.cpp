#include "streaming/natnet/conversation.hpp"

#include "base/log.hpp"
#include "conversation_fixture.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::natnet {
namespace {

using ConversationTest = ConversationFixture;

constexpr std::size_t kInfoBytes = 283;
constexpr std::size_t kInfoBefore3 = 268;
constexpr std::size_t kMulticastFlag = kHeaderSize + 274;

TEST_F(ConversationTest, AnswersEveryFormOfConnect) {
  EXPECT_EQ(say(message(Message::kConnect)).size(), kInfoBytes);
  EXPECT_EQ(say(ping()).size(), kInfoBytes);
  EXPECT_EQ(say(connect({3, 0})).size(), kInfoBytes);
  EXPECT_EQ(say(connect({4, 1}, {4, 1})).size(), kInfoBytes);
  Bytes spare = connect({4, 2}, {4, 2});
  spare.insert(spare.end(), 4, std::byte{0});
  EXPECT_EQ(say(spare).size(), kInfoBytes);
}

TEST_F(ConversationTest, TheInfoSaysTheVersionThatIsSent) {
  EXPECT_EQ(version_in(say(ping())), (Bitstream{3, 1}));
  EXPECT_EQ(version_in(say(connect({3, 0}))), (Bitstream{3, 0}));
  EXPECT_EQ(version_in(say(connect({4, 2}, {4, 1}))), (Bitstream{4, 1}));
  EXPECT_EQ(version_in(say(connect({4, 2}, {255, 255}))), (Bitstream{4, 2}));
  const auto old = say(connect({2, 7}));
  EXPECT_EQ(version_in(old), (Bitstream{2, 7}));
  EXPECT_EQ(old.size(), kInfoBefore3);
}

TEST_F(ConversationTest, DiscoveryIsAnsweredWithoutASubscription) {
  EXPECT_EQ(say(message(Message::kDiscovery, sender_block({3, 1}))).size(), kInfoBytes);
  EXPECT_TRUE(conversation_->subscribers().empty());
}

TEST_F(ConversationTest, EachPortSaysWhatKindOfServerItIs) {
  EXPECT_EQ(say(ping())[kMulticastFlag], std::byte{0});
  EXPECT_EQ(say(ping(), kClient, Channel::kMulticast)[kMulticastFlag], std::byte{1});
}

TEST_F(ConversationTest, MulticastClientsGetOneVersionWithoutState) {
  EXPECT_EQ(version_in(say(connect({4, 2}, {4, 1}), kClient, Channel::kMulticast)),
            (Bitstream{3, 1}));
  EXPECT_TRUE(conversation_->subscribers().empty());
}

TEST_F(ConversationTest, KeepAliveAtTheGroupsPortGetsFramesInItsVersion) {
  (void)say(connect({4, 2}, {4, 1}), kClient, Channel::kMulticast);
  (void)say(message(Message::kKeepAlive), kClient, Channel::kMulticast);
  ASSERT_EQ(conversation_->subscribers().size(), 1U);
  EXPECT_EQ(conversation_->subscribers()[0].version, (Bitstream{3, 1}));
  next_frame();
  EXPECT_FALSE(frame_of().empty());
  config_.unicast = false;
  start();
  (void)say(message(Message::kKeepAlive), kClient, Channel::kMulticast);
  EXPECT_TRUE(conversation_->subscribers().empty());
}

TEST_F(ConversationTest, OnlyAClientThatWantsFramesAsksForTheGroup) {
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
  (void)say(message(Message::kKeepAlive), kClient, Channel::kMulticast);
  EXPECT_FALSE(asks(message(Message::kRequestModel), kClient, Channel::kMulticast))
      << "it gets its own";
}

TEST_F(ConversationTest, FramesStartWithTheFirstKeepAlive) {
  (void)say(ping());
  next_frame();
  EXPECT_TRUE(frame_of().empty()) << "it may still wait for its MODELDEF";
  (void)say(message(Message::kKeepAlive));
  EXPECT_FALSE(frame_of().empty());
}

TEST_F(ConversationTest, FramesStartAfterAMomentWithoutKeepAlive) {
  (void)say(ping());
  (void)say(message(Message::kRequestModel));
  pass(0.19);
  next_frame();
  EXPECT_TRUE(frame_of().empty());
  (void)say(ping());
  pass(0.02);
  EXPECT_FALSE(frame_of().empty()) << "a second CONNECT must not start the wait again";
}

TEST_F(ConversationTest, AnEmptyConnectGetsNoFrames) {
  (void)say(message(Message::kConnect));
  (void)say(message(Message::kRequestModel));
  EXPECT_TRUE(conversation_->subscribers().empty());
}

TEST_F(ConversationTest, AKeepAliveAfterARestartSubscribesAgain) {
  (void)say(message(Message::kKeepAlive, sender_block({3, 0})));
  (void)say(message(Message::kKeepAlive, sender_block({3, 0})));
  next_frame();
  EXPECT_FALSE(frame_of().empty());
  EXPECT_EQ(conversation_->subscribers().front().version, (Bitstream{3, 0}));
}

TEST_F(ConversationTest, ALeaseEndsAfterSilence) {
  join(ping());
  pass(14.9);
  EXPECT_EQ(conversation_->subscribers().size(), 1U);
  (void)say(message(Message::kEchoRequest, Bytes(8)));
  pass(14.9);
  EXPECT_EQ(conversation_->subscribers().size(), 1U) << "any packet keeps it";
  pass(0.2);
  EXPECT_TRUE(conversation_->subscribers().empty());
}

TEST_F(ConversationTest, DisconnectEndsTheFrames) {
  join(ping());
  EXPECT_TRUE(say(message(Message::kDisconnect)).empty());
  EXPECT_TRUE(conversation_->subscribers().empty());
  join(ping());
  EXPECT_EQ(number_in(say(words("Disconnect"))), 0);
  EXPECT_TRUE(conversation_->subscribers().empty());
}

TEST_F(ConversationTest, TwoClientsGetTheirOwnVersions) {
  join(connect({4, 1}, {4, 1}), kClient);
  join(connect({2, 7}), kOther);
  next_frame();
  EXPECT_EQ(frame_of(kClient).size(), 126 + 38 * 2U);
  EXPECT_EQ(frame_of(kOther).size(), kHeaderSize + 4 + 8 + 4 + 42 * 2 + 8 + 26);
}

TEST_F(ConversationTest, TheModelIsInTheVersionOfTheAddress) {
  (void)say(connect({2, 7}), kOther);
  const auto model_of = [&](const Peer& peer) {
    return say(message(Message::kRequestModel), peer).size();
  };
  const std::size_t in_2 = model_of(kOther);
  EXPECT_EQ(model_of(kClient), in_2 + 2 * 4) << "3.1 has an empty list of markers for each body";
  (void)say(connect({4, 2}, {4, 2}));
  EXPECT_EQ(model_of(kClient), in_2 + 2 * (4 + 4 + 16));
}

TEST_F(ConversationTest, EchoReturnsTheClientsWordAndOurTicks) {
  Bytes payload;
  LittleEndianWriter(payload).u64(0x0123456789abcdef);
  const auto echo = say(message(Message::kEchoRequest, payload));
  LittleEndianReader in(echo);
  EXPECT_EQ(in.u16(), static_cast<std::uint16_t>(Message::kEchoResponse));
  EXPECT_EQ(in.u16(), 16);
  EXPECT_EQ(in.u64(), 0x0123456789abcdefU);
  EXPECT_EQ(in.u64(), static_cast<std::uint64_t>(to_ns(now_)) / 100);
}

TEST_F(ConversationTest, AFrameCanBeAskedFor) {
  EXPECT_TRUE(say(message(Message::kRequestFrame)).empty());
  next_frame();
  EXPECT_EQ(say(message(Message::kRequestFrame)).size(), 82 + 38 * 2U);
}

TEST_F(ConversationTest, ASwitchOfTheBitstreamIsAnnouncedForAMoment) {
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

TEST_F(ConversationTest, AChangeOfTheModelIsAnnouncedForAMoment) {
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
  join(ping(), {0x7f000001, 9});
  EXPECT_EQ(number_in(say(words("StartRecording"), {0x7f000001, 9})), 0);
  next_frame();
  EXPECT_EQ(bits_in(frame_of({0x7f000001, 9})), FrameBits::kRecording);
}

TEST_F(ConversationTest, SubscribedDataOnlyHoldsFromTheConnect) {
  join(connect({4, 1}, {3, 1}, true));
  next_frame();
  EXPECT_TRUE(bodies_in(frame_of()).empty());
  EXPECT_EQ(number_in(say(words("SubscribeToData,RigidBody,drone"))), 0);
  ASSERT_EQ(bodies_in(frame_of()).size(), 1U);
  EXPECT_EQ(bodies_in(frame_of())[0].id, 2);
}

TEST_F(ConversationTest, TargetsGetFramesWithoutAsking) {
  config_.targets = {"10.0.0.99:1511"};
  start();
  next_frame();
  EXPECT_FALSE(frame_of({0x0a000063, 1511}).empty());
  pass(1000);
  EXPECT_FALSE(frame_of({0x0a000063, 1511}).empty());
}

TEST_F(ConversationTest, OneThatIsGoneGetsNothing) {
  join(ping());
  EXPECT_TRUE(conversation_->remove(kClient));
  next_frame();
  EXPECT_TRUE(frame_of().empty());
}

TEST_F(ConversationTest, KeepAliveHasNoAnswer) {
  join(ping());
  EXPECT_TRUE(say(message(Message::kKeepAlive)).empty());
}

TEST_F(ConversationTest, TheOldLibrarysCheckIsUnrecognized) {
  EXPECT_EQ(id_of(say(words("service20,-1,12345678"))), Message::kUnrecognized);
}

TEST_F(ConversationTest, SendingAllocatesNothingOnceWarm) {
  join(ping());
  join(connect({4, 1}, {4, 1}), kOther);
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

}  // namespace
}  // namespace fiducap::natnet
