// NatNet and MAVLink over a network that loses, doubles, delays and cuts, in virtual time.
#include <gtest/gtest.h>

#include "../natnet/messages.hpp"
#include "base/bytes.hpp"
#include "datagram_network.hpp"
#include "streaming/mavlink/vehicle_link.hpp"
#include "streaming/natnet/conversation.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

constexpr Duration kStep = 10ms;
const std::vector<std::string> kNames{"arm", "drone"};

/// A unicast client: connects until it receives something, then sends keep-alives.
class NatNetNetwork : public DatagramNetwork {
 public:
  explicit NatNetNetwork(std::uint32_t seed)
      : DatagramNetwork(seed),
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
  [[nodiscard]] std::size_t clients() const { return conversation_.subscribers().size(); }

 private:
  void step() override {
    now_ += kStep;
    if (now_ - asked_ >= 500ms) {
      const bool connected = heard_ && now_ - *heard_ < 2s;
      up_.send(connected ? natnet::message(natnet::Message::kKeepAlive)
                         : natnet::connect({4, 1}, {4, 1}),
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

  natnet::NatNetConfig config_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame(kNames);
  natnet::Conversation conversation_;
  Instant asked_{};
  std::optional<Instant> heard_;
  std::uint64_t number_{0};
};

TEST(NatNetNetwork, ServesARequestingClientOnceTheNetworkWorks) {
  for (std::uint32_t seed = 1; seed <= seeds(); ++seed) {
    NatNetNetwork network(seed);
    network.suffer();
    network.heal();
    // The client connects again after 2 s and sends keep-alives every 0.5 s.
    ASSERT_LT(network.wait_for_frames(20, 6s), 4s) << "seed " << seed;
    ASSERT_LE(network.clients(), 16u) << "seed " << seed;
  }
}

constexpr Duration kAutopilotClock = 1234567ms;  ///< The autopilot's minus the server's.

TEST(MavlinkNetwork, SendsPosesAndTheClockErrorStaysWithinItsBound) {
  for (std::uint32_t seed = 1; seed <= seeds(); ++seed) {
    std::mt19937 random(seed);
    FaultyLink up(random, LinkFaults::drawn(random));
    FaultyLink down(random, LinkFaults::drawn(random));
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
          mavlink::encode_timesync({1, 1, 0}, {to_ns(now + kAutopilotClock), asked.ts1_ns}, bytes);
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
