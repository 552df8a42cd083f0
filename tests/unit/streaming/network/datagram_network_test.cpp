// NatNet and MAVLink over a network that loses, doubles, delays and cuts, in virtual time.
#include <gtest/gtest.h>

#include <map>

#include "../natnet/messages.hpp"
#include "base/bytes.hpp"
#include "streaming/mavlink/vehicle_link.hpp"
#include "streaming/natnet/conversation.hpp"
#include "support/faulty_link.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

constexpr Duration kStep = 10ms;
const std::vector<std::string> kNames{"arm", "drone"};

/// A unicast client of this family: connects until it hears something, then keeps alive.
class NatNetNetwork {
 public:
  explicit NatNetNetwork(std::uint32_t seed)
      : random_(seed),
        up_(random_, LinkFaults::drawn(random_)),
        down_(random_, LinkFaults::drawn(random_)),
        conversation_(
            config_, frame_->model, nullptr, 100, random_(),
            net::TrustedNetworks({}, [] { return std::vector{*net::parse_network("10.0.0.0/8")}; }),
            now_) {}

  void suffer() {
    for (int i = 0; i < 300; ++i) {
      if (random_() % 100 == 0) ++peer_.port;
      step();
    }
  }
  void heal() {
    up_.set({});
    down_.set({});
  }
  Duration wait_for_frames(int wanted, Duration timeout) {
    const Instant begin = now_;
    const int before = frames_;
    while (frames_ < before + wanted && now_ - begin < timeout) step();
    return now_ - begin;
  }
  [[nodiscard]] std::size_t clients() const { return conversation_.subscribers().size(); }

 private:
  void step() {
    now_ += kStep;
    if (now_ - asked_ >= 500ms) {
      const bool heard = heard_ && now_ - *heard_ < 2s;
      up_.send(
          heard ? natnet::message(natnet::Message::kKeepAlive) : natnet::connect({4, 1}, {4, 1}),
          now_);
      asked_ = now_;
    }
    while (const auto datagram = up_.receive(now_)) {
      const auto answer = conversation_.receive(*datagram, peer_, natnet::Channel::kUnicast, now_);
      if (!answer.empty()) down_.send(answer, now_);
    }
    publish();
    while (const auto datagram = down_.receive(now_)) take(*datagram);
  }
  void publish() {
    (void)conversation_.expire(now_);
    auto frame = std::make_shared<SceneFrame>(*frame_);
    frame->number = ++number_;
    frame->at = frame->published_at = now_;
    conversation_.take(frame, now_);
    for (const auto& one : conversation_.subscribers()) {
      if (one.peer != peer_) continue;
      if (const auto bytes = conversation_.frame_for(one, now_); !bytes.empty())
        down_.send(bytes, now_);
    }
  }
  void take(std::span<const std::byte> datagram) {
    LittleEndianReader in(datagram);
    const auto kind = in.u16();
    if (in.u16() + natnet::kHeaderSize != datagram.size()) return;  // cut
    heard_ = now_;
    frames_ += kind == static_cast<std::uint16_t>(natnet::Message::kFrame) ? 1 : 0;
  }

  std::mt19937 random_;
  FaultyLink up_;
  FaultyLink down_;
  natnet::NatNetConfig config_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame(kNames);
  Instant now_ = instant_from_ns(1'000'000'000'000);
  natnet::Conversation conversation_;
  net::Peer peer_{0x0a000007, 40001};
  Instant asked_{};
  std::optional<Instant> heard_;
  std::uint64_t number_{0};
  int frames_{0};
};

TEST(NatNetNetwork, AClientThatGoesOnAskingIsServedWhenTheNetworkIsGoodAgain) {
  for (std::uint32_t seed = 1; seed <= seeds(1000); ++seed) {
    NatNetNetwork network(seed);
    network.suffer();
    network.heal();
    // The client connects again after 2 s and sends keep-alives every 0.5 s.
    ASSERT_LT(network.wait_for_frames(20, 6s), 4s) << "seed " << seed;
    ASSERT_LE(network.clients(), 16u) << "seed " << seed;
  }
}

constexpr Duration kAutopilotClock = 1234567ms;  ///< Its own minus the server's.

TEST(MavlinkNetwork, PosesFlowAndTheClockIsNeverFurtherOffThanItSays) {
  for (std::uint32_t seed = 1; seed <= seeds(500); ++seed) {
    std::mt19937 random(seed);
    const LinkFaults up_faults = LinkFaults::drawn(random);
    const LinkFaults down_faults = LinkFaults::drawn(random);
    FaultyLink up(random, up_faults);
    FaultyLink down(random, down_faults);
    mavlink::VehicleConfig config;
    config.body = "drone";
    mavlink::VehicleLink link(config);
    const auto frame = make_scene_frame({"drone"});
    Instant now = instant_from_ns(1'000'000'000'000);
    std::vector<std::byte> bytes;
    for (int i = 0; i < 1000; ++i) {
      now += kStep;
      ++frame->number;
      frame->at = frame->published_at = now;
      bytes.clear();
      link.publish(*frame, &frame->bodies[0], 0, now, bytes);
      if (!bytes.empty()) down.send(bytes, now);
      while (const auto datagram = down.receive(now)) {
        std::span<const std::byte> in(*datagram);
        while (const auto message = mavlink::next_frame(in)) {
          if (message->message != static_cast<std::uint32_t>(mavlink::MessageId::kTimesync))
            continue;
          const auto asked = mavlink::decode_timesync(*message);
          if (asked.tc1_ns != 0) continue;
          bytes.clear();
          mavlink::encode_timesync(
              {1, 1, 0}, {(now + kAutopilotClock).time_since_epoch().count(), asked.ts1_ns}, bytes);
          up.send(bytes, now);
        }
      }
      while (const auto datagram = up.receive(now)) {
        bytes.clear();
        link.receive(*datagram, now, bytes);
        ASSERT_LE(bytes.size(), datagram->size());
      }
    }
    ASSERT_GE(link.poses(), 395u) << "seed " << seed;
    if (const auto offset = link.clock_offset(now)) {
      const Duration error = offset->to_autopilot - kAutopilotClock;
      ASSERT_LE(std::chrono::abs(error), offset->bound + kStep) << "seed " << seed;
    }
  }
}

}  // namespace
}  // namespace fiducap
