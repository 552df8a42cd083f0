#include "streaming/native/registry.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "base/log.hpp"
#include "fiducap/v1/envelope.pb.h"
#include "support/allocation_counter.hpp"

namespace fiducap::native {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t kSession = 77;
constexpr std::uint64_t kGeneration = 1;
constexpr Duration kLease = 3s;

/// Address 192.0.2.`host`.
Peer peer(int port, std::uint8_t host = 1) {
  return {{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 192, 0, 2, host},
          static_cast<std::uint16_t>(port)};
}

TEST(SipHash, MatchesThePaper) {
  // Appendix A of the paper: key 00 … 0f, input 00 … 0e.
  std::array<std::uint8_t, 15> input{};
  std::iota(input.begin(), input.end(), std::uint8_t{0});
  EXPECT_EQ(siphash({0x0706050403020100, 0x0f0e0d0c0b0a0908}, input), 0xa129ca6149be45e5u);
}

class TokenIssuerTest : public testing::Test {
 protected:
  static constexpr Duration kPeriod = 10s;
  static constexpr Instant kNow = instant_from_ns(1'000'000'000'000);
  const TokenIssuer tokens_{{3, 4}, kPeriod};
  const std::uint64_t token_ = tokens_.token(peer(5000), kNow);
};

TEST_F(TokenIssuerTest, TokenIsValidForOneToTwoPeriods) {
  EXPECT_TRUE(tokens_.accepts(token_, peer(5000), kNow));
  EXPECT_TRUE(tokens_.accepts(token_, peer(5000), kNow + kPeriod));
  EXPECT_FALSE(tokens_.accepts(token_, peer(5000), kNow + 2 * kPeriod));
}

TEST_F(TokenIssuerTest, RefusesTheTokenOfAnotherAddressPortOrServer) {
  EXPECT_FALSE(tokens_.accepts(token_, peer(5000, 2), kNow));
  EXPECT_FALSE(tokens_.accepts(token_, peer(5001), kNow));
  EXPECT_FALSE(tokens_.accepts(0, peer(5000), kNow));
  EXPECT_FALSE(TokenIssuer({1, 2}, kPeriod).accepts(token_, peer(5000), kNow));
}

TEST_F(TokenIssuerTest, CountsAnIPv6NetworkAsOneAddress) {
  const auto host = [](std::uint8_t last) {
    return Peer({0x20, 0x01, 0x0d, 0xb8, 0, 0, 0, 1, 1, 2, 3, 4, 5, 6, 7, last}, 0);
  };
  EXPECT_EQ(tokens_.address_hash(host(8)), tokens_.address_hash(host(9)));
  EXPECT_NE(tokens_.address_hash(peer(1, 1)), tokens_.address_hash(peer(1, 2)));
}

Datagram bytes_of(v1::Envelope envelope) {
  envelope.set_protocol(kProtocol);
  Datagram bytes(envelope.ByteSizeLong());
  envelope.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
  return bytes;
}
Datagram subscribe(std::uint64_t token, std::uint64_t known_model = 0,
                   const v1::Profile& profile = {}, bool multicast = false) {
  v1::Envelope envelope;
  auto& out = *envelope.mutable_subscribe();
  out.set_token(token);
  out.set_nonce(5);
  out.set_model_generation(known_model);
  out.set_client_name("te\x01st");
  out.set_padding(std::string(kMinSubscribe, '\0'));
  out.set_multicast(multicast);
  if (profile.ByteSizeLong() > 0) *out.mutable_profile() = profile;
  return bytes_of(envelope);
}
Datagram clock_query(std::uint64_t token) {
  v1::Envelope envelope;
  envelope.mutable_clock_query()->set_token(token);
  envelope.mutable_clock_query()->set_number(11);
  envelope.mutable_clock_query()->set_padding(std::string(kMinClockQuery, '\0'));
  return bytes_of(envelope);
}
Datagram unsubscribe(std::uint64_t token) {
  v1::Envelope envelope;
  envelope.mutable_unsubscribe()->set_token(token);
  return bytes_of(envelope);
}
v1::Profile with_rate(int rate_hz) {
  v1::Profile profile;
  profile.set_max_rate_hz(static_cast<float>(rate_hz));
  return profile;
}

class NativeRegistryTest : public testing::Test {
 protected:
  Registry::Reply receive(const Datagram& datagram, const Peer& from = peer(1000)) {
    return registry_.receive(datagram, from, kGeneration, now_);
  }
  /// The decoded reply.
  v1::Envelope reply(const Datagram& datagram, const Peer& from = peer(1000)) {
    const auto bytes = receive(datagram, from).datagram;
    v1::Envelope envelope;
    EXPECT_TRUE(envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
    return envelope;
  }
  std::uint64_t challenge(const Peer& from = peer(1000)) {
    const auto answer = reply(subscribe(0), from);
    EXPECT_TRUE(answer.has_challenge());
    return answer.challenge().token();
  }
  /// @return the token for the renewal, 0 when refused
  std::uint64_t join(const Peer& from = peer(1000)) {
    return reply(subscribe(challenge(from)), from).lease().token();
  }
  /// One client with a profile of its own. @return its reply
  v1::Envelope join_with_rate(const Peer& from, int rate_hz) {
    return reply(subscribe(challenge(from), 0, with_rate(rate_hz)), from);
  }
  /// Room for 64 clients; from `peer(1000)` on, one with each possible profile.
  void take_all_profiles(bool same_address) {
    registry_ = Registry{RegistryLimits{64, 64, kLease}, {1, 2}, kSession};
    for (int i = 0; i < kProfiles; ++i) {
      const auto host = static_cast<std::uint8_t>(1 + i);
      ASSERT_TRUE(
          join_with_rate(same_address ? peer(1000 + i) : peer(1000, host), 1 + i).has_lease());
    }
  }
  [[nodiscard]] std::size_t clients() const { return registry_.subscribers().size(); }
  [[nodiscard]] std::ptrdiff_t clients_of(const Peer& address) const {
    const auto all = registry_.subscribers();
    return std::count_if(all.begin(), all.end(),
                         [&](const Subscriber& s) { return s.peer.same_address(address); });
  }
  static constexpr int kProfiles = static_cast<int>(ProfileTable::kMost);

  Instant now_ = instant_from_ns(50'000'000'000);
  Registry registry_{RegistryLimits{4, 2, kLease}, {1, 2}, kSession};
};

TEST_F(NativeRegistryTest, ChallengesAnUnknownAddressAndKeepsNothing) {
  const auto answer = reply(subscribe(0));
  ASSERT_TRUE(answer.has_challenge());
  EXPECT_EQ(answer.challenge().nonce(), 5u);
  EXPECT_EQ(answer.challenge().session(), kSession);
  EXPECT_FALSE(receive(subscribe(0)).send_model);
  EXPECT_EQ(clients(), 0u);
}

TEST_F(NativeRegistryTest, TokenGetsALeaseAndTheModel) {
  const auto request = subscribe(challenge());
  const auto answer = receive(request);
  EXPECT_TRUE(answer.send_model);
  EXPECT_EQ(answer.event, Registry::Event::kJoined);
  ASSERT_EQ(clients(), 1u);
  EXPECT_EQ(registry_.subscribers()[0].name, "te\\x01st");
  const auto lease = reply(request).lease();
  EXPECT_EQ(lease.lease_ms(), 3000u);
  EXPECT_EQ(lease.session(), kSession);
  EXPECT_EQ(lease.model_generation(), kGeneration);
}

TEST_F(NativeRegistryTest, SendsTheModelAgainAfterAPauseUnlessItIsKnown) {
  const auto token = join();
  EXPECT_FALSE(receive(subscribe(token)).send_model);
  now_ += 60ms;
  const auto renewed = receive(subscribe(token, kGeneration));
  EXPECT_FALSE(renewed.send_model);
  EXPECT_EQ(renewed.event, Registry::Event::kNone);
  EXPECT_TRUE(reply(subscribe(token, kGeneration)).has_lease());
  EXPECT_TRUE(receive(subscribe(token)).send_model);
}

TEST_F(NativeRegistryTest, RefusesATokenFromAnotherAddress) {
  const auto token = challenge();
  EXPECT_TRUE(reply(subscribe(token), peer(1001)).has_challenge());
  EXPECT_TRUE(reply(subscribe(token), peer(1000, 9)).has_challenge());
  EXPECT_TRUE(reply(subscribe(token + 1)).has_challenge());
  EXPECT_EQ(clients(), 0u);
}

TEST_F(NativeRegistryTest, RemovesAClientWhenItsLeaseEnds) {
  join();
  now_ += kLease - Duration{1};
  EXPECT_EQ(registry_.expire(now_), 0u);
  EXPECT_TRUE(reply(subscribe(0)).has_challenge()) << "renews nothing without the token";
  now_ += Duration{1};
  EXPECT_EQ(registry_.expire(now_), 1u);
  EXPECT_EQ(clients(), 0u);
}

TEST_F(NativeRegistryTest, RenewsALeaseForHours) {
  auto token = join();
  for (int i = 0; i < 3600; ++i) {
    now_ += kLease / 3;
    const auto answer = reply(subscribe(token, kGeneration));
    ASSERT_TRUE(answer.has_lease()) << "renewal " << i;
    token = answer.lease().token();
    EXPECT_EQ(registry_.expire(now_), 0u);
  }
  EXPECT_EQ(clients(), 1u);
}

TEST_F(NativeRegistryTest, EndsASubscriptionOnlyForItsToken) {
  const auto token = join();
  EXPECT_EQ(receive(unsubscribe(token + 1)).event, Registry::Event::kNone);
  EXPECT_EQ(receive(unsubscribe(token), peer(1001)).event, Registry::Event::kNone);
  EXPECT_EQ(clients(), 1u);
  const auto answer = receive(unsubscribe(token));
  EXPECT_EQ(answer.event, Registry::Event::kLeft);
  EXPECT_TRUE(answer.datagram.empty());
  EXPECT_EQ(clients(), 0u);
}

TEST_F(NativeRegistryTest, LimitsTheClientsOfAnAddress) {
  EXPECT_NE(join(peer(1000)), 0u);
  EXPECT_NE(join(peer(1001)), 0u);
  const auto notice = reply(subscribe(challenge(peer(1002))), peer(1002)).notice();
  EXPECT_EQ(notice.reason(), v1::Notice::REASON_ADDRESS_FULL);
  EXPECT_EQ(notice.nonce(), 5u);
  EXPECT_NE(join(peer(1002, 2)), 0u) << "another address";
}

TEST_F(NativeRegistryTest, LimitsTheClientsOfTheServer) {
  for (std::uint8_t host = 1; host <= 4; ++host) EXPECT_NE(join(peer(1000, host)), 0u);
  const auto request = subscribe(challenge(peer(1000, 5)));
  EXPECT_EQ(reply(request, peer(1000, 5)).notice().reason(), v1::Notice::REASON_SERVER_FULL);
  now_ += kLease;
  EXPECT_TRUE(reply(request, peer(1000, 5)).has_lease());
}

TEST_F(NativeRegistryTest, FloodFromManyPortsGetsFewRepliesAndAllocatesNothing) {
  const auto request = subscribe(0);
  (void)receive(request, peer(9));  // warm-up: protobuf's own first-use tables
  log::flush(10s);                  // its thread allocates, too
  const AllocationCounter per_answer;
  const auto first = receive(request, peer(10));
  const auto allocations_of_one = per_answer.count();
  ASSERT_LE(first.datagram.size(), request.size());
  const AllocationCounter allocations;
  std::size_t bytes_out = 0;
  int answers = 0;
  for (int i = 0; i < 10'000; ++i) {
    const auto answer = receive(request, peer(1000 + i));
    bytes_out += answer.datagram.size();
    answers += answer.datagram.empty() ? 0 : 1;
    ASSERT_LE(answer.datagram.size(), request.size());
  }
  EXPECT_LE(answers, static_cast<int>(AnswerLimiter::kBurst));
  EXPECT_LE(bytes_out, 10'000 * request.size());
  EXPECT_EQ(clients(), 0u);
  // Nothing is kept: each request costs only what reading it costs, and that is given back.
  EXPECT_LE(allocations.count(), 10'000 * allocations_of_one);
}

TEST_F(NativeRegistryTest, FloodOfAnAddressEndsNoLeaseAndExcludesNoOtherAddress) {
  const auto token = join(peer(500));
  for (int i = 0; i < 10'000; ++i) (void)receive(subscribe(0), peer(1000 + i));
  EXPECT_TRUE(reply(subscribe(token), peer(500)).has_lease());
  EXPECT_NE(join(peer(1000, 2)), 0u);
}

TEST_F(NativeRegistryTest, AnswersClockRequestsOfSubscribersOnly) {
  const auto token = challenge();
  EXPECT_TRUE(receive(clock_query(token)).datagram.empty()) << "a proven address, no subscriber";
  const auto renewed = reply(subscribe(token)).lease().token();
  EXPECT_TRUE(receive(clock_query(renewed + 1)).datagram.empty());
  EXPECT_TRUE(receive(clock_query(renewed), peer(1001)).datagram.empty()) << "another client";
  const auto request = clock_query(renewed);
  EXPECT_LE(receive(request).datagram.size(), request.size());
  const auto answer = reply(request).clock_reply();
  EXPECT_EQ(answer.number(), 11u);
  EXPECT_EQ(answer.session(), kSession);
  EXPECT_EQ(answer.received_at_ns(), to_ns(now_));
  EXPECT_GE(answer.sent_at_ns(), answer.received_at_ns());
}

TEST_F(NativeRegistryTest, DiscoveryRepliesAreShortAndLimited) {
  v1::Envelope envelope;
  envelope.mutable_discovery_query()->set_nonce(5);
  envelope.mutable_discovery_query()->set_padding(std::string(kMinDiscovery, '\0'));
  const auto request = bytes_of(envelope);
  EXPECT_TRUE(receive(request).datagram.empty()) << "there is no server card yet";
  registry_.set_discovery(
      ServerCard{std::string(500, 'h'), std::string(500, 'v'), ~0u, 1e30, 65535});
  int answers = 0;
  for (int i = 0; i < 10'000; ++i) {
    const auto answer = receive(request, peer(i));
    ASSERT_LE(answer.datagram.size(), kMinDiscovery);
    answers += answer.datagram.empty() ? 0 : 1;
  }
  EXPECT_EQ(answers, static_cast<int>(AnswerLimiter::kBurst));
  EXPECT_NE(join(), 0u) << "a flood of requests excludes no subscriber";
}

TEST_F(NativeRegistryTest, RemovesAProfileWithItsLastUser) {
  const auto request = subscribe(challenge(), 0, with_rate(10));
  EXPECT_TRUE(receive(request).send_model);
  EXPECT_EQ(reply(request).lease().profile(), 1u);
  ASSERT_EQ(registry_.profiles().size(), 1u);
  EXPECT_EQ(registry_.profiles()[0].profile.max_rate_hz, 10);
  now_ += kLease;
  EXPECT_EQ(registry_.expire(now_), 1u);
  EXPECT_TRUE(registry_.profiles().empty());
}

TEST_F(NativeRegistryTest, AddressWithMostProfilesYieldsOneToAnother) {
  take_all_profiles(true);
  EXPECT_TRUE(join_with_rate(peer(1000, 2), 101).has_lease());
  EXPECT_EQ(clients_of(peer(0)), kProfiles - 1);
  EXPECT_EQ(registry_.profiles().size(), ProfileTable::kMost);
  EXPECT_EQ(join_with_rate(peer(1099), 102).notice().reason(), v1::Notice::REASON_PROFILES_FULL)
      << "and gets none back";
}

TEST_F(NativeRegistryTest, SharedProfileIsNotTheOneThatIsRemoved) {
  take_all_profiles(true);
  ASSERT_TRUE(join_with_rate(peer(1000, 3), kProfiles).has_lease());  // shares the newest
  ASSERT_TRUE(join_with_rate(peer(1000, 2), 101).has_lease());
  EXPECT_EQ(clients_of(peer(0, 3)), 1);
  EXPECT_EQ(clients_of(peer(0)), kProfiles - 1);
}

TEST_F(NativeRegistryTest, AddressWithOneProfileKeepsIt) {
  take_all_profiles(false);
  EXPECT_EQ(join_with_rate(peer(1000, 100), 101).notice().reason(),
            v1::Notice::REASON_PROFILES_FULL);
}

TEST_F(NativeRegistryTest, AddressWithMostClientsYieldsToOneWithNone) {
  for (const auto& one : {peer(1000), peer(1001), peer(1000, 2), peer(1001, 2)})
    ASSERT_NE(join(one), 0u);
  const auto answer = receive(subscribe(challenge(peer(1000, 3))), peer(1000, 3));
  EXPECT_EQ(answer.event, Registry::Event::kJoined);
  EXPECT_EQ(answer.instead_of, peer(1001));
  EXPECT_EQ(clients(), 4u);
}

TEST_F(NativeRegistryTest, RefusesInvalidProfiles) {
  std::vector<v1::Profile> invalid(6);
  invalid[0].set_up_axis(static_cast<v1::Profile::UpAxis>(7));
  invalid[1].set_max_rate_hz(-1);
  invalid[2].set_max_rate_hz(std::numeric_limits<float>::quiet_NaN());
  invalid[3].add_bodies("");
  invalid[4].add_bodies(std::string(129, 'x'));
  for (int i = 0; i < 33; ++i) invalid[5].add_bodies("x");
  const auto token = challenge();
  for (const auto& profile : invalid)
    EXPECT_EQ(reply(subscribe(token, 0, profile)).notice().reason(),
              v1::Notice::REASON_PROFILE_INVALID);
  EXPECT_EQ(clients(), 0u);
}

TEST_F(NativeRegistryTest, ProfileChangesDoNotCauseMoreEncoding) {
  const auto token = join();
  int changes = 0;
  for (int i = 1; i <= 1000; ++i) {
    now_ += 1ms;
    changes += receive(subscribe(token, 0, with_rate(i))).send_model ? 1 : 0;
    ASSERT_LE(registry_.profiles().size(), 1u);
  }
  EXPECT_LE(changes, 1000 / 50) << "one per 50 ms";
  EXPECT_GT(changes, 0);
}

TEST_F(NativeRegistryTest, ReportsTheMulticastGroupOnRequestOnly) {
  EXPECT_EQ(reply(subscribe(join())).lease().multicast_port(), 0u);
  registry_.offer_multicast({{239, 255, 42, 16}, 21601});
  now_ += 60ms;
  EXPECT_EQ(reply(subscribe(join())).lease().multicast_port(), 0u);
  const auto token = challenge(peer(1001));
  const auto lease = reply(subscribe(token, 0, {}, true), peer(1001)).lease();
  EXPECT_EQ(lease.multicast_port(), 21601u);
  EXPECT_EQ(lease.multicast_group(), std::string("\xef\xff\x2a\x10"));
}

TEST_F(NativeRegistryTest, DoesNotAnswerMalformedDatagrams) {
  EXPECT_TRUE(receive({}).datagram.empty());
  EXPECT_TRUE(receive(Datagram(500, std::byte{0x5a})).datagram.empty());
}

}  // namespace
}  // namespace fiducap::native
