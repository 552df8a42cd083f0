#include "streaming/native/registry.hpp"

#include <gtest/gtest.h>

#include "fiducap/v1/envelope.pb.h"
#include "support/allocation_counter.hpp"

namespace fiducap::native {
namespace {

constexpr std::uint64_t kSession = 77;
constexpr std::uint64_t kGeneration = 1;
constexpr Duration kLease = std::chrono::seconds(3);

class RegistryTest : public testing::Test {
 protected:
  static Peer peer(std::uint16_t port, std::uint8_t host = 1) {
    Peer p;
    p.address = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 192, 0, 2, host};
    p.port = port;
    return p;
  }
  static Datagram subscribe(std::uint64_t token, std::uint64_t known_model = 0) {
    v1::Envelope envelope;
    envelope.set_protocol(kProtocol);
    auto& out = *envelope.mutable_subscribe();
    out.set_token(token);
    out.set_nonce(5);
    out.set_model_generation(known_model);
    out.set_client_name("te\x01st");
    out.set_padding(std::string(kMinSubscribe, '\0'));
    return bytes_of(envelope);
  }
  static Datagram unsubscribe(std::uint64_t token) {
    v1::Envelope envelope;
    envelope.set_protocol(kProtocol);
    envelope.mutable_unsubscribe()->set_token(token);
    return bytes_of(envelope);
  }
  static Datagram bytes_of(const v1::Envelope& envelope) {
    Datagram bytes(envelope.ByteSizeLong());
    envelope.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
    return bytes;
  }
  static v1::Envelope parse(const Datagram& bytes) {
    v1::Envelope envelope;
    EXPECT_TRUE(envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
    return envelope;
  }

  Registry::Reply say(const Datagram& datagram, const Peer& from) {
    return registry_.receive(datagram, from, kGeneration, now_);
  }
  std::uint64_t challenge(const Peer& from) {
    const auto answer = parse(say(subscribe(0), from).datagram);
    EXPECT_TRUE(answer.has_challenge());
    return answer.challenge().token();
  }
  /// @return the token for the renewal, 0 when refused
  std::uint64_t join(const Peer& from) { return parse(say(subscribe(challenge(from)), from).datagram).lease().token(); }

  Instant now_ = instant_from_ns(50'000'000'000);
  Registry registry_{RegistryLimits{4, 2, kLease}, {1, 2}, kSession};
};

TEST_F(RegistryTest, ChallengesAnUnknownAddressAndRemembersNothing) {
  const auto reply = say(subscribe(0), peer(1000));
  const auto answer = parse(reply.datagram);
  ASSERT_TRUE(answer.has_challenge());
  EXPECT_EQ(answer.challenge().nonce(), 5u);
  EXPECT_EQ(answer.challenge().session(), kSession);
  EXPECT_FALSE(reply.send_model);
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(RegistryTest, GrantsALeaseForTheTokenAndSendsTheModel) {
  const auto token = challenge(peer(1000));
  const auto reply = say(subscribe(token), peer(1000));
  const auto answer = parse(reply.datagram);
  ASSERT_TRUE(answer.has_lease());
  EXPECT_EQ(answer.lease().lease_ms(), 3000u);
  EXPECT_EQ(answer.lease().session(), kSession);
  EXPECT_EQ(answer.lease().model_generation(), kGeneration);
  EXPECT_TRUE(reply.send_model);
  EXPECT_EQ(reply.event, Registry::Event::kJoined);
  ASSERT_EQ(registry_.subscribers().size(), 1u);
  EXPECT_EQ(registry_.subscribers()[0].name, "te?st");
}

TEST_F(RegistryTest, DoesNotSendAModelTheClientHolds) {
  const auto reply = say(subscribe(join(peer(1000)), kGeneration), peer(1000));
  EXPECT_TRUE(parse(reply.datagram).has_lease());
  EXPECT_FALSE(reply.send_model);
  EXPECT_EQ(reply.event, Registry::Event::kNone);
}

TEST_F(RegistryTest, SendsTheModelAgainButNotMoreOftenThanOncePerPause) {
  const auto token = join(peer(1000));
  EXPECT_FALSE(say(subscribe(token), peer(1000)).send_model);
  now_ += std::chrono::milliseconds(60);
  EXPECT_TRUE(say(subscribe(token), peer(1000)).send_model);
}

TEST_F(RegistryTest, RefusesATokenFromAnotherAddress) {
  const auto token = challenge(peer(1000));
  EXPECT_TRUE(parse(say(subscribe(token), peer(1001)).datagram).has_challenge());
  EXPECT_TRUE(parse(say(subscribe(token), peer(1000, 9)).datagram).has_challenge());
  EXPECT_TRUE(parse(say(subscribe(token + 1), peer(1000)).datagram).has_challenge());
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(RegistryTest, ForgetsAClientWhoseLeaseEnds) {
  join(peer(1000));
  now_ += kLease - Duration{1};
  EXPECT_EQ(registry_.expire(now_), 0u);
  now_ += Duration{1};
  EXPECT_EQ(registry_.expire(now_), 1u);
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(RegistryTest, RenewsALeaseForHours) {
  auto token = join(peer(1000));
  for (int i = 0; i < 3600; ++i) {
    now_ += kLease / 3;
    const auto answer = parse(say(subscribe(token, kGeneration), peer(1000)).datagram);
    ASSERT_TRUE(answer.has_lease()) << "renewal " << i;
    token = answer.lease().token();
    EXPECT_EQ(registry_.expire(now_), 0u);
  }
  EXPECT_EQ(registry_.subscribers().size(), 1u);
}

TEST_F(RegistryTest, DoesNotRenewForSomebodyWhoOnlyKnowsTheAddress) {
  join(peer(1000));
  now_ += kLease - Duration{1};
  EXPECT_TRUE(parse(say(subscribe(0), peer(1000)).datagram).has_challenge());
  now_ += Duration{1};
  EXPECT_EQ(registry_.expire(now_), 1u);
}

TEST_F(RegistryTest, EndsASubscriptionOnlyForItsToken) {
  const auto token = join(peer(1000));
  EXPECT_EQ(say(unsubscribe(token + 1), peer(1000)).event, Registry::Event::kNone);
  EXPECT_EQ(say(unsubscribe(token), peer(1001)).event, Registry::Event::kNone);
  EXPECT_EQ(registry_.subscribers().size(), 1u);
  const auto reply = say(unsubscribe(token), peer(1000));
  EXPECT_EQ(reply.event, Registry::Event::kLeft);
  EXPECT_TRUE(reply.datagram.empty());
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(RegistryTest, RefusesMoreThanTheLimitPerAddress) {
  EXPECT_NE(join(peer(1000)), 0u);
  EXPECT_NE(join(peer(1001)), 0u);
  const auto answer = parse(say(subscribe(challenge(peer(1002))), peer(1002)).datagram);
  EXPECT_EQ(answer.notice().reason(), v1::Notice::REASON_ADDRESS_FULL);
  EXPECT_EQ(answer.notice().nonce(), 5u);
  EXPECT_NE(join(peer(1002, 2)), 0u) << "another address is still welcome";
}

TEST_F(RegistryTest, RefusesMoreThanTheLimitOfTheServerUntilSomebodyLeaves) {
  for (std::uint8_t host = 1; host <= 4; ++host) EXPECT_NE(join(peer(1000, host)), 0u);
  const auto token = challenge(peer(1000, 5));
  const auto answer = parse(say(subscribe(token), peer(1000, 5)).datagram);
  EXPECT_EQ(answer.notice().reason(), v1::Notice::REASON_SERVER_FULL);
  now_ += kLease;
  EXPECT_TRUE(parse(say(subscribe(token), peer(1000, 5)).datagram).has_lease());
}

TEST_F(RegistryTest, AFloodFromTenThousandPortsGetsFewAnswersAndLeavesNoTrace) {
  const auto question = subscribe(0);
  std::size_t bytes_in = 0;
  std::size_t bytes_out = 0;
  int answers = 0;
  (void)say(question, peer(9));  // warm-up: protobuf's own first-use tables
  const AllocationCounter per_answer;
  (void)say(question, peer(10));
  const auto allocations_of_one = per_answer.count();
  const AllocationCounter allocations;
  for (int i = 0; i < 10'000; ++i) {
    const auto reply = say(question, peer(static_cast<std::uint16_t>(1000 + i)));
    bytes_in += question.size();
    bytes_out += reply.datagram.size();
    answers += reply.datagram.empty() ? 0 : 1;
    ASSERT_LE(reply.datagram.size(), question.size());
  }
  EXPECT_LE(answers, static_cast<int>(AnswerLimiter::kBurst));
  EXPECT_LE(bytes_out, bytes_in);
  EXPECT_TRUE(registry_.subscribers().empty());
  EXPECT_GE(registry_.unanswered().too_often, 9'000u);
  // Nothing is kept: each question costs only what reading it costs, and that is given back.
  EXPECT_LE(allocations.count(), 10'000 * allocations_of_one);
}

TEST_F(RegistryTest, AFloodOfOneAddressDoesNotLockOutAnother) {
  for (int i = 0; i < 10'000; ++i) (void)say(subscribe(0), peer(static_cast<std::uint16_t>(1000 + i)));
  EXPECT_NE(join(peer(1000, 2)), 0u);
}

TEST_F(RegistryTest, AFloodOfOneAddressDoesNotEndItsOwnLease) {
  const auto token = join(peer(500));
  for (int i = 0; i < 10'000; ++i) (void)say(subscribe(0), peer(static_cast<std::uint16_t>(1000 + i)));
  EXPECT_TRUE(parse(say(subscribe(token), peer(500)).datagram).has_lease());
}

TEST_F(RegistryTest, GarbageGetsNoAnswer) {
  EXPECT_TRUE(say({}, peer(1000)).datagram.empty());
  EXPECT_TRUE(say(Datagram(500, std::byte{0x5a}), peer(1000)).datagram.empty());
  EXPECT_EQ(registry_.unanswered().malformed, 2u);
}

}  // namespace
}  // namespace fiducap::native
