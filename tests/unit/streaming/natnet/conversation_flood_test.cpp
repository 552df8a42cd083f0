#include <random>

#include "conversation_fixture.hpp"
#include "support/hex.hpp"

namespace fiducap::natnet {
namespace {

/// Ten seconds of 10 000 datagrams a second from addresses that are not the sender's, and 100
/// frames a second.
class FloodTest : public ConversationFixture {
 protected:
  static constexpr int kPerSecond = 10000;
  static constexpr int kSeconds = 10;

  struct Traffic {
    double in{};
    double out{};
  };
  Traffic flood(const Bytes& datagram) {
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
  std::mt19937 random_{3};  // every flood comes from other addresses
};

TEST_F(FloodTest, StrangersGetAtMostThreeTimesTheirBytesAndNoFrames) {
  for (const Bytes& datagram :
       {ping(), connect({4, 1}, {4, 1}), message(Message::kKeepAlive), message(Message::kConnect),
        message(Message::kRequestModel), message(Message::kRequestFrame), words("FrameRate"),
        message(Message::kEchoRequest, Bytes(8)), words("GetProperty,,FrameRate")}) {
    start();  // what was not used of an earlier flood's bytes is no excuse
    const Traffic traffic = flood(datagram);
    EXPECT_LE(traffic.out, net::AnswerBudget::kRatio * traffic.in)
        << to_hex(datagram).substr(0, 40);
  }
}

TEST_F(FloodTest, ClientsKeepTheirPlaceAndTheirFrames) {
  join(ping());
  config_.client_timeout_s =
      600;  // it stays silent during the flood; only the flood could push it out
  start();
  join(ping());
  (void)flood(ping());
  next_frame();
  EXPECT_FALSE(frame_of().empty());
}

TEST_F(FloodTest, ANewClientGetsInDuringAFlood) {
  (void)flood(ping());
  join(ping());
  next_frame();
  EXPECT_FALSE(frame_of().empty());
}

TEST_F(FloodTest, NoStrangerIsAClientHoweverOftenItSpeaks) {
  const Peer stranger{0xc0a80107, 40000};
  double in = 0, out = 0;
  for (int i = 0; i < 1000; ++i) {
    for (const Bytes& datagram :
         {message(Message::kKeepAlive), ping(), connect({4, 1}, {4, 1}),
          message(Message::kRequestModel), message(Message::kRequestFrame)}) {
      in += static_cast<double>(datagram.size());
      out += static_cast<double>(say(datagram, stranger).size());
    }
    pass(0.02);
    next_frame();
    ASSERT_TRUE(frame_of(stranger).empty());
  }
  EXPECT_GT(out, 0) << "it gets replies";
  EXPECT_LE(out, net::AnswerBudget::kRatio * in);
  EXPECT_TRUE(conversation_->subscribers().empty());
  EXPECT_GT(conversation_->unanswered().untrusted, 0U);
}

TEST_F(FloodTest, AStrangerOfANetworkThatTheConfigurationNamesIsAClient) {
  config_.networks = {"192.168.0.0/16"};
  start();
  const Peer client{0xc0a80107, 40000};
  join(ping(), client);
  next_frame();
  EXPECT_FALSE(frame_of(client).empty());
}

TEST_F(FloodTest, RandomBytesAreNeverMoreThanARequest) {
  std::mt19937 random(5);
  for (int i = 0; i < 100000; ++i) {
    Bytes datagram(random() % 40);
    for (auto& byte : datagram) byte = static_cast<std::byte>(random());
    if (datagram.size() >= 2) {
      datagram[0] = static_cast<std::byte>(random() % 16);
      datagram[1] = std::byte{0};
    }
    EXPECT_LE(say(datagram).size(), kMaxDatagram);
    now_ += from_seconds(0.001);
  }
  EXPECT_LE(conversation_->subscribers().size(), 1U);
}

}  // namespace
}  // namespace fiducap::natnet
