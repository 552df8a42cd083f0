#include "streaming/native/registry.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "base/log.hpp"
#include "fiducap/v1/envelope.pb.h"
#include "support/allocation_counter.hpp"

namespace fiducap::native {
namespace {

constexpr std::uint64_t kSession = 77;
constexpr std::uint64_t kGeneration = 1;
constexpr Duration kLease = std::chrono::seconds(3);

class NativeRegistryTest : public testing::Test {
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
  static Datagram subscribe_as(std::uint64_t token, const v1::Profile& profile,
                               bool multicast = false) {
    v1::Envelope envelope = parse(subscribe(token));
    *envelope.mutable_subscribe()->mutable_profile() = profile;
    envelope.mutable_subscribe()->set_multicast(multicast);
    return bytes_of(envelope);
  }
  static Datagram clock_query(std::uint64_t token) {
    v1::Envelope envelope;
    envelope.set_protocol(kProtocol);
    envelope.mutable_clock_query()->set_token(token);
    envelope.mutable_clock_query()->set_number(11);
    envelope.mutable_clock_query()->set_padding(std::string(kMinClockQuery, '\0'));
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
  std::uint64_t join(const Peer& from) {
    return parse(say(subscribe(challenge(from)), from).datagram).lease().token();
  }

  /// One client with a profile of its own. @return its reply
  v1::Envelope join_with_rate(const Peer& from, int rate_hz) {
    v1::Profile profile;
    profile.set_max_rate_hz(static_cast<float>(rate_hz));
    return parse(say(subscribe_as(challenge(from), profile), from).datagram);
  }
  void give_room(int clients) {
    registry_ = Registry{RegistryLimits{clients, clients, kLease}, {1, 2}, kSession};
  }
  [[nodiscard]] std::ptrdiff_t clients_of(const Peer& address) const {
    const auto all = registry_.subscribers();
    return std::count_if(all.begin(), all.end(),
                         [&](const Subscriber& s) { return s.peer.same_address(address); });
  }
  static constexpr int kProfiles = static_cast<int>(ProfileTable::kMost);

  Instant now_ = instant_from_ns(50'000'000'000);
  Registry registry_{RegistryLimits{4, 2, kLease}, {1, 2}, kSession};
};

TEST_F(NativeRegistryTest, ChallengesAnUnknownAddressAndRemembersNothing) {
  const auto reply = say(subscribe(0), peer(1000));
  const auto answer = parse(reply.datagram);
  ASSERT_TRUE(answer.has_challenge());
  EXPECT_EQ(answer.challenge().nonce(), 5u);
  EXPECT_EQ(answer.challenge().session(), kSession);
  EXPECT_FALSE(reply.send_model);
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(NativeRegistryTest, GrantsALeaseForTheTokenAndSendsTheModel) {
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

TEST_F(NativeRegistryTest, DoesNotSendAModelTheClientHolds) {
  const auto reply = say(subscribe(join(peer(1000)), kGeneration), peer(1000));
  EXPECT_TRUE(parse(reply.datagram).has_lease());
  EXPECT_FALSE(reply.send_model);
  EXPECT_EQ(reply.event, Registry::Event::kNone);
}

TEST_F(NativeRegistryTest, SendsTheModelAgainButNotMoreOftenThanOncePerPause) {
  const auto token = join(peer(1000));
  EXPECT_FALSE(say(subscribe(token), peer(1000)).send_model);
  now_ += std::chrono::milliseconds(60);
  EXPECT_TRUE(say(subscribe(token), peer(1000)).send_model);
}

TEST_F(NativeRegistryTest, RefusesATokenFromAnotherAddress) {
  const auto token = challenge(peer(1000));
  EXPECT_TRUE(parse(say(subscribe(token), peer(1001)).datagram).has_challenge());
  EXPECT_TRUE(parse(say(subscribe(token), peer(1000, 9)).datagram).has_challenge());
  EXPECT_TRUE(parse(say(subscribe(token + 1), peer(1000)).datagram).has_challenge());
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(NativeRegistryTest, ForgetsAClientWhoseLeaseEnds) {
  join(peer(1000));
  now_ += kLease - Duration{1};
  EXPECT_EQ(registry_.expire(now_), 0u);
  now_ += Duration{1};
  EXPECT_EQ(registry_.expire(now_), 1u);
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(NativeRegistryTest, RenewsALeaseForHours) {
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

TEST_F(NativeRegistryTest, RenewsNoLeaseWithoutTheToken) {
  join(peer(1000));
  now_ += kLease - Duration{1};
  EXPECT_TRUE(parse(say(subscribe(0), peer(1000)).datagram).has_challenge());
  now_ += Duration{1};
  EXPECT_EQ(registry_.expire(now_), 1u);
}

TEST_F(NativeRegistryTest, EndsASubscriptionOnlyForItsToken) {
  const auto token = join(peer(1000));
  EXPECT_EQ(say(unsubscribe(token + 1), peer(1000)).event, Registry::Event::kNone);
  EXPECT_EQ(say(unsubscribe(token), peer(1001)).event, Registry::Event::kNone);
  EXPECT_EQ(registry_.subscribers().size(), 1u);
  const auto reply = say(unsubscribe(token), peer(1000));
  EXPECT_EQ(reply.event, Registry::Event::kLeft);
  EXPECT_TRUE(reply.datagram.empty());
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(NativeRegistryTest, RefusesMoreThanTheLimitPerAddress) {
  EXPECT_NE(join(peer(1000)), 0u);
  EXPECT_NE(join(peer(1001)), 0u);
  const auto answer = parse(say(subscribe(challenge(peer(1002))), peer(1002)).datagram);
  EXPECT_EQ(answer.notice().reason(), v1::Notice::REASON_ADDRESS_FULL);
  EXPECT_EQ(answer.notice().nonce(), 5u);
  EXPECT_NE(join(peer(1002, 2)), 0u) << "another address is still welcome";
}

TEST_F(NativeRegistryTest, RefusesClientsAboveTheServersLimitUntilOneLeaves) {
  for (std::uint8_t host = 1; host <= 4; ++host) EXPECT_NE(join(peer(1000, host)), 0u);
  const auto token = challenge(peer(1000, 5));
  const auto answer = parse(say(subscribe(token), peer(1000, 5)).datagram);
  EXPECT_EQ(answer.notice().reason(), v1::Notice::REASON_SERVER_FULL);
  now_ += kLease;
  EXPECT_TRUE(parse(say(subscribe(token), peer(1000, 5)).datagram).has_lease());
}

TEST_F(NativeRegistryTest, AFloodFromTenThousandPortsGetsFewAnswersAndLeavesNoTrace) {
  const auto question = subscribe(0);
  std::size_t bytes_in = 0;
  std::size_t bytes_out = 0;
  int answers = 0;
  (void)say(question, peer(9));          // warm-up: protobuf's own first-use tables
  log::flush(std::chrono::seconds(10));  // its thread allocates, too
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

TEST_F(NativeRegistryTest, AFloodOfOneAddressDoesNotLockOutAnother) {
  for (int i = 0; i < 10'000; ++i)
    (void)say(subscribe(0), peer(static_cast<std::uint16_t>(1000 + i)));
  EXPECT_NE(join(peer(1000, 2)), 0u);
}

TEST_F(NativeRegistryTest, AFloodOfOneAddressDoesNotEndItsOwnLease) {
  const auto token = join(peer(500));
  for (int i = 0; i < 10'000; ++i)
    (void)say(subscribe(0), peer(static_cast<std::uint16_t>(1000 + i)));
  EXPECT_TRUE(parse(say(subscribe(token), peer(500)).datagram).has_lease());
}

TEST_F(NativeRegistryTest, AnswersClockRequestsOfSubscribersOnly) {
  const auto token = challenge(peer(1000));
  EXPECT_TRUE(say(clock_query(token), peer(1000)).datagram.empty())
      << "a proven address that never subscribed";
  const auto renewed = parse(say(subscribe(token), peer(1000)).datagram).lease().token();
  EXPECT_TRUE(say(clock_query(renewed + 1), peer(1000)).datagram.empty());
  EXPECT_TRUE(say(clock_query(renewed), peer(1001)).datagram.empty())
      << "somebody else with his token";
  const auto question = clock_query(renewed);
  const auto reply = say(question, peer(1000));
  EXPECT_LE(reply.datagram.size(), question.size());
  const auto answer = parse(reply.datagram).clock_reply();
  EXPECT_EQ(answer.number(), 11u);
  EXPECT_EQ(answer.session(), kSession);
  EXPECT_EQ(answer.received_at_ns(), to_ns(now_));
  EXPECT_GE(answer.sent_at_ns(), answer.received_at_ns());
}

TEST_F(NativeRegistryTest, IntroducesItselfSeldomAndShorterThanTheQuestion) {
  v1::Envelope envelope;
  envelope.set_protocol(kProtocol);
  envelope.mutable_discovery_query()->set_nonce(5);
  envelope.mutable_discovery_query()->set_padding(std::string(kMinDiscovery, '\0'));
  const auto question = bytes_of(envelope);
  EXPECT_TRUE(say(question, peer(1000)).datagram.empty()) << "not before it has something to say";
  registry_.set_discovery(
      ServerCard{std::string(500, 'h'), std::string(500, 'v'), ~0u, 1e30, 65535});
  int answers = 0;
  for (int i = 0; i < 10'000; ++i) {
    const auto reply = say(question, peer(static_cast<std::uint16_t>(i)));
    ASSERT_LE(reply.datagram.size(), kMinDiscovery);
    answers += reply.datagram.empty() ? 0 : 1;
  }
  EXPECT_EQ(answers, static_cast<int>(AnswerLimiter::kBurst));
  EXPECT_NE(join(peer(1000)), 0u) << "a flood of questions does not keep subscribers out";
}

TEST_F(NativeRegistryTest, GrantsProfilesAndForgetsThemWithTheirUsers) {
  v1::Profile slow;
  slow.set_max_rate_hz(10);
  const auto token = challenge(peer(1000));
  const auto reply = say(subscribe_as(token, slow), peer(1000));
  EXPECT_EQ(parse(reply.datagram).lease().profile(), 1u);
  EXPECT_TRUE(reply.send_model);
  ASSERT_EQ(registry_.profiles().size(), 1u);
  EXPECT_EQ(registry_.profiles()[0].profile.max_rate_hz, 10);
  now_ += kLease;
  EXPECT_EQ(registry_.expire(now_), 1u);
  EXPECT_TRUE(registry_.profiles().empty());
}

TEST_F(NativeRegistryTest, OneAddressDoesNotKeepAllProfilesFromOthers) {
  give_room(64);
  for (int i = 0; i < kProfiles; ++i)
    ASSERT_TRUE(join_with_rate(peer(static_cast<std::uint16_t>(1000 + i)), 1 + i).has_lease());
  EXPECT_TRUE(join_with_rate(peer(1000, 2), 101).has_lease());
  EXPECT_EQ(clients_of(peer(0)), kProfiles - 1) << "the greedy address gives one up";
  EXPECT_EQ(registry_.profiles().size(), ProfileTable::kMost);
  const auto back = join_with_rate(peer(1099), 102);
  EXPECT_EQ(back.notice().reason(), v1::Notice::REASON_PROFILES_FULL) << "and gets none back";
}

TEST_F(NativeRegistryTest, AProfileThatOthersUseIsNotTheOneThatIsGivenUp) {
  give_room(64);
  for (int i = 0; i < kProfiles; ++i)
    ASSERT_TRUE(join_with_rate(peer(static_cast<std::uint16_t>(1000 + i)), 1 + i).has_lease());
  ASSERT_TRUE(join_with_rate(peer(1000, 3), kProfiles).has_lease());  // shares the newest
  ASSERT_TRUE(join_with_rate(peer(1000, 2), 101).has_lease());
  EXPECT_EQ(clients_of(peer(0, 3)), 1);
  EXPECT_EQ(clients_of(peer(0)), kProfiles - 1);
}

TEST_F(NativeRegistryTest, EveryAddressWithOneProfileKeepsIt) {
  give_room(64);
  for (int i = 0; i < kProfiles; ++i)
    ASSERT_TRUE(join_with_rate(peer(1000, static_cast<std::uint8_t>(1 + i)), 1 + i).has_lease());
  const auto late = join_with_rate(peer(1000, 100), 101);
  EXPECT_EQ(late.notice().reason(), v1::Notice::REASON_PROFILES_FULL);
}

TEST_F(NativeRegistryTest, WhoHoldsTheMostPlacesGivesOneToWhoHasNone) {
  ASSERT_NE(join(peer(1000)), 0u);
  ASSERT_NE(join(peer(1001)), 0u);
  ASSERT_NE(join(peer(1000, 2)), 0u);
  ASSERT_NE(join(peer(1001, 2)), 0u);
  const auto token = challenge(peer(1000, 3));
  const auto reply = say(subscribe(token), peer(1000, 3));
  EXPECT_EQ(reply.event, Registry::Event::kJoined);
  EXPECT_EQ(reply.instead_of, peer(1001));
  EXPECT_EQ(registry_.subscribers().size(), 4u);
}

TEST_F(NativeRegistryTest, TheOperatorAtTheMachineGetsAPlaceOfManyWhoHaveOne) {
  for (std::uint8_t host = 1; host <= 4; ++host) ASSERT_NE(join(peer(1000, host)), 0u);
  EXPECT_EQ(join(peer(1000, 5)), 0u);
  EXPECT_NE(join(Peer{0x7f000001, 1000}), 0u);
  EXPECT_EQ(registry_.subscribers().size(), 4u);
}

TEST_F(NativeRegistryTest, RefusesProfilesItDoesNotKnow) {
  std::vector<v1::Profile> strange(6);
  strange[0].set_up_axis(static_cast<v1::Profile::UpAxis>(7));
  strange[1].set_max_rate_hz(-1);
  strange[2].set_max_rate_hz(std::numeric_limits<float>::quiet_NaN());
  strange[3].add_bodies("");
  strange[4].add_bodies(std::string(129, 'x'));
  for (int i = 0; i < 33; ++i) strange[5].add_bodies("x");
  const auto token = challenge(peer(1000));
  for (const auto& profile : strange) {
    const auto answer = parse(say(subscribe_as(token, profile), peer(1000)).datagram);
    EXPECT_EQ(answer.notice().reason(), v1::Notice::REASON_PROFILE_INVALID);
  }
  EXPECT_TRUE(registry_.subscribers().empty());
}

TEST_F(NativeRegistryTest, ProfileChangesDoNotCauseMoreEncoding) {
  auto token = join(peer(1000));
  int changes = 0;
  for (int i = 1; i <= 1000; ++i) {
    v1::Profile profile;
    profile.set_max_rate_hz(static_cast<float>(i));
    now_ += std::chrono::milliseconds(1);
    changes += say(subscribe_as(token, profile), peer(1000)).send_model ? 1 : 0;
    ASSERT_LE(registry_.profiles().size(), 1u);
  }
  EXPECT_LE(changes, 1000 / 50) << "one per 50 ms";
  EXPECT_GT(changes, 0);
}

TEST_F(NativeRegistryTest, NamesTheGroupOnlyToWhoAsksForIt) {
  EXPECT_EQ(parse(say(subscribe(join(peer(1000))), peer(1000)).datagram).lease().multicast_port(),
            0u);
  registry_.offer_multicast({{239, 255, 42, 16}, 21601});
  now_ += std::chrono::milliseconds(60);
  EXPECT_EQ(parse(say(subscribe(join(peer(1000))), peer(1000)).datagram).lease().multicast_port(),
            0u);
  const auto token = challenge(peer(1001));
  const auto lease = parse(say(subscribe_as(token, {}, true), peer(1001)).datagram).lease();
  EXPECT_EQ(lease.multicast_port(), 21601u);
  EXPECT_EQ(lease.multicast_group(), std::string("\xef\xff\x2a\x10"));
}

TEST_F(NativeRegistryTest, GarbageGetsNoAnswer) {
  EXPECT_TRUE(say({}, peer(1000)).datagram.empty());
  EXPECT_TRUE(say(Datagram(500, std::byte{0x5a}), peer(1000)).datagram.empty());
  EXPECT_EQ(registry_.unanswered().malformed, 2u);
}

}  // namespace
}  // namespace fiducap::native
